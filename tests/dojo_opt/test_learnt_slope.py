"""A slope that is learnt from the feet that stand: the ground that turns, the fit, and references that go with it."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.mpc.ground_estimate import Ground
from dojo_opt.mpc.policy import Policy
from dojo_opt.plant.ground_plane import GroundPlane
from dojo_opt.plant.plant import Plant
from sim.simulator.adjustable_simulator import AdjustableSimulator

SLOPE, HEADING = 0.1, 0.7
RISE = tuple(np.tan(SLOPE) * np.array([np.cos(HEADING), np.sin(HEADING)]))


@pytest.fixture(scope="module")
def robot():
    return dojo.Simulator(dojo.models.quadruped(), time_step=5e-3, kappa=1e-4)


def test_ground_turned_in_place_is_ground_made_so(robot):
    """Steps and derivatives are the same to the bit, of a planner's horizon, too, and in a thread that has stepped."""
    plant = Plant(robot, slope=SLOPE, slope_heading=HEADING)
    made, turned, x = plant.simulator, AdjustableSimulator.like(robot), plant.x
    u = np.zeros((4, 12))
    planner = turned.horizon(4)
    before = planner.roll(x, np.tile(x, (5, 1)), u, 1e-4).x
    results = []
    with ThreadPoolExecutor(1) as thread:
        for normal in ((0.0, 0.0, 1.0), plant.perturbation.normal):
            turned.turn_ground(normal)
            results.append(thread.submit(turned.rollout, x, u).result().x)
            np.testing.assert_array_equal(results[-1], turned.rollout(x, u).x)
    assert np.abs(results[0] - results[1]).max() > 1e-4
    np.testing.assert_array_equal(results[1], made.rollout(x, u).x)
    planned = planner.roll(x, np.tile(x, (5, 1)), u, 1e-4).x
    assert np.abs(planned - before).max() > 1e-4
    np.testing.assert_array_equal(planned, made.horizon(4).roll(x, np.tile(x, (5, 1)), u, 1e-4).x)
    for own, other in zip(turned.linearize(x, u[0]), made.linearize(x, u[0]), strict=True):
        np.testing.assert_array_equal(own, other)
    with pytest.raises(ValueError, match="order 2"):
        AdjustableSimulator.like(robot.replace(order=4)).turn_ground((0.0, 0.0, 1.0))


def test_references_are_carried_as_a_plant_is(robot):
    """In place, where the plant of a slope turns its robot about the origin; on level ground they are raised."""
    x = robot.neutral()[None]
    x[0, robot.nq] = 0.5
    plane = GroundPlane(0.0, RISE)
    carried, there = plane.carry(x, robot.mechanism)[0], Plant(robot, slope=SLOPE, slope_heading=HEADING).x
    np.testing.assert_allclose(plane.normal, dojo.Perturbation(slope=SLOPE, slope_heading=HEADING).normal, atol=1e-12)
    np.testing.assert_allclose(carried[3:7], there[3:7], atol=1e-12)
    np.testing.assert_allclose(plane.normal @ (carried[:3] - there[:3]), 0.0, atol=1e-12)
    np.testing.assert_allclose(plane.normal @ carried[robot.nq : robot.nq + 3], 0.0, atol=1e-12)
    for other, rises in ((robot.mechanism, 2), (dojo.models.halfcheetah(), 1), (dojo.models.panda(), None)):
        level = np.r_[other.neutral, np.zeros(other.nv)][None]
        moved = GroundPlane(0.3).carry(level, other) - level
        np.testing.assert_allclose(moved, 0.3 * (np.arange(other.nq + other.nv) == rises)[None], atol=1e-15)


def test_the_slope_is_learnt_from_feet_that_stand(robot):
    """To rounding, at once from four and then from two; a foot that is still high in the air says nothing."""
    own = AdjustableSimulator.like(robot)
    ground = Ground(own, kappa=1e-2)
    x = Plant(robot, slope=SLOPE, slope_heading=HEADING).x
    policy = Policy(own, 0.0, np.tile(x, (3, 1)), np.zeros((2, 12)), np.zeros((2, 12, 36)))
    ground.learn(policy, 0.0, x, (-0.005, x))
    np.testing.assert_allclose(ground.plane.slope, RISE, rtol=0.05)  # the slope before weighs a little
    for tick in range(1, 6):
        ground.learn(policy, 0.025 * tick, x, (0.025 * tick - 0.005, x))
    np.testing.assert_allclose(ground.plane.slope, RISE, rtol=1e-6)
    feet = ground.points(x)[[n.endswith("foot") or "foot" in n for n in ground.names]]
    np.testing.assert_allclose(feet @ ground.plane.normal, ground.height[0], atol=1e-9)
    bent = x.copy()
    bent[9] -= 0.8  # a leg drawn up by 6 cm, and held
    ground.learn(policy, 0.2, bent, (0.195, bent))
    np.testing.assert_allclose(ground.plane.slope, RISE, rtol=1e-6)
    ground.forget()
    assert ground.plane == GroundPlane() and np.all(ground.height == 0.0)
    with pytest.raises(ValueError, match="one level plane"):
        Ground(dojo.Simulator(dojo.models.cartpole(), time_step=0.01), kappa=1e-2)
    with pytest.raises(ValueError, match="'slope'"):
        dojo.tasks.free_gait_mpc(learn_ground="plane")
