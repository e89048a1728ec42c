"""Leaps and flips of the quadruped: found from a goal, as high as asked, and they land."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt import problems
from dojo_opt.planning.ilqr import ilqr
from dojo_opt.planning.options import CONTINUATION
from dojo_opt.problems.locomotion import standing
from support.planned_legs import lands, lowest_foot


@pytest.mark.parametrize(
    "distance, height",
    [(0.3, 0.2)] + [pytest.param(*leap, marks=pytest.mark.slow) for leap in [(0.2, 0.2), (0.3, 0.3), (-0.2, 0.2)]],
)
def test_leap_is_found_from_standing_and_a_goal(distance, height):
    """Planned with steps of 20 ms it may stumble in shorter ones; cut into five at last, it holds at 1 ms.

    From the rollout of the torques of standing, which falls on its back, half of such leaps are not found.
    """
    problem = problems.leap(distance=distance, height=height)
    assert np.ptp(problem.states0[1:], axis=0).max() == 0.0 and np.ptp(problem.controls0, axis=0).max() == 0.0
    plan = ilqr(problem)
    assert plan.success and plan.nit <= 80, plan.summary()
    assert plan.nit == len(plan.history) and plan.substeps == 5 and plan.time[-1] == pytest.approx(1.0)
    assert plan.x[:, 2].max() - plan.x[0, 2] == pytest.approx(height, abs=0.01)
    assert lowest_foot(problem, plan).max() > 0.1
    assert plan.x[-1, 0] - plan.x[0, 0] == pytest.approx(distance, abs=2e-3)
    lands(problem, plan)


@pytest.mark.slow
def test_a_leap_leads_to_a_longer_one():
    """A plan of a shorter one, without its refinement, is a guess for it."""
    shorter, longer = (problems.leap(distance=distance, height=0.25) for distance in (0.4, 0.5))
    shorter.refinement = 1
    plan = ilqr(longer, warm_start=ilqr(shorter))
    assert plan.success and plan.nit <= 200, plan.summary()  # 179, where it takes 311 without that guess
    assert plan.x[-1, 0] - plan.x[0, 0] == pytest.approx(0.5, abs=2e-3)
    assert plan.x[:, 2].max() - plan.x[0, 2] == pytest.approx(0.25, abs=0.01)
    lands(longer, plan)


@pytest.mark.slow
def test_a_leap_that_is_too_high_is_no_success():
    """With motors of a seventh of the torque the robot cannot rise by .3 m, and the plan says that it misses something."""
    problem = problems.leap(height=0.3)
    problem.control_limits = (np.full(12, -5.0), np.full(12, 5.0))
    plan = ilqr(problem, max_iterations=40)
    assert not plan.success
    assert "Largest violation: " in plan.message and "Goal of trunk" in plan.message


@pytest.mark.slow
def test_a_backflip_is_found_and_lands():
    """Once around, backwards, its legs free; replayed to 1e-5 it ends on its feet, where the plan does."""
    problem = problems.backflip()
    legs = problem.states0[1:, 7:19]
    assert np.ptp(legs, axis=0).max() == 0.0 and np.ptp(problem.controls0, axis=0).max() == 0.0
    plan = ilqr(problem)
    assert plan.success, plan.summary()
    angle = np.unwrap(2.0 * np.arctan2(plan.x[:, 5], plan.x[:, 3]))
    assert angle[-1] - angle[0] == pytest.approx(-2.0 * np.pi, abs=0.02)
    assert np.all(np.abs(plan.u) <= 33.5 + 1e-9)
    assert np.ptp(plan.x[:, 7:19], axis=0).max() > 0.5  # its legs push, and fold
    assert np.abs(plan.x[-6:, :7] - plan.x[-1, :7]).max() < 2e-3  # its base stands for the last tenth of a second
    shot = plan.replay(accuracy=1e-5)
    assert shot.status == 0, shot.message
    assert np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max() < 5e-3
    assert 1.0 - 2.0 * (shot.x[-1, 4:6] ** 2).sum() > 0.99
    assert np.abs(shot.x[-1, 19:]).max() < 0.5  # at rest


def test_a_backflip_to_the_moon_is_refused():
    with pytest.raises(ValueError, match=r"problems.backflip\(height=..., time_step=...\): .* knots need"):
        problems.backflip(height=1e18)
    with pytest.raises(ValueError, match=r"problems.backflip\(height=...\)"):
        problems.backflip(height=0.0)
    with pytest.raises(ValueError, match=r"problems.backflip\(gravity=...\): without gravity"):
        problems.backflip(gravity=(0.0, 0.0, 0.0))


def test_a_guess_stands_at_the_first_smoothing_that_lets_it():
    """At the first two of the planner, a light block floats so high that its upper corners carry as much."""
    sim = dojo.Simulator(dojo.models.block(gravity=(0.0, 0.0, -1.0)), time_step=0.01)
    still, _ = standing(sim)
    gap = still[2] - sim.neutral()[2]  # of four corners that carry 1 N
    assert gap == pytest.approx(4.0 * CONTINUATION[2].kappa_eval / sim.time_step, rel=0.1)


def test_guesses_take_the_gravity_of_the_scene():
    force, moon = (problems.hop(**by).controls0[0] for by in ({}, {"gravity": (0.0, 0.0, -1.62)}))
    np.testing.assert_allclose(moon, force * 1.62 / 9.81)
    flight = 2.0 * np.sqrt(2.0 * 0.4 / 15.0)
    assert problems.backflip(gravity=(0.0, 0.0, -15.0)).horizon == round((0.9 + flight) / 0.02)
