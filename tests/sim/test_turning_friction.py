"""Torsional and rolling friction: against solutions on paper, central differences, and conserved momenta."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from sim.model.record_columns import Cluster, PairBound

R, M, G = 0.1, 1.0, 9.81
J = 0.4 * M * R * R
BALL = dojo.Sphere(R)
TORSIONAL, ROLLING = 0.01, 0.003
HILL = dojo.Terrain(0.05 * np.sin(np.add.outer(np.arange(9.0), 0.7 * np.arange(9.0))), spacing=(0.25, 0.25))


def ball(
    torsional: float = TORSIONAL, rolling: float = ROLLING, *, kappa: float = 1e-8, **contact: Any
) -> dojo.Simulator:
    """A solid ball above the ground."""
    point = dojo.Contact("ball", radius=R, torsional_friction=torsional, rolling_friction=rolling, **contact)
    mech = dojo.Mechanism([dojo.Body("ball", M, np.eye(3) * J)], [dojo.Joint("floating", None, "ball")], [point])
    return dojo.Simulator(mech, time_step=0.01, kappa=kappa, tolerance=1e-12)


def state(velocity: Any = (0.0, 0.0, 0.0), spin: Any = (0.0, 0.0, 0.0), at: Any = (0.0, 0.0, R + 1e-9)) -> np.ndarray:
    return np.array([*at, 1.0, 0.0, 0.0, 0.0, *velocity, *spin])


def two_bodies(
    shape: Any, thrown: Any = BALL, *, kappa: float = 1e-4, scale: float = 1.0, **collision: Any
) -> tuple[dojo.Simulator, np.ndarray]:
    """A ball that is thrown onto another body, without gravity; and the state where they touch."""
    bodies = [
        dojo.Body("a", 1.0, np.eye(3) * J, shape=thrown),
        dojo.Body("b", 2.0, (0.01, 0.012, 0.015), shape),
    ]
    lengths = {"torsional_friction": scale * TORSIONAL, "rolling_friction": scale * ROLLING}
    rub = dojo.Collision("a", "b", **lengths, **collision)
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    mech = dojo.Mechanism(bodies, joints, collisions=[rub], gravity=(0.0, 0.0, 0.0))
    q = [0.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    v = [0.1, 0.2, -1.0, 0.5, 1.0, 2.0, 0.0, 0.0, 0.5, -0.3, 0.2, -1.0]
    return dojo.Simulator(mech, time_step=0.01, kappa=kappa, tolerance=1e-12), np.array(q + v)


def leg() -> tuple[dojo.Simulator, np.ndarray]:
    """A leg that pivots on the ball of its foot."""
    bodies = [dojo.Body("u", 1.0, (0.02, 0.02, 0.01)), dojo.Body("l", 0.5, (0.01, 0.012, 0.004))]
    knee = dojo.Joint("revolute", "u", "l", parent_point=(0, 0, -0.2), child_point=(0, 0, 0.2), axis=(0, 1, 0))
    foot = dojo.Contact("l", (0, 0, -0.2), 0.03, torsional_friction=0.02, rolling_friction=0.01)
    mech = dojo.Mechanism(bodies, [dojo.Joint("floating", None, "u"), knee], [foot])
    x = np.array([0, 0, 0.4298 + 0.2 * (1 + np.cos(0.1)) - 0.2, 1, 0, 0, 0, 0.1, 0.5, 0.1, -0.3, 0.3, 0.5, 4.0, 1.0])
    return dojo.Simulator(mech, time_step=0.01, kappa=1e-5, tolerance=1e-12), x


def on_hill(**contact: Any) -> tuple[dojo.Simulator, np.ndarray]:
    sim = ball(kappa=1e-5, terrain=HILL, **contact)
    x = state((1.0, 0.2, -0.5), (-2.0, 10.0, 3.0), (0.4, 0.5, 0.3))
    x[2] -= float(sim.step(x).contacts.gap[0])
    return sim, x


def moving() -> tuple[dojo.Simulator, np.ndarray]:
    return ball(kappa=1e-4), state((1.0, 0.2, 0.0), (-2.0, 10.0, 3.0))


@pytest.mark.kernel
def test_a_spinning_ball_stops_when_the_moment_has_taken_its_momentum() -> None:
    """At a constant rate, and after J w/(mu_t m g) = 0.41 s."""
    sim, w = ball(rolling=0.0), 10.0
    t = sim.rollout(state(spin=(0.0, 0.0, w)), np.zeros((50, 0)), throw=True)
    spin = t.x[:, -1]
    steps = J * w / (TORSIONAL * M * G) / sim.time_step
    np.testing.assert_allclose(np.diff(spin[2 : int(steps)]), -TORSIONAL * M * G / J * sim.time_step, rtol=2e-5)
    assert spin[int(steps)] > 0.0
    np.testing.assert_allclose(spin[int(steps) + 2 :], 0.0, atol=1e-4)
    np.testing.assert_allclose(t.contacts.moment[3, 0], (0.0, 0.0, -TORSIONAL * M * G), rtol=2e-5, atol=1e-9)


def test_a_rolling_ball_slows_down_by_its_rolling_friction() -> None:
    """By mu_r g/(R (1 + 2/5)), without slip."""
    t = ball().rollout(state((1.0, 0.0, 0.0), (0.0, 10.0, 0.0)), np.zeros((20, 0)), throw=True)
    np.testing.assert_allclose(np.diff(t.x[2:, 7]), -ROLLING * G / (1.4 * R) * 0.01, rtol=5e-4)
    assert t.contacts.slip[2:].max() < 1e-5


@pytest.mark.parametrize("slope", [0.9, 1.1])
def test_a_ball_rests_on_a_slope_below_its_rolling_friction(slope: float) -> None:
    """Up to tan(angle) = mu_r/R; beyond it rolls."""
    tilt = np.arctan(slope * ROLLING / R)
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    t = ball(normal=normal).rollout(state(at=R * normal), np.zeros((50, 0)), throw=True)
    speed = (G * np.sin(tilt) - ROLLING * G * np.cos(tilt) / R) / 1.4 * 0.5
    if slope < 1.0:
        assert np.abs(t.x[-1, 7:]).max() < 1e-3
    else:
        np.testing.assert_allclose(t.x[-1, 7] / np.cos(tilt), speed, rtol=1e-2)


@pytest.mark.parametrize("length", [1e-3, 10.0])
@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_extreme_lengths_and_weights_are_solved(length: float, scale: float) -> None:
    point = dojo.Contact("ball", radius=R, torsional_friction=length, rolling_friction=length)
    body = dojo.Body("ball", scale * M, np.eye(3) * scale * J)
    mech = dojo.Mechanism([body], [dojo.Joint("floating", None, "ball")], [point])
    sim = dojo.Simulator(mech, time_step=1e-3)
    t = sim.rollout(state((1.0, 0.0, 0.0), (300.0, 10.0, 1000.0)), np.zeros((5, 0)))
    assert t.success
    assert abs(t.x[-1, -1]) < 1000.0


SCENES = {
    "moving": moving,
    "leg": leg,
    "on a hill": on_hill,
    "balls": lambda: two_bodies(BALL),
    "ball and box": lambda: two_bodies(dojo.Box(0.3, 0.3, 0.2)),
    "boxes": lambda: two_bodies(dojo.Box(0.3, 0.3, 0.2), dojo.Box(0.2, 0.2, 0.2)),  # with points that do not exist
    "dropped": lambda: (ball(kappa=1e-4, restitution=0.8), THROWN - 0.015 * np.eye(13)[2]),
    "dropped on a hill": lambda: on_hill(restitution=0.8),
    "bouncing balls": lambda: two_bodies(BALL, restitution=0.8),
}


@pytest.mark.kernel
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_derivatives_by_the_state_are_those_of_differences(scene: Any) -> None:
    sim, x = scene()
    u, eps = np.zeros(sim.nu), 1e-6
    A = sim.linearize(x, u).A
    assert np.abs(sim.step(x, u).contacts.moment).max() > 1e-4
    for k, d in enumerate(eps * np.eye(A.shape[1])):
        ends = [sim.step(sim.integrate(x, s * d), u, throw=True).x for s in (1.0, -1.0)]
        np.testing.assert_allclose(A[:, k], sim.difference(*ends) / (2.0 * eps), atol=3e-6 * max(1.0, np.abs(A).max()))


GROUND = ("torsional_friction", "rolling_friction", "friction", "contact_radius", "contact_height", "contact_point")


@pytest.mark.parametrize(
    ("scene", "names"),
    [
        (moving, (*GROUND, "contact_normal", "com", "inertia", "time_step")),
        (on_hill, GROUND),
        (
            lambda: two_bodies(BALL),
            ("torsional_friction", "rolling_friction", "size_a", "shape_b", "com:b", "time_step"),
        ),
    ],
)
def test_derivatives_by_parameters_are_those_of_differences(scene: Any, names: tuple[str, ...]) -> None:
    sim, x = scene()
    u, found = np.zeros(sim.nu), sim.parameters(names)
    by_name = sim.linearize(x, u, wrt=names)
    columns = np.concatenate([by_name[name].reshape(2 * sim.nv, -1) for name in names], axis=1)
    for name, value, column in zip(found.names, found.values, columns.T, strict=True):
        eps = 1e-6 * max(0.1, abs(value))
        ends = [sim.with_parameters({name: value + s * eps}).step(x, u, throw=True).x for s in (1.0, -1.0)]
        slope = sim.difference(*ends) / (2.0 * eps)
        np.testing.assert_allclose(column, slope, atol=1e-5 * max(1.0, np.abs(slope).max()), err_msg=name)


def test_moments_between_bodies_conserve_momentum() -> None:
    sim, x = two_bodies(BALL, kappa=1e-8)
    t = sim.rollout(x, np.zeros((5, 0)), throw=True)
    for before, after in zip(sim.momentum(x), sim.momentum(t.x[-1]), strict=True):
        np.testing.assert_allclose(after, before, atol=1e-12)


@pytest.mark.parametrize(("torsional", "turns"), [(0.0, True), (0.002, True), (0.005, False)])
def test_fingertips_hold_a_bar_beside_its_center_by_torsional_friction(torsional: float, turns: bool) -> None:
    """Against a moment of .1 kg g .05 m, with 10 N on either side: two moments of 10 N mu_t, from mu_t = 2.5 mm on."""
    tip, y = dojo.Sphere(0.01), 0.05
    bodies = [dojo.Body("bar", 0.1, shape=dojo.Box(0.04, 0.3, 0.04)), *(dojo.Body(n, 0.05, shape=tip) for n in "lr")]
    joints = [dojo.Joint("floating", None, "bar")]
    for name, side in (("l", 1.0), ("r", -1.0)):
        joints.append(dojo.Joint("prismatic", None, name, parent_point=(-0.03 * side, y, 0), axis=(side, 0, 0)))
    grips = [dojo.Collision(name, "bar", friction=1.0, torsional_friction=torsional) for name in "lr"]
    mech = dojo.Mechanism(bodies, joints, inputs=[dojo.Input("l"), dojo.Input("r")], collisions=grips)
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.rollout(sim.neutral(), np.full((30, 2), 10.0), throw=True).x[-1]
    assert (abs(x[4]) > 0.1) == turns
    if not turns:
        assert np.abs(x[4:7]).max() < 1e-6


def test_moments_are_saved_and_described(tmp_path: Path) -> None:
    sim, x = moving()
    t = sim.rollout(x, np.zeros((2, 0)))
    t.save(tmp_path / "t.npz")
    np.testing.assert_array_equal(dojo.Trajectory.load(tmp_path / "t.npz").contacts.moment, t.contacts.moment)
    assert "torsional friction 0.01, rolling friction 0.003" in sim.describe()
    plain = ball(0.0, 0.0).step(x)
    assert plain.contacts.moment_impulse is None
    assert not plain.contacts.moment.any()


def test_the_contact_whose_moment_is_furthest_from_its_law_is_named() -> None:
    names = ("first", "second")
    bodies = [dojo.Body(name, M, np.eye(3) * J) for name in names]
    feet = [dojo.Contact(name, radius=R, torsional_friction=0.05) for name in names]
    mech = dojo.Mechanism(bodies, [dojo.Joint("floating", None, name) for name in names], feet)
    sim = dojo.Simulator(mech, time_step=0.01, max_iterations=3)
    for k, name in enumerate(names):
        x = sim.neutral()
        x[sim.nq + 6 * k + 5] = 50.0
        message = sim.step(x).message
        assert f"Contact '{name}' is worst" in message, message


SCENE = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1" condim="3" friction="1 .02 .001"/>
  <body name="a" pos="0 0 1"><freejoint/><geom name="a" size=".1" condim="4" friction=".5 .01 .002"/></body>
  <body name="b" pos="0 0 2"><freejoint/><geom name="b" size=".1" condim="6" friction=".5 .01 .002" priority="1"/></body>
  </worldbody><contact><pair geom1="a" geom2="b" condim="6" friction="1 1 .03 .004 .004"/></contact></mujoco>"""


def test_condim_4_and_6_of_mjcf_files_are_read() -> None:
    """The larger lengths of two geoms, those of the one with priority, or those of the pair."""
    pytest.importorskip("mujoco")
    mech = dojo.load_mjcf(SCENE, collisions=True, turning_friction=True)
    lengths = {c.name: (c.torsional_friction, c.rolling_friction) for c in (*mech.contacts, *mech.collisions)}
    assert lengths == {"a": (0.02, 0.0), "b": (0.01, 0.002), "a-b": (0.03, 0.004)}
    with pytest.warns(dojo.MjcfWarning, match="torsional and rolling friction is omitted"):
        assert not dojo.load_mjcf(SCENE).contacts[0].torsional_friction


# -- inactive contacts -------------------------------------------------------------------------------------------------


def tilted() -> tuple[dojo.Simulator, np.ndarray]:
    """A rod that spins on one of its two feet."""
    feet = [dojo.Contact("rod", (s, 0, 0), torsional_friction=0.3, rolling_friction=0.1) for s in (-0.5, 0.5)]
    mech = dojo.Mechanism([dojo.Body("rod", M, (0.1, 0.1, 0.1))], [dojo.Joint("floating", None, "rod")], feet)
    turned = [np.cos(0.5), 0.0, -np.sin(0.5), 0.0]
    x = np.array([0, 0, 0.5 * np.sin(1.0) + 1e-3, *turned, 0, 0, 0, 0.5, 0.3, 5.0])
    return dojo.Simulator(mech, time_step=0.01, kappa=1e-5, tolerance=1e-9), x


def apart(**collision: Any) -> tuple[dojo.Simulator, np.ndarray]:
    sim, x = two_bodies(BALL, scale=100.0, **collision)
    x[2], x[16] = 6.0, 0.0
    return sim, x


FAR = {
    "above": lambda: (ball(1.0, 0.5, kappa=1e-6), state((1.0, 0.0, 0.0), (5.0, 3.0, -9.0), (0.0, 0.0, 12.0))),
    "above a hill": lambda: (
        ball(1.0, 0.5, kappa=1e-6, terrain=HILL),
        state((1.0, 0.0, 0.0), (20.0, 9.0, -40.0), (0.4, 0.5, 45.0)),
    ),
    "apart": apart,
    "apart, within a reach": lambda: apart(reach=8.0),
    "one foot up": tilted,
}


@pytest.mark.parametrize("scene", FAR.values(), ids=FAR)
@pytest.mark.parametrize("cutoff", [0.0, 0.1])
def test_far_contacts_have_their_moments_without_being_solved_for(scene: Any, cutoff: float) -> None:
    """States, moments and derivatives are those with all contacts active; none of them is far beyond a cutoff."""
    sim, x = scene()
    sim = sim.replace(tolerance=1e-9, cutoff=cutoff)
    every = sim.replace()
    every.model.cluster[:, Cluster.MOBILITY] = np.inf
    every.model.pair_bound[:, PairBound.MOBILITY] = np.inf
    us = np.zeros((8, 0))
    t, expected = sim.rollout(x, us, throw=True), every.rollout(x, us, throw=True)
    active = [int(s._engine.last().active_count[0]) for s in (sim, every)]
    assert active[0] < active[1]
    moments = expected.contacts.moment_impulse
    assert np.abs(moments).max(axis=(0, 2)).min() > 1e-8
    np.testing.assert_allclose(t.contacts.moment_impulse, moments, rtol=0, atol=3e-9)
    np.testing.assert_allclose(t.x, expected.x, rtol=0, atol=1e-6)
    A, B = sim.linearize(x).A, every.linearize(x).A
    np.testing.assert_allclose(A, B, rtol=0, atol=2e-6 * np.abs(B).max())


# -- impacts -----------------------------------------------------------------------------------------------------------

THROWN = state((0.5, 0.0, -2.0), (5.0, -20.0, 30.0), (0.0, 0.0, R + 0.03))


def test_a_spinning_ball_that_bounces_loses_the_moment_of_its_impulses() -> None:
    """And never gains energy."""
    sim = ball(rolling=0.0, friction=0.0, restitution=0.8)
    t = sim.rollout(state((0.5, 0.0, -2.0), (0.0, 0.0, 30.0), THROWN[:3]), np.zeros((40, 0)), throw=True)
    impulses = t.contacts.impulse[:, 0, 2]
    assert np.count_nonzero(impulses > 1.0) == 2
    np.testing.assert_allclose(J * np.diff(t.x[:, -1]), -TORSIONAL * impulses, rtol=1e-3, atol=1e-7)
    for more in (sim, ball(restitution=0.8), ball(restitution=1.0, friction=0.2)):
        energy = more.energy(more.rollout(THROWN, np.zeros((100, 0)), throw=True).x)
        assert energy.max() < energy[0] + 1e-6


def test_a_moment_that_stops_the_rolling_of_an_impact_leaves_its_rebound() -> None:
    """Friction alone did work in this impact, and was taken for a gain of energy."""
    x = state((-0.5, 0.0, -2.0), (0.0, -20.0, 0.0), (0.0, 0.0, R + 0.011))
    t = ball(rolling=0.05, restitution=1.0).rollout(x, np.zeros((3, 0)), throw=True)
    assert abs(t.x[-1, 11]) < 1e-3
    assert t.x[-1, 9] > 1.5
