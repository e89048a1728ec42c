"""Closing joints that act have the same effect as in the tree, with the loop cut elsewhere."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere, rotation_matrix
from support.jacobians import check_step
from support.linkage import COUPLER, CRANK, ROCKER, bar, fourbar

Y = (0.0, 1.0, 0.0)
ACTIONS: dict[str, dict[str, Any]] = {
    "spring": {"spring": 30.0, "rest": 0.5},
    "damper": {"damper": 0.7},
    "armature": {"armature": 0.1},
    "limits": {"limits": (-1.0, 2.0)},
    "all": {"spring": 20.0, "damper": 0.3, "armature": 0.05, "limits": (-0.9, 2.0)},
}


def both_cuts(steps: int, u: float = 0.0, **given: Any) -> tuple[tuple[dojo.Simulator, Any], ...]:
    """The same motion with the loop cut at the pin and at the rocker's bearing."""
    ours = dojo.Simulator(fourbar("pin", **given), time_step=0.01, tolerance=1e-11)
    theirs = dojo.Simulator(fourbar("rocker", **given), time_step=0.01, tolerance=1e-11)
    x, y = ours.neutral(), theirs.neutral()
    for joint in ("crank", "coupler", "pin"):
        y[theirs.mechanism.q_slice(joint)] = x[ours.mechanism.q_slice(joint)]
    starts = ((ours, x), (theirs, theirs.close(y)))
    return tuple((sim, sim.rollout(start, np.full((steps, sim.nu), u), throw=True)) for sim, start in starts)


@pytest.mark.parametrize("action", ACTIONS)
def test_an_action_in_the_closing_joint_agrees_with_a_joint_of_the_tree(action: str) -> None:
    """A damper sees another inertia in another tree: the same to second order in the time step."""
    (a, t), (b, reference) = both_cuts(150, **ACTIONS[action])
    atol = {"damper": 1e-4, "limits": 1e-6, "all": 1e-6}.get(action, 1e-8)
    for joint in ("crank", "coupler", "pin"):
        ours, theirs = (s.x[:, m.mechanism.q_slice(joint)] for m, s in ((a, t), (b, reference)))
        np.testing.assert_allclose(ours, theirs, atol=atol, err_msg=joint)
    assert max(np.abs(gap).max() for gap in a.loop_gaps(t.x[-1]).values()) < 1e-10
    assert np.ptp(t.x[:, 0]) > 0.3


def test_a_motor_in_the_closing_joint() -> None:
    (a, t), (b, reference) = both_cuts(100, 3.0, inputs=("pin",))
    assert a.mechanism.input_names == b.mechanism.input_names == ("pin",)
    np.testing.assert_allclose(t.x[:, 0], reference.x[:, 0], atol=1e-8)
    energy = a.energy(t.x)
    work = 3.0 * (t.x[-1, 3] - t.x[0, 3])
    np.testing.assert_allclose(energy[-1] - energy[0], work, atol=0.02 * np.ptp(energy))


def test_inputs_left_out_agree_with_the_tree() -> None:
    mech = fourbar("pin", **ACTIONS["spring"])
    plain = Mechanism(mech.bodies, mech.joints, loops=mech.loops)
    assert [joint.name for joint in mech.joints] == ["crank", "coupler", "rocker", "pin"]
    assert replace(mech) == mech and plain.nv == 4
    given = [replace(j, close=j.name == "pin") for j in fourbar("rocker", **ACTIONS["spring"]).joints]
    bodies = [bar("crank", CRANK), bar("coupler", COUPLER), bar("rocker", ROCKER)]
    ground = Joint("revolute", None, "rocker", "rocker", (1.0, 0, 0), (-ROCKER / 2, 0, 0), axis=Y)
    assert Mechanism(bodies, [*given, ground]).input_names == ("crank", "coupler", "rocker")


def ring(kind: str, **action: Any) -> Mechanism:
    """Four bodies in a floating ring of spherical joints; the last one, of the given kind, acts."""
    bodies = [Body(f"b{k}", 1.0 + 0.3 * k, (0.02, 0.03, 0.04)) for k in range(4)]
    corners = [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (-0.5, 0.0, 0.0), (0.0, -0.5, 0.0)]
    centers = 0.5 * (np.array(corners) + np.roll(corners, -1, axis=0))
    joints = [Joint("floating", None, "b0")]
    for k in range(1, 4):
        at = np.array(corners[k])
        joints.append(Joint("spherical", f"b{k - 1}", f"b{k}", "", at - centers[k - 1], at - centers[k]))
    at = np.array(corners[0])
    last = Joint(kind, "b3", "b0", "last", at - centers[3], at - centers[0], axis=(0.6, 0.0, 0.8), close=True, **action)
    return Mechanism(bodies, [*joints, last], gravity=(0, 0, 0))


TURNED = (0.9887710779360424, 0.0, -0.14943813247359922, 0.0)  # about y: not a multiple of a right angle
RINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "spherical": ("spherical", {"spring": 2.0, "damper": 0.1, "cone": 0.6}),
    "cylindrical": ("cylindrical", {"spring": (50.0, 2.0), "damper": 0.1, "limits": ((-0.1, 0.1), None)}),
    "orbital": ("orbital", {}),
    "screw": ("screw", {"pitch": 0.7, "spring": 2.0, "damper": 0.1, "armature": 0.05}),
    "bushing": ("floating", {"spring": 200.0, "damper": 0.5}),
}


@pytest.mark.parametrize("name", RINGS)
def test_a_floating_ring_that_acts_keeps_its_momentum(name: str) -> None:
    kind, action = RINGS[name]
    sim = dojo.Simulator(ring(kind, **action), time_step=0.01, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(1).normal(size=sim.nv)
    t = sim.rollout(sim.close(x), np.zeros((100, sim.nu)), throw=True)
    p, L = sim.momentum(t.x)
    assert np.ptp(p, axis=0).max() < 1e-10 and np.ptp(L, axis=0).max() < 1e-10
    if action:
        assert sim.energy(t.x[-1]) < sim.energy(t.x[1])


@pytest.mark.sweep(3)
@pytest.mark.parametrize(
    "mechanism",
    [
        *(fourbar("pin", inputs=("pin", "crank"), **action) for action in ACTIONS.values()),
        *(ring(kind, **action) for kind, action in RINGS.values()),
    ],
    ids=[*ACTIONS, *RINGS],
)
def test_derivatives(mechanism: Mechanism) -> None:
    sim = dojo.Simulator(mechanism, time_step=0.02, tolerance=1e-12, kappa=1e-3)
    x = sim.neutral()
    x[sim.nq :] = 0.5 * np.random.default_rng(1).normal(size=sim.nv)
    x = sim.rollout(sim.close(x), np.zeros((3, sim.nu)), throw=True).x[-1]
    u = np.random.default_rng(2).normal(size=sim.nu)
    check_step(sim, x, u)


def test_closing_positions_are_found_from_a_guess() -> None:
    """Neither the tree nor the share of the rocker is where it has to be."""
    mech = replace(fourbar("pin", spring=1.0), neutral={"crank": -0.8, "coupler": 0.3, "rocker": -1.5, "pin": 2.5})
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.neutral()
    assert max(np.abs(gap).max() for gap in sim.loop_gaps(x).values()) < 1e-10
    start = np.concatenate([np.asarray(mech.neutral), np.zeros(sim.nv)])
    assert np.abs(x - start)[:3].max() < 0.5


def test_redundant_constraints_are_reported() -> None:
    sim = dojo.Simulator(fourbar("pin"), time_step=0.01)
    rank = sim.loop_rank()
    assert (rank.constraints, rank.redundant, rank.mobility) == ({"pin": 5}, {"pin": 3}, 1)
    assert rank.weakest > 0.1 and rank.leftover < 1e-9
    text = sim.describe()
    assert "1 degrees of freedom left by 5 constraints, 3 redundant (pin 3 of 5)" in text
    pendulum = Mechanism([bar("crank", 1.0)], [Joint("revolute", None, "crank")])
    with pytest.raises(ValueError, match="has no joint that closes a loop"):
        dojo.Simulator(pendulum).loop_rank()


def test_a_loop_that_contradicts_the_tree_is_refused() -> None:
    """The end of the rocker on a second pin on the ground, next to its first."""
    mech = fourbar("pin")
    rods = [Joint("spherical", None, "rocker", "rod", (1.0, 0.0, 0.2), (-ROCKER / 2, 0, 0), close=True)]
    with pytest.raises(
        ValueError, match="loop joint 'rod' cannot be closed near this state.*contradict the joints of the tree"
    ):
        dojo.Simulator(replace(mech, loops=[*mech.loops, *rods])).neutral()


def test_an_open_loop_that_cannot_close_is_named_when_a_step_fails() -> None:
    mech = Mechanism(
        [Body("a", 1.0, shape=Sphere(0.1)), Body("b", 1.0, shape=Sphere(0.1))],
        [
            Joint("revolute", None, "a", child_point=(0.5, 0, 0), axis=Y),
            Joint("revolute", None, "b", parent_point=(5.0, 0, 0), child_point=(0.5, 0, 0), axis=Y),
            Joint("spherical", "a", "b", "far", (-0.5, 0, 0), (-0.5, 0, 0), close=True),
        ],
        contacts=[Contact("a", radius=0.1)],
    )
    sim = dojo.Simulator(mech, max_iterations=50)
    result = sim.step(np.zeros(4))
    assert not result.success
    with pytest.raises(dojo.SimulationError, match="Loop joint 'far' is open by"):
        sim.step(np.zeros(4), throw=True)


def test_a_loop_that_is_open_at_the_start_closes_in_the_first_step() -> None:
    """From a state that nobody closed: one that fits is closed by the step, and the start can be closed before it."""
    sim = dojo.Simulator(fourbar("pin"), time_step=0.01)
    x = sim.neutral()
    x[0] += 0.02
    assert np.abs(sim.loop_gaps(x)["pin"]).max() > 5e-3
    first = sim.step(x, throw=True)
    assert np.abs(sim.loop_gaps(first.x)["pin"]).max() < 1e-8
    assert np.abs(sim.loop_gaps(sim.close(x))["pin"]).max() < 1e-10


def test_a_rollout_from_a_loop_that_cannot_close_stops_at_its_first_step() -> None:
    mech = Mechanism(
        [Body("a", 1.0, shape=Sphere(0.1)), Body("b", 1.0, shape=Sphere(0.1))],
        [
            Joint("revolute", None, "a", child_point=(0.5, 0, 0), axis=Y),
            Joint("revolute", None, "b", parent_point=(5.0, 0, 0), child_point=(0.5, 0, 0), axis=Y),
            Joint("spherical", "a", "b", "far", (-0.5, 0, 0), (-0.5, 0, 0), close=True),
        ],
    )
    sim = dojo.Simulator(mech)
    with pytest.raises(ValueError, match="loop joint 'far' cannot be closed near this state, it is off by"):
        sim.close(np.zeros(4))
    t = sim.rollout(np.zeros(4), np.zeros((5, 2)))
    assert not t.success and t.status != dojo.Status.SOLVED and len(t.x) == 1
    assert "step 0" in t.message and "far" in t.message


def test_bodies_that_carry_a_share_have_mass() -> None:
    bodies = [Body("a", 1.0, shape=Sphere(0.1)), Body("middle", 0.0), Body("b", 1.0, shape=Sphere(0.1))]
    joints = [
        Joint("revolute", None, "a"),
        Joint("revolute", "a", "middle"),
        Joint("spherical", "middle", "b"),
        Joint("spherical", "a", "middle", "last", spring=1.0, close=True),
    ]
    with pytest.raises(ValueError, match="joint 'last' closes a loop with a spring.*'middle' needs a mass"):
        Mechanism(bodies, joints)


@pytest.mark.parametrize("kind", ["revolute", "spherical", "cylindrical"])
def test_a_planar_loop_in_any_plane(kind: str) -> None:
    """Turned as a whole, nothing is exactly zero any more, and constraints that say nothing new stay redundant."""
    plain = fourbar("pin")
    pin = plain.loops[0]
    turn = np.array([0.5, -0.1, 0.7, 0.4]) / np.linalg.norm([0.5, -0.1, 0.7, 0.4])
    R = rotation_matrix(turn)
    ends = (pin.parent_point, pin.child_point)
    closing = Joint(kind, "coupler", "rocker", "pin", *ends, axis=(1e-17, 1.0, 6e-17), orientation=TURNED, close=True)
    joints = [
        replace(j, orientation=turn, parent_point=R @ np.asarray(j.parent_point)) if j.parent == "world" else j
        for j in plain.joints
    ]
    found = []
    for mech in (plain, replace(plain, joints=joints, loops=[closing], gravity=R @ np.asarray(plain.gravity))):
        sim = dojo.Simulator(mech, time_step=0.01, tolerance=1e-11)
        found.append(sim.rollout(sim.neutral(), np.zeros((200, sim.nu)), throw=True).x)
    np.testing.assert_allclose(found[0], found[1], atol=1e-8)
