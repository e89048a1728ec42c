"""`tasks.humanoid_mpc`: a cadence and a velocity, and no footholds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.legs import Legs
from dojo_opt.tasks.walking import SteppingPose
from support.benchmark import loaded


@pytest.fixture(scope="module")
def bench():
    yield from loaded("humanoids")


@pytest.fixture(scope="module")
def legs():
    return Legs(dojo.models.atlas())


def test_a_bent_leg_lifts_its_foot_and_keeps_it_level(legs):
    """Below the hip: Atlas' thigh and shank are nearly equal, so that the foot hardly moves forward."""
    sim = legs.simulator(0.01, 1e-6)
    x, bends = sim.neutral(), legs.bends()
    assert bends.shape == (2, sim.nq)
    for k, row in enumerate(bends):
        bent = x.copy()
        bent[: sim.nq] += 0.4 * row
        moved = Feet(sim).positions(bent) - Feet(sim).positions(x)
        own, other = moved[4 * k : 4 * k + 4], moved[4 - 4 * k : 8 - 4 * k]
        assert not other.any()
        assert own[:, 2].min() > 0.1
        assert np.ptp(own[:, 2]) < 1e-9  # level
        assert np.abs(own[:, :2]).max() < 0.05


def test_a_march_moves_on_along_the_horizon_and_bends_its_legs_in_turn(legs):
    sim = legs.simulator(0.01, 1e-6)
    pose, bends = sim.neutral(), np.pad(legs.bends(), ((0, 0), (0, sim.nv)))
    march = SteppingPose(pose, (0.4, 0.0, 0.5), 0.1, bends, (1.0, 0.4, 0.6))
    march.anchor(0.0, pose)
    rows = march([0.0, 0.2, 0.45, 0.7])
    knees = [sim.mechanism.q_slice(f"{side}_leg_kny").start for side in "lr"]
    np.testing.assert_allclose(rows[:, knees] - pose[knees], [[0, 0], [1.2, 0], [0, 0], [0, 1.2]], atol=1e-12)
    np.testing.assert_allclose(2.0 * np.arctan2(rows[:, 6], rows[:, 3]), [0.0, 0.1, 0.225, 0.35])
    np.testing.assert_allclose(np.hypot(rows[:, sim.nq], rows[:, sim.nq + 1]), 0.4)
    np.testing.assert_allclose(rows[0, :2], pose[:2])
    assert rows[3, 0] - pose[0] == pytest.approx(0.7 * 0.4 * np.cos(0.35))
    march.anchor(10.0, pose)  # a robot that does not move holds it back
    assert np.hypot(*(march([10.0])[0, :2] - pose[:2])) == pytest.approx(0.1)


def test_a_robot_on_four_feet_is_refused():
    with pytest.raises(ValueError, match="two feet"):
        dojo.tasks.humanoid_mpc(robot=dojo.models.quadruped())
    with pytest.raises(ValueError, match="velocity"):
        dojo.tasks.humanoid_mpc((0.3, 0.0))


def test_plans_know_the_limits_of_the_inputs(legs):
    """A robot with limits of torque plans within them; Atlas has none."""
    assert dojo.tasks.humanoid_mpc().problem.control_limits is None
    weak = [replace(part, limits=(-300.0, 300.0)) for part in legs.mechanism.inputs]
    mpc = dojo.tasks.humanoid_mpc(robot=replace(legs.mechanism, inputs=weak))
    np.testing.assert_array_equal(np.abs(mpc.problem.control_limits), 300.0)
    assert [contact.friction for contact in mpc.sim.mechanism.contacts] == pytest.approx([0.75 * 0.8] * 8)


def test_the_benchmark_measures_speed_along_the_path(bench):
    """A base that runs a circle of 1.5 m radius at .3 m/s, and turns with it; of a robot that fell nothing counts."""
    time = np.arange(0.0, 10.0, 1e-3)
    x = np.zeros((time.size, 14))
    x[:, 0], x[:, 1] = 1.5 * np.sin(0.2 * time), 1.5 * (1.0 - np.cos(0.2 * time))
    x[:, 3], x[:, 6] = np.cos(0.1 * time), np.sin(0.1 * time)
    loop = SimpleNamespace(x=x, simulator=SimpleNamespace(time_step=1e-3), survived=True)
    assert bench.speeds("turn", loop) == (pytest.approx(0.3, rel=1e-3), pytest.approx(0.2, rel=1e-3))
    assert not bench.succeeds("walk_4", loop) and not bench.succeeds("turn", loop)  # no turn, and .4 rad/s
    x[:, 3], x[:, 6] = 1.0, 0.0
    x[:, 0], x[:, 1] = 0.45 * time, 0.0
    assert bench.succeeds("walk_4", loop) and not bench.succeeds("walk_2", loop)
    x[:, 0] *= -1.0
    assert not bench.succeeds("walk_4", loop)  # backward
    x[:, 0] *= -1.0
    loop.survived = False
    assert not bench.succeeds("walk_4", loop)


def test_uneven_ground_is_level_at_the_start_and_as_rough_as_it_says(bench):
    ground = bench.uneven(np.random.default_rng(0))
    at = np.linspace(-3.0, 3.0, 121)
    x, y = (part.ravel() for part in np.meshgrid(at, at))
    z = ground.height(x, y)
    assert 0.045 < np.ptp(z) < 0.055
    assert np.abs(z[np.hypot(x, y) < 0.4]).max() < 1e-3


@pytest.mark.slow
def test_atlas_walks_and_catches_itself():
    """Pushed by 30 N s, on slippery ground: it is 1.1 m on after 3 s, and both feet have left the ground."""
    mpc = dojo.tasks.humanoid_mpc((0.4, 0.0, 0.0))
    push = dojo.Push(1.0, (0.0, 30.0, 0.0), body="utorso")
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, pushes=[push], friction=0.6), 3.0)
    assert loop.survived, loop.message
    assert loop.x[-1, 0] - loop.x[0, 0] > 0.8
    gap = loop.contacts.gap
    assert gap[:, :4].min(axis=1).max() > 0.01 and gap[:, 4:].min(axis=1).max() > 0.01
    assert not any(np.abs(tick.cost) > 1e6 for tick in loop.log)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:load_urdf")  # of grippers whose joints follow none
@pytest.mark.parametrize("name", ["g1", "talos"])
def test_robots_of_files_walk(bench, name):
    """By the same weights in units of height and weight, from a stance off the stops of all joints."""
    try:
        robot = bench.robot(name)
    except SystemExit as needed:
        pytest.skip(str(needed))
    mpc = dojo.tasks.humanoid_mpc((0.3, 0.0, 0.0), robot=robot)
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3), 2.0)
    assert loop.survived, loop.message
    assert loop.x[-1, 0] - loop.x[0, 0] > 0.3
    assert sum(tick.fallback for tick in loop.log) < 3


def test_the_search_for_a_stance_moves_the_legs_alone(legs):
    """A search that begins anew from random coordinates once flung the arms of Atlas to their stops."""
    before = dojo.models.atlas()
    moved = [
        joint.name
        for joint in before.joints[1:]
        if not np.allclose(*(np.asarray(m.neutral)[m.q_slice(joint.name)] for m in (before, legs.mechanism)), atol=1e-9)
    ]
    assert {name.partition("_leg")[0] for name in moved} <= {"l", "r"}, moved
    left, right = (sorted(name[1:] for name in moved if name.startswith(side)) for side in "lr")
    assert left == right and len(left) >= 3


@pytest.mark.slow
def test_atlas_leaps_and_lands():
    """From rest and a goal: it flies for .3 s, and under the gains of the plan it lands at the accuracy of 1e-5."""
    problem = dojo.problems.humanoid_leap()
    assert np.ptp(problem.states0, axis=0).max() == 0.0  # the guess stands
    plan = dojo.ilqr(problem)
    assert plan.success, plan.message
    feet = Feet(problem.sim)
    lowest = feet.gaps(plan.x).min(axis=1)
    assert lowest.max() > 0.1
    assert (lowest > 5e-3).sum() * plan.time_step * plan.substeps > 0.3
    replay = plan.replay(accuracy=1e-5)
    assert replay.status.name == "SOLVED", replay.status
    assert np.abs(replay.x[-1, :3] - plan.x[-1, :3]).max() < 5e-3
    assert plan.x[-1, 0] - plan.x[0, 0] == pytest.approx(0.1 * Legs(dojo.models.atlas()).size, abs=1e-3)
