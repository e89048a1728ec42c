"""A robot of any make under a velocity command: its reference, and closed loops with pushes and steering."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.gaits.feet import Feet
from dojo_opt.mpc.settings import OPTIONS
from dojo_opt.problems.pushed_object import PushedObject
from dojo_opt.tasks.commanded import CommandedGait
from dojo_opt.tasks.legged import _period


def steering(time):
    return (0.2, 0.0, 0.0) if time < 0.5 else (0.15, 0.05, 0.6)


@pytest.fixture(scope="module")
def mpc():
    return dojo.tasks.legged_mpc(dojo.models.quadruped(damper=0.0), velocity=steering)


def test_the_reference_of_a_turning_robot_goes_on_and_its_feet_stand_still(mpc):
    gait, sim = mpc.references._moving[0][1], mpc.sim
    gait.anchor(0.0, mpc.start)
    before = gait([0.6])[0]
    gait.anchor(0.6, mpc.start)  # the command has changed
    t = 0.6 + np.arange(0.0, 1.2, 0.004)
    x, then = gait(t), gait(t - sim.time_step)
    np.testing.assert_allclose(x[0, :2], before[:2], atol=1e-6)
    rates = sim.difference(x, then)[:, : sim.nv] / sim.time_step
    np.testing.assert_allclose(x[10:, sim.nq :], rates[10:], atol=1e-9)
    heading = 2.0 * np.arctan2(x[:, 6], x[:, 3])
    assert heading[-1] - heading[0] == pytest.approx(0.6 * (t[-1] - t[0]), abs=0.02)
    ahead = x[-1, sim.nq] * np.cos(heading[-1]) + x[-1, sim.nq + 1] * np.sin(heading[-1])
    assert ahead == pytest.approx(0.15, abs=0.01)
    feet = Feet(sim).positions(x)
    still = np.linalg.norm(np.diff(feet, axis=0), axis=-1) < 2e-4  # rows between samples of the gait are interpolated
    assert 0.4 < still.mean() < 0.6, still.mean(axis=0)
    gait.anchor(0.0, mpc.start)
    np.testing.assert_array_equal(gait([0.0])[0], mpc.start)


def test_references_of_a_model_of_higher_order_have_the_velocities_of_their_times(mpc):
    """Those over a time step are half a step late, which accelerations show."""
    robot = mpc.sim.mechanism
    make = partial(_period, "trot", period=0.48, step_height=0.05)
    sims = [dojo.Simulator(robot, 0.04), dojo.Simulator(robot, 0.04, order=4)]
    t, e = 0.48 + 0.04 * np.arange(12), 2.5e-3  # at samples of the gait
    mean, node = (CommandedGait(sim, make, (0.2, 0.0, 0.3)) for sim in sims)
    nq, nv = sims[0].nq, sims[0].nv
    np.testing.assert_allclose(mean(t)[:, :nq], node(t)[:, :nq], atol=1e-9)
    actual = sims[0].difference(node(t + e), node(t - e))[:, :nv] / (2.0 * e)
    off = [np.abs(gait(t)[:, nq:] - actual)[:, 6:].mean() for gait in (mean, node)]
    assert off[1] < 0.1 * off[0], off
    placed, turn = CommandedGait(sims[0], make, (0.2, 0.0, 0.3), place=(2.0, -1.0, 1.3)), np.exp(1.3j)
    x, there = mean(t), placed(t)
    for first, shift in ((0, 2.0 - 1.0j), (nq, 0.0)):  # the base, and its velocity
        moved = turn * (x[:, first] + 1j * x[:, first + 1]) + shift
        np.testing.assert_allclose(there[:, first] + 1j * there[:, first + 1], moved, atol=1e-12)
    np.testing.assert_allclose(there[:, 7:nq], x[:, 7:nq], atol=1e-12)


def test_a_robot_is_steered_and_pushed(mpc):
    push = dojo.Push(0.8, (0.0, 4.0, 0.0), duration=0.05)
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, pushes=[push]), 1.6)
    assert loop.survived, loop.message
    assert (1.0 - 2.0 * (loop.x[:, 4] ** 2 + loop.x[:, 5] ** 2)).min() > 0.95
    heading = 2.0 * np.arctan2(loop.x[:, 6], loop.x[:, 3])
    assert heading[-1] > 0.4 and loop.x[-1, 0] > 0.2


def test_every_tick_after_a_push_has_a_new_plan():
    """Line searches alone rejected up to four plans in a row, in which a Go2 drifted on, and fell."""
    push = 6.0 * np.array([np.cos(np.radians(240.0)), np.sin(np.radians(240.0)), 0.0])

    def rejected(**settings):
        mpc = dojo.tasks.legged_mpc(dojo.models.quadruped(damper=0.0), **settings)
        pushed = dojo.tasks.plant(mpc, 2e-3, pushes=[dojo.Push(0.5, push, duration=0.1)])
        assert dojo.closed_loop(mpc, pushed, 1.2).survived
        return sum(tick.fallback for tick in mpc.log)

    assert rejected() == 0 and rejected(options=OPTIONS) > 1


@pytest.mark.parametrize("gait", ["bound", "hop"])
def test_gaits_with_a_flight_have_references_within_the_stops_of_the_joints(gait):
    mpc = dojo.tasks.legged_mpc(dojo.models.quadruped(), gait)
    low, high = mpc.sim.mechanism.coordinate_limits
    states = mpc.problem.costs[0].reference[:, 7 : mpc.sim.nq]
    assert np.all((states >= low[7:]) & (states <= high[7:])) and np.ptp(states, axis=0).max() > 0.1


def test_an_unknown_gait_or_command_is_refused():
    with pytest.raises(ValueError, match="gallop"):
        dojo.tasks.legged_mpc(dojo.models.quadruped(), "gallop")
    with pytest.raises(ValueError, match="velocity"):
        dojo.tasks.legged_mpc(dojo.models.quadruped(), velocity=(0.1, 0.2))


@pytest.mark.parametrize(
    "settings, text",
    [
        ({"feet": ["FL_toe"]}, r"feet=\.\.\.\).*FL_toe"),
        ({"damping": -1.0}, r"damping=\.\.\.\)"),
        ({"stance": {"FL_knee": 1.0}}, r"stance=\.\.\.\).*FL_knee"),
        ({"duty": 1.5}, r"duty=\.\.\.\)"),
        ({"step_height": 3.0}, "reach|nearer"),
    ],
)
def test_a_refused_argument_names_the_call_of_the_user(settings, text):
    """Not that of `Legs` or of the gait, which the controller calls."""
    with pytest.raises(ValueError, match=rf"^tasks\.legged_mpc\(.*{text}"):
        dojo.tasks.legged_mpc(dojo.models.quadruped(), **settings)


def test_an_arm_that_is_folded_finds_a_place_to_push_from():
    """Below the hand of straight links that stand on end is the base, where no hand reaches."""
    names, link = ("a", "b", "c"), dojo.Capsule(0.02, 0.3)
    joints = [
        dojo.Joint("revolute", parent, child, parent_point=(0, 0, 0.15) if parent else (0, 0, 0),
                   child_point=(0, 0, -0.15), axis=axis, limits=(-2.2, 2.2))
        for parent, child, axis in zip((None, "a", "b"), names, ((0, 0, 1), (0, 1, 0), (0, 1, 0)), strict=True)
    ]  # fmt: skip
    arm = dojo.Mechanism([dojo.Body(name, 1.0, shape=link) for name in names], joints)
    box = dojo.Body("box", 0.2, shape=dojo.Box(0.1, 0.1, 0.1))
    tip = (0.0, 0.0, 0.15)
    problem = dojo.problems.push(arm, box, (0.0, 0.1), offset=tip, duration=0.5)
    at = problem.sim.mechanism.q_slice("box").start
    assert problem.start[at] == pytest.approx(0.0, abs=1e-9) and 0.2 < problem.start[at + 1] < 0.6
    with pytest.raises(ValueError, match=r"out of reach.*start=\.\.\."):
        dojo.problems.push(arm, box, (0.0, 0.1), offset=tip, at=(0.0, 0.0, 0.0))


@pytest.mark.slow
def test_links_of_a_pushing_arm_stay_outside_the_object():
    """From its neutral state the arm reached behind the box with its wrist inside it, of which nothing was said."""
    half = np.array([0.1, 0.1, 0.15])
    box = dojo.Body("box", 0.5, shape=dojo.Box(*(2.0 * half)))
    problem = dojo.problems.push(dojo.models.panda(gripper=False), box, (0.2, 0.0))
    bodies = problem.sim.maximal(problem.states0)[..., :3]
    links, thing = bodies[:, :-1], bodies[:, -1:]
    assert problem.sim.mechanism.body_names[-1] == "box"
    assert (np.abs(links - thing) > half).any(axis=-1).all() and links[..., 2].min() > 0.0


def test_links_that_cannot_stay_outside_are_told():
    """The ball is at the rear end of a sliding rod."""
    joints = [dojo.Joint("prismatic", None, "rod", axis=(0, 1, 0), parent_point=(0, 0, 0.05))]
    arm = dojo.Mechanism([dojo.Body("rod", 1.0, shape=dojo.Box(0.02, 0.2, 0.02))], joints)
    box = dojo.Body("box", 0.2, shape=dojo.Box(0.1, 0.1, 0.1))
    with pytest.warns(UserWarning, match="go through the object"):
        dojo.problems.push(arm, box, (0.0, 0.1), offset=(0.0, -0.1, 0.0), duration=0.2)


def test_shapes_of_a_pushed_object_keep_their_friction():
    joints = [dojo.Joint("prismatic", None, "rod", axis=(0, 1, 0), parent_point=(0, 0, 0.05))]
    arm = dojo.Mechanism([dojo.Body("rod", 1.0, shape=dojo.Box(0.02, 0.2, 0.02))], joints)
    parts = [
        dojo.Box(0.1, 0.1, 0.05, center=(0, 0, z), friction=mu, name=name)
        for name, z, mu in (("foot", -0.025, 0.1), ("lid", 0.025, 0.9))
    ]
    body = dojo.Body("box", 0.2, shape=[*parts, dojo.Sphere(0.02, name="knob")])
    mech = dojo.problems.push(arm, body, (0.0, 0.1), offset=(0.0, 0.1, 0.0), duration=0.2).sim.mechanism
    expected = {"foot": 0.1, "lid": 0.9, "knob": 0.5}
    assert {c.name.split("_")[0].split(".")[1]: c.friction for c in mech.contacts} == expected
    assert [c.friction for c in mech.collisions] == list(expected.values())
    with pytest.raises(ValueError, match="rolls along its way"):
        dojo.problems.push(arm, dojo.Body("ball", 0.2, shape=dojo.Sphere(0.05)), (0.0, 0.1))


def test_an_object_that_would_tip_over_is_pushed_further_down():
    box = dojo.Body("box", 0.2, shape=dojo.Box(0.04, 0.1, 0.1))
    thing = PushedObject.of(box, np.array([0.0, 0.3, 0.0]), 5)
    assert thing.hands(0.01)[:, 2] == pytest.approx(0.8 * 0.02 / 0.5)
    slippery = replace(box, shape=dojo.Box(0.04, 0.1, 0.1, friction=0.3))
    assert PushedObject.of(slippery, thing.way, 5).hands(0.01)[:, 2] == pytest.approx(0.05)


@pytest.mark.slow
def test_an_arm_pushes_a_box_along_a_table():
    box = dojo.Body("box", 0.5, shape=dojo.Box(0.1, 0.1, 0.1))
    arm = dojo.models.panda(gripper=False)
    start = (0, -0.8, 0, -2.3, 0, 1.6, 0.8)
    problem = dojo.problems.push(arm, box, (0.0, 0.2), start=start, radius=0.05, duration=1.2)
    plan = dojo.ilqr(problem)
    assert plan.success and plan.nit < 60, plan.message
    at = problem.sim.mechanism.q_slice("box")
    np.testing.assert_allclose(plan.x[-1, at][:2] - plan.x[0, at][:2], (0.0, 0.2), atol=1e-3)
    shot = plan.replay(time_step=plan.time_step / 5)
    assert shot.success
    np.testing.assert_allclose(shot.x[-1, at][:2] - shot.x[0, at][:2], (0.0, 0.2), atol=0.01)
    with pytest.raises(ValueError, match="displacement"):
        dojo.problems.push(arm, box, (0.0, 0.0))
    with pytest.raises(ValueError, match="out of reach"):
        dojo.problems.push(arm, box, (2.0, 0.0), start=start)
