"""The reference problems with the default settings, held to the numbers that they are published with."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt import problems
from dojo_opt.planning.ilqr import ilqr
from dojo_opt.viewer.motion import motion

pytestmark = pytest.mark.slow


def replayed(problem, plan, kappa):
    """The plan under its own gains on a harder contact."""
    shot = plan.replay(time_step=plan.time_step, kappa=kappa)
    assert shot.status == 0
    return problem.violation(shot.x, shot.u)


@pytest.mark.parametrize("substeps, iterations, cost", [(1, 35, 5.6), (5, 50, 5.9)])
def test_hop(substeps, iterations, cost):
    problem = problems.hop(substeps=substeps)
    plan = ilqr(problem)
    assert plan.success, plan.summary()
    assert plan.nit <= iterations and plan.fun <= cost
    assert plan.violation <= 1e-3 and replayed(problem, plan, 1e-8) <= 2e-3
    assert plan.x[:, 2].max() > 0.75


@pytest.mark.parametrize("name, off", [("hop", 0.02), ("block", 0.08), ("trot", 0.01)])
def test_plans_hold_to_an_accuracy(name, off):
    """To the last knot, and converged: a tenth of the accuracy is the same motion."""
    plan = ilqr(getattr(problems, name)())
    shots = [plan.replay(accuracy=accuracy) for accuracy in (1e-4, 1e-5)]
    assert all(shot.status == 0 and len(shot.u) == len(plan.u) for shot in shots)
    assert np.abs(shots[0].x - shots[1].x)[:, :3].max() < 1e-3
    assert np.abs(shots[1].x[-1, :3] - plan.x[-1, :3]).max() < off


def test_replays_of_robots_that_begin_on_the_ground_begin_at_rest():
    """A replay that began with half a step of falling ended 5 mm too low, at every accuracy."""
    plan = ilqr(problems.stand_up(dojo.models.quadruped()))
    shot = plan.replay(accuracy=1e-4)
    nq = plan.simulator.nq
    assert np.abs(shot.x[0, nq:]).max() < 0.03  # [m/s, rad/s]; half a step of falling is .1 m/s
    assert np.abs(shot.x[:, :3] - plan.x[:, :3]).max() < 2e-3


def test_replays_with_shorter_steps_keep_the_stiffness_of_contacts():
    """With the kappa of the plan an arm lost its box: contacts were ten times as soft as those of its gains."""
    box = dojo.Body("box", 0.5, shape=dojo.Box(0.1, 0.1, 0.1))
    problem = problems.push(dojo.models.panda(gripper=False), box, (0.2, 0.0))
    problem.gain_regularization = 0.0  # lower gains forgive more
    plan = ilqr(problem)
    sim, h = plan.simulator, plan.time_step / 10
    off, soft = (
        np.abs(sim.difference(plan.x, plan.replay(time_step=h, kappa=kappa).x)[:, : sim.nv]).max()
        for kappa in (None, sim.kappa)
    )
    assert off < 3e-3 < 3e-2 < soft
    same = plan.replay(time_step=plan.time_step)
    assert np.abs(same.x - plan.x).max() < 1e-5
    shown = motion(same)
    np.testing.assert_allclose(shown.time, plan.time, atol=1e-12)
    assert len(shown.normal_force) == len(plan.u) * plan.substeps
    with pytest.raises(ValueError, match="whole part of the knot of .* s, such as"):
        plan.replay(time_step=0.7 * plan.time_step)
    with pytest.raises(ValueError, match="no accuracy beside it"):
        plan.replay(time_step=h, accuracy=1e-4)


def test_hop_to_random_targets():
    targets = np.random.default_rng(42).uniform(-0.6, 0.6, size=(10, 2))
    plans = [ilqr(problems.hop(target=target)) for target in targets]
    assert all(plan.success for plan in plans), [plan.message for plan in plans]
    assert np.median([plan.nit for plan in plans]) <= 26


@pytest.mark.parametrize("goal, iterations, cost", [("right", 30, 9.1), ("up", 20, 14.0)])
def test_block(goal, iterations, cost):
    problem = problems.block(goal)
    plan = ilqr(problem)
    assert plan.success, plan.summary()
    assert plan.nit <= iterations and plan.fun <= cost
    assert plan.violation <= 1e-3 and replayed(problem, plan, 1e-8) <= 2e-3


@pytest.mark.parametrize("name", ["pendulum", "cartpole", "acrobot"])
def test_swingup(name):
    plan = ilqr(problems.swingup(name))
    assert plan.success and plan.violation <= 1e-3


def test_unknown_names():
    with pytest.raises(ValueError, match="'left' is not one of: right, up"):
        problems.block("left")
    with pytest.raises(ValueError, match="'octopus' is not one of: pendulum, cartpole, acrobot"):
        problems.swingup("octopus")
