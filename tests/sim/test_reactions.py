"""Reactions of joints: analytic ones, the balance of every body, and MuJoCo's sensors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from naive import rotation as rot
from naive.lagrangian import arriving_momentum, leaving_momentum

import dojo_opt as dojo
from dojo_opt import models
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Sphere
from support.linkage import fourbar

G = 9.81
X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def pendulum(m: float = 2.0, length: float = 0.8) -> Mechanism:
    """A ball on a massless string, about y."""
    return Mechanism(
        [Body("bob", m, (1e-9, 1e-9, 1e-9))],
        [Joint("revolute", None, "bob", "pin", child_point=(0, 0, length), axis=Y)],
    )


def test_tension_of_a_pendulum() -> None:
    """m g cos(q) + m l w^2 along the string, nothing across; the step's mean is right to first order."""
    m, length, q, w = 2.0, 0.8, 0.6, 1.7
    exact = m * G * np.cos(q) + m * length * w**2
    errors = []
    for h in (2e-3, 1e-3):
        sim = dojo.Simulator(pendulum(m, length), time_step=h, tolerance=1e-12)
        r = sim.reactions(sim.state_from_velocity(np.array([q]), np.array([w])), frame="body")["pin"]
        errors.append(np.abs(r.force - (0.0, 0.0, exact)).max())
        np.testing.assert_allclose(r.torque, 0.0, atol=1e-6)
        np.testing.assert_allclose(r.point, 0.0, atol=1e-15)
    assert errors[0] < 0.1 and errors[1] < 0.6 * errors[0]


def arm(slide: str = "prismatic", **joint: Any) -> Mechanism:
    """A horizontal beam on a revolute joint, and a weight that slides on its end."""
    bodies = [Body("beam", 3.0, shape=Box(1.0, 0.1, 0.1)), Body("weight", 2.0, shape=Box(0.1, 0.1, 0.1))]
    joints = [
        Joint("revolute", None, "beam", "shoulder", (0.0, 0.0, 1.0), (-0.5, 0.0, 0.0), axis=Y, **joint),
        Joint(slide, "beam", "weight", "slide", (0.5, 0.0, 0.0), axis=X),
    ]
    return Mechanism(bodies, joints)


def test_a_static_arm_held_by_its_motor() -> None:
    sim = dojo.Simulator(arm(), time_step=0.01, tolerance=1e-13)
    hold = -(3.0 * 0.5 + 2.0 * 1.0) * G  # a positive angle about y points down
    r = sim.reactions(np.zeros(4), [hold, 0.0])
    assert r.names == ("shoulder", "slide")
    np.testing.assert_allclose(r.force, [[0, 0, 5.0 * G], [0, 0, 2.0 * G]], atol=1e-10)
    np.testing.assert_allclose(r.torque, [[0, hold, 0], [0, 0, 0]], atol=1e-10)
    np.testing.assert_allclose(r.active_torque, [[0, hold, 0], [0, 0, 0]], atol=1e-10)
    np.testing.assert_allclose(r.constraint_force, r.force, atol=1e-10)
    np.testing.assert_allclose(r.point, [[0, 0, 1], [1, 0, 1]], atol=1e-15)


def test_springs_dampers_limits_and_armature_are_active() -> None:
    """Torque of the joint along its axis: from the spring at rest, from a stop, and from a rotor."""
    lever = (3.0 * 0.5 + 2.0 * 1.0) * G
    rest = -lever / 500.0
    actions: tuple[dict[str, Any], ...] = ({"spring": 500.0, "rest": rest}, {"limits": (-1.0, 1e-7)})
    for action in actions:
        sim = dojo.Simulator(arm("fixed", **action), time_step=0.01, tolerance=1e-12, kappa=1e-10)
        x = sim.rollout(np.zeros(2), np.zeros((60 if "limits" in action else 1, 1)), throw=True).x[-1]
        r = sim.reactions(x)["shoulder"]
        np.testing.assert_allclose(r.active_torque, [0, -lever, 0], atol=2e-4 * lever)
        np.testing.assert_allclose(r.constraint_torque, 0.0, atol=1e-8)
    mech = replace(arm(armature=0.7, damper=0.2), inputs=())
    sim = dojo.Simulator(mech, time_step=0.01, tolerance=1e-13)
    x = np.array([0.1, 0.0, 0.4, 0.3])
    v = sim.step(x).x[2]
    z = 0.01 * 0.2 / sim.model.dof_seen[0]
    lag = 3.0 * 0.2 / (6.0 + z + z * z)
    taken = -0.2 * v + lag * (v - 0.4) - 0.7 * (v - 0.4) / 0.01
    np.testing.assert_allclose(sim.reactions(x)["shoulder"].active_torque, [0, taken, 0], atol=1e-8)


def floating_chain() -> Mechanism:
    """Every kind of rotation, a motor, springs and a contact."""
    shape = Box(0.3, 0.2, 0.1)
    bodies = [Body(name, 1.0 + k, shape=shape) for k, name in enumerate("abcde")]
    end, start = (0.15, 0.05, 0.0), (-0.15, 0.0, 0.02)
    joints = [
        Joint("floating", None, "a"),
        Joint("revolute", "a", "b", "", end, start, axis=(0.6, 0.0, 0.8), damper=0.1, armature=0.02),
        Joint("spherical", "b", "c", "", end, start, spring=3.0),
        Joint("orbital", "c", "d", "", end, start, orientation=(0.8, 0.6, 0.0, 0.0)),
        Joint("cylindrical", "b", "e", "", start, end, axis=Y, limits=((-0.05, 0.05), None)),
    ]
    contacts = [Contact("a", radius=0.1), Contact("d", (0.1, 0.0, 0.0), 0.1)]
    push = Input(body="c", force=(1.0, 2.0, 3.0), torque=(0.1, 0.0, 0.0), frame="body", name="push")
    return Mechanism(bodies, joints, contacts, [Input("b"), push], neutral={"a": (0, 0, 0.11, 1, 0, 0, 0)})


def balance(sim: dojo.Simulator, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """By body, p_out - p_in - h (gravity, contacts, joints, pushes): force, and moment about the world's origin.

    Poses from `maximal`, momenta from the reference Lagrangian; nothing of the engine's balance.
    """
    h, mech = sim.time_step, sim.mechanism
    out = sim.step(x, u, throw=True)
    z2, z3, r = sim.maximal(x), sim.maximal(out.x), sim.reactions(x, u)
    rows = np.zeros((mech.nbody, 6))
    for i, body in enumerate(mech.bodies):
        inertia, (q2, q3) = np.asarray(body.inertia), (z2[i, 6:10], z3[i, 6:10])
        q1 = rot.mul(q2, rot.exp(-h * z2[i, 10:]))
        force = body.mass * (z3[i, 3:6] - z2[i, 3:6] - h * np.asarray(mech.gravity))
        spin = leaving_momentum(inertia, q2, q3, h) - arriving_momentum(inertia, q1, q2, h)
        rows[i] = moved(force, spin, z2[i, :3])
    index = {name: i for i, name in enumerate(mech.body_names)}
    for k, contact in enumerate(mech.contacts):
        i = index[contact.body]  # the arm at the end of the step, from where the centre of mass was
        at = z2[i, :3] + out.contacts.point[k] - z3[i, :3]
        rows[i] -= moved(out.contacts.impulse[k], np.zeros(3), at)
    for value, part in zip(u, mech.inputs or (), strict=True):
        if part.body is not None:
            i = index[part.body]
            f, t = (h * value * rot.rotate(z2[i, 6:10], np.asarray(w)) for w in (part.force, part.torque))
            rows[i] -= moved(f, t, z2[i, :3])
    ends = {j.name: (j.parent, j.child) for j in (*mech.joints, *mech.loops)}
    for k, name in enumerate(r.names):
        wrench = h * moved(r.force[k], r.torque[k], r.point[k])
        parent, child = ends[name]
        rows[index[child]] -= wrench
        if parent in index:
            rows[index[parent]] += wrench
    return rows


def moved(force: np.ndarray, torque: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(6,) force, and moment about the origin, of a force and torque at a point."""
    return np.concatenate([force, torque + np.cross(at, force)])


@pytest.mark.parametrize("name", ["chain", "minitaur_leg", "delta", "stewart"])
def test_every_body_is_in_balance(name: str) -> None:
    mech = floating_chain() if name == "chain" else getattr(models, name)()
    sim = dojo.Simulator(mech, time_step=0.01, tolerance=1e-13, kappa=1e-4)
    x = sim.neutral()
    x[sim.nq :] = 0.5 * np.random.default_rng(3).normal(size=sim.nv)
    u = np.random.default_rng(4).normal(size=sim.nu)
    x = sim.rollout(sim.close(x), np.tile(u, (5, 1)), throw=True).x[-1]
    np.testing.assert_allclose(balance(sim, x, u), 0.0, atol=1e-10)
    r = sim.reactions(x, u)
    assert np.abs(r.force).max() > 1.0
    if name == "chain":  # nothing holds a floating base
        np.testing.assert_allclose([r["a"].force, r["a"].torque], 0.0, atol=1e-9)


@pytest.mark.parametrize(("damper", "atol"), [(0.0, 1e-7), (0.4, 2e-4)])
def test_a_closing_joint_that_acts_transmits_the_same_wrench_as_in_the_tree(damper: float, atol: float) -> None:
    """The wrench of the four-bar's pin, with the loop cut there or at the rocker's bearing.

    A damper there sees another inertia, so the weights of its velocities differ, to second order in the time step.
    """
    a, b = (
        dojo.Simulator(fourbar(cut, spring=30.0, damper=damper), time_step=0.01, tolerance=1e-13)
        for cut in ("pin", "rocker")
    )
    x, y = a.neutral(), b.neutral()
    for joint in ("crank", "coupler", "pin"):
        y[b.mechanism.q_slice(joint)] = x[a.mechanism.q_slice(joint)]
    ours, theirs = a.reactions(x)["pin"], b.reactions(b.close(y))["pin"]
    for field in ("point", "force", "torque", "constraint_force", "constraint_torque"):
        np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), atol=atol, err_msg=field)


def test_frames_and_trajectories() -> None:
    sim = dojo.Simulator(floating_chain(), time_step=0.01)
    u = np.tile([0.3, 0.1], (4, 1))
    t = sim.rollout(sim.neutral(), u, throw=True)
    world, joint, body = (sim.reactions(t.x[:-1], t.u, frame=frame) for frame in ("world", "joint", "body"))
    assert world.force.shape == (4, 5, 3) and world["d"].torque.shape == (4, 3)
    z, k = sim.maximal(t.x[3]), sim.mechanism.body_names.index("d")
    np.testing.assert_allclose(rot.rotate(z[k, 6:10], body["d"].force[3]), world["d"].force[3], atol=1e-12)
    p = sim.mechanism.body_names.index("c")
    frame = rot.mul(z[p, 6:10], np.array([0.8, 0.6, 0.0, 0.0]))
    np.testing.assert_allclose(rot.rotate(frame, joint["d"].force[3]), world["d"].force[3], atol=1e-12)
    with pytest.raises(
        ValueError, match=r"Simulator.reactions\(frame=...\): 'child' is not one of: world, joint, body"
    ):
        sim.reactions(t.x[0], frame="child")
    with pytest.raises(ValueError, match=r"Reactions\[...\]: joint: 'f' is not one of"):
        world["f"]
    with pytest.raises(ValueError, match="simulator of order 2"):
        dojo.Simulator(pendulum(), order=4).reactions(np.zeros(2))


def test_contacts_between_bodies_say_where_and_how_hard() -> None:
    """A ball rests on a ball: names, normal, point, force."""
    bodies = [Body("low", 1.0, shape=Sphere(0.5)), Body("high", 2.0, shape=Sphere(0.25))]
    joints = [Joint("prismatic", None, "low"), Joint("prismatic", None, "high")]
    touch = dojo.Collision("high", "low", friction=0.0, name="touch")
    mech = Mechanism(
        bodies, joints, [Contact("low", radius=0.5, friction=0.0)], collisions=[touch], neutral=[0.501, 1.252]
    )
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-10)
    t = sim.rollout(sim.neutral(), np.zeros((200, 2)), throw=True)
    contacts = sim.step(t.x[-1]).contacts
    assert contacts.names[1].startswith("touch")
    np.testing.assert_allclose(contacts.force, [[0, 0, 3 * G], [0, 0, 2 * G]], atol=1e-3)
    np.testing.assert_allclose(contacts.point, [[0, 0, 0], [0, 0, 1.0]], atol=1e-5)
    np.testing.assert_allclose(contacts.normals, [[0, 0, 1], [0, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(sim.reactions(t.x[-1]).force, 0.0, atol=1e-3)
