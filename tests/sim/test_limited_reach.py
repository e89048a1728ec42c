"""Collisions with a reach: their force ends there, smoothly, and farther shapes have no part in a step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Capsule, Sphere
from sim.simulator.results import contacts_of
from support.jacobians import check_jacobian
from support.parameter_case import Case
from support.parameter_errors import error
from support.two_bodies import two

APART, SPEED = 0.45, 0.3  # of the centres [m], and of a towards b [m/s]


def within(reach: float | None, box: bool = False) -> Mechanism:
    """A box and a ball, or another box."""
    mech = two(Box(0.4, 0.3, 0.5), Box(0.2, 0.2, 0.2) if box else Sphere(0.1))
    push = Input(body="a", force=(1.0, 0.0, 0.0))
    return replace(mech, inputs=[push], collisions=[replace(c, reach=reach) for c in mech.collisions])


def facing(apart: float) -> np.ndarray:
    """The state in which a moves towards b, both turning."""
    x = np.zeros(26)
    x[0], x[3], x[10] = -apart, 1.0, 1.0
    x[14:17], x[17:20], x[23:26] = (SPEED, 0.1, 0.05), (0.1, 0.2, -0.3), (0.3, -0.2, 0.4)
    return x


@pytest.mark.parametrize("box", [False, True])
def test_derivatives_where_the_force_ends(box: bool) -> None:
    """The gap is .15 m: .6 of the way from half the reach to the whole."""
    sim = dojo.Simulator(within(0.19, box), time_step=0.02, kappa=1e-2, tolerance=1e-12)
    x, u = facing(APART), np.zeros(1)
    assert 0.0 < np.abs(sim.step(x, u).contacts.impulse).max() < 0.7 * 1e-2 / 0.15
    d = sim.linearize(x, u)
    A, B = d[0], d[1]
    here = sim.step(x, u).x

    def end(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.asarray(sim.difference(sim.step(x, u, throw=True).x, here))

    check_jacobian(lambda x: end(x, u), A, x, sim.integrate)
    check_jacobian(lambda u: end(x, u), B, u, np.add)
    case = Case(sim, x, u)
    assert {kind: e for kind in case.kinds() if (e := error(case, kind)) > 1e-6} == {}


def test_the_force_is_as_without_a_reach_up_to_half_of_it_and_none_beyond() -> None:
    x, u = facing(APART), np.zeros(1)
    plain, long, short = (dojo.Simulator(within(reach), 0.02, kappa=1e-2) for reach in (None, 1.0, 0.04))
    np.testing.assert_array_equal(plain.step(x, u).x, long.step(x, u).x)
    far = short.rollout(x, np.zeros((3, 1)))
    free = dojo.Simulator(replace(within(None), collisions=()), 0.02)
    np.testing.assert_allclose(far.x, free.rollout(x, np.zeros((3, 1))).x, atol=1e-12)
    assert not far.contacts.impulse.any() and np.isinf(far.contacts.gap).all()


def test_shapes_that_come_from_beyond_the_reach_within_a_step_do_not_enter() -> None:
    """At rest, then thrown at 20 m/s over .3 m: no step before has told of the motion."""
    sim = dojo.Simulator(within(0.02), time_step=0.02)
    x = facing(0.6)
    x[14:] = 0.0
    u = np.zeros(1)
    u[0] = 20.0 / 0.02
    step = sim.step(x, u, throw=True)
    assert -1e-6 < step.contacts.gap.min() < 1e-3
    motion = sim.rollout(x, np.vstack([u, np.zeros((20, 1))]))
    assert motion.success, motion.message
    assert motion.contacts.gap.min() > -1e-6


def test_rows_without_a_report_are_not_beyond_the_reach() -> None:
    """Those of a step that was not solved, and of other engines."""
    mech = within(0.02)
    rows = np.zeros((2, len(mech.contact_names), 11))
    rows[1, :, 6], rows[1, :, 10] = 0.1, 1.0
    np.testing.assert_array_equal(contacts_of(mech, 0.01, rows).gap, rows[..., 6])


def test_a_reach_is_a_length_and_none_of_a_string() -> None:
    with pytest.raises(ValueError, match="reach"):
        dojo.Collision("a", "b", reach=0.0)
    with pytest.raises(ValueError, match="string"):
        dojo.Collision("a", "b", dojo.String(1.0), dojo.String(1.0), reach=0.1)


def legs(itself: bool) -> Mechanism:
    """Two legs that hang from a fixed trunk and swing sideways."""
    shank = {"mass": 1.0, "inertia": (0.02, 0.02, 0.001), "shape": Capsule(0.05, 0.4)}
    bodies = [Body(name, **shank) for name in ("left", "right")]
    joints = [
        Joint("revolute", None, name, axis=(1, 0, 0), parent_point=(0, y, 0), child_point=(0, 0, 0.3), damper=0.05)
        for name, y in (("left", 0.1), ("right", -0.1))
    ]
    return Mechanism(bodies, joints, collisions="self" if itself else ())


def test_legs_do_not_pass_through_each_other() -> None:
    u = np.tile([-4.0, 4.0], (60, 1))  # feet inwards
    crossed, kept = (dojo.Simulator(legs(itself), 0.01) for itself in (False, True))
    side = [
        motion.x[:, 0] - motion.x[:, 1] for motion in (crossed.rollout(np.zeros(4), u), kept.rollout(np.zeros(4), u))
    ]
    assert np.abs(side[0]).max() > 1.5
    motion = kept.rollout(np.zeros(4), u)
    assert motion.success, motion.message
    feet = kept.maximal(motion.x)
    assert motion.contacts.gap.min() > -1e-6
    assert np.abs(feet[:, 0, 1] - feet[:, 1, 1]).min() > 0.09  # two radii
