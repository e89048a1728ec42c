"""Messages of plans that fail because inputs are too weak, or a goal too far: the reason, and what to change."""

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.gaits.take_off import highest_rise
from dojo_opt.planning.overload import demand

KNEE = 1.5  # [rad] from stop to stop of the library's quadruped


@pytest.fixture(scope="module")
def swing():
    """A pendulum that has to stand on end after ten knots."""

    def make(limit, **settings):
        sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
        top = np.array([np.pi, 0.0])
        return dojo.Problem(
            sim,
            sim.neutral(),
            10,
            cost=dojo.cost.Effort(1.0),
            constraints=dojo.constraint.Goal(top),
            control_limits=(-limit, limit),
            **settings,
        )

    return make


def test_a_plan_that_fails_at_its_limits_says_so(swing):
    plan = dojo.ilqr(swing(0.2, advice="Try a longer horizon."))
    assert not plan.success
    name = plan.problem.sim.mechanism.input_names[0]
    assert f"at their limits at 100% of the knots, most often {name!r}. Try a longer horizon." in plan.message
    assert plan.message.count("  ") == 0 and plan.message.endswith(".")


def test_a_guess_beyond_the_limits_is_told_where_no_plan_is_found(swing):
    guess = np.linspace(-0.1, 0.6, 10)[:, None]
    problem = swing(0.2, controls0=guess)
    np.testing.assert_allclose(demand(problem), np.abs(guess) / 0.2)
    assert "The guess needs 3 times the limit of input" in dojo.ilqr(problem, max_iterations=3).message
    free = swing(np.inf, controls0=guess, advice="Try another.")
    np.testing.assert_array_equal(demand(free), 0.0)
    plan = dojo.ilqr(free)
    assert plan.success and plan.message == "Solved to the requested tolerance."


def test_an_arm_above_ground_is_told_to_omit_it():
    arm, leg = dojo.models.pendulum(), dojo.models.raiberthopper()
    grounded = replace(arm, contacts=[dojo.Contact(arm.body_names[0], height=-9.0)])
    found = [dojo.Problem(sim, sim.neutral(), 5).advice for sim in map(dojo.Simulator, (arm, leg, grounded))]
    assert found[:2] == ["", ""] and "ground=False" in found[2]


def test_a_jump_that_is_too_high_names_the_weakest_joint():
    """It used to end with its iteration limit, and no word on the torques of such a jump."""
    plan = dojo.ilqr(dojo.problems.jump(height=2.0), max_iterations=2)
    assert not plan.success
    assert "times the limit of input" in plan.message and "Try a smaller height" in plan.message


def test_a_jump_beyond_the_strength_of_the_legs_is_refused():
    """Such a jump used to be planned for 64 to 95 s, and to fail."""
    with pytest.raises(ValueError, match=r"'quadruped' rises by 2\.\d+ m at most, .* got 3.00 m"):
        dojo.problems.jump(height=3.0)
    assert dojo.problems.jump(height=3.0, control_limits=(-50.0, 50.0)).refinement == 5


def test_the_highest_rise_is_the_work_of_the_legs_over_the_weight():
    """rise + stroke = work / (m g): proportional to the torques, and to 1 / g."""
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=0.02)
    weak, usual, strong = (highest_rise(sim, (-limit, limit)) for limit in (1e-6, 10.0, 20.0))
    light = highest_rise(sim.replace(mechanism=replace(sim.mechanism, gravity=(0.0, 0.0, -4.905))), (-10.0, 10.0))
    assert strong - weak == pytest.approx(2.0 * (usual - weak), rel=1e-6)
    assert light == pytest.approx(strong, rel=1e-6)
    assert -0.3 < weak < 0.0  # of legs that are this long
    knees = 4 * 10.0 * KNEE / (sum(body.mass for body in sim.mechanism.bodies) * 9.81)
    assert knees < usual - weak < 2.0 * knees  # where friction lets the hips help
    assert highest_rise(sim, (-np.inf, 10.0)) == np.inf
