"""Derivatives by the heights of terrain, gears and inputs; parameters of rollouts; shapes that stand on terrain."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import dojo_opt as dojo
from support.couplings import geared
from support.hills import GRID, WAVES
from support.jacobians import check_jacobian
from support.parameter_case import Case
from support.parameter_errors import error
from support.scenes import run
from support.situations import HILLS, falling

# restitution, friction, how deep it would sink without the ground [m]
ON_HILLS = {
    "flying": (0.0, 0.5, -0.05),
    "touching": (0.0, 0.5, 0.0),
    "sliding": (0.0, 0.1, 0.03),
    "sticking": (0.0, 2.0, 0.03),
    "deep": (0.0, 0.5, 0.1),
    "bouncing": (0.5, 0.1, 0.01),
    "pivoting": (0.5, 0.5, 0.01, 0.05),
}
STAIRS = dojo.Terrain.steps([0.1, 0.08], depth=0.4, edge=0.3, direction=(1.0, 0.5))
hills_case = functools.cache(lambda name: falling(HILLS, *ON_HILLS[name]))


@pytest.mark.sweep(3)
@pytest.mark.parametrize("name", ON_HILLS)
def test_heights_of_hills(name: str) -> None:
    case = hills_case(name)
    errors = {kind: error(case, kind) for kind in ("terrain", "contact_height", "contact_point", "contact_radius")}
    assert all(e < 1e-6 for e in errors.values()), errors


@pytest.mark.slow
def test_each_height_of_stairs() -> None:
    """One number per line across the stairs, under two balls of one radius and a point."""
    box = dojo.Body("box", 1.0, shape=dojo.Box(0.3, 0.2, 0.1))
    contacts = [dojo.Contact("box", (s, 0.0, -0.05), r, friction=0.4) for s, r in ((-0.1, 0.04), (0.1, 0.04), (0, 0))]
    mech = dojo.Mechanism([box], [dojo.Joint("floating", None, "box")], contacts).with_terrain(STAIRS)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-3, tolerance=1e-13)
    x = sim.neutral()
    x[0], x[2] = 0.05, x[2] + 0.02
    x[7:] = 1.0, 0.2, -1.0, 0.3, 0.5, -0.2
    found = sim.parameters(("terrain",))
    n = len(STAIRS.heights)
    assert found.names[:2] == ("terrain:ground[0]", "terrain:ground[1]") and len(found.names) == n
    here = sim.step(x).x
    J = sim.linearize(x, wrt=("terrain",))["terrain"]
    some = np.argsort(-np.abs(J).max(axis=0))[:2]

    def moved(dp: np.ndarray) -> np.ndarray:
        values = found.values + dp @ np.eye(n)[some]
        return sim.difference(sim.with_parameters({"terrain": values}).step(x).x, here)

    check_jacobian(moved, J[:, some], np.zeros(len(some)), np.add)
    np.testing.assert_allclose(sim.linearize(x, wrt=("terrain:ground[3]",))["terrain:ground[3]"], J[:, 3:4])
    # raised by as much everywhere, it is higher
    up = sim.linearize(x, wrt=("contact_height:*",))["contact_height:*"][:, 0]
    np.testing.assert_allclose(J.sum(axis=1), up, atol=1e-8 * np.abs(up).max())


@pytest.mark.slow
def test_rises_of_stairs_by_the_chain_rule() -> None:
    """The example in the docstring of Terrain: derivatives of a loss by the rises, against differences."""
    rises = np.array([0.1, 0.08])
    ball = dojo.Body("ball", 1.0, shape=dojo.Sphere(0.1))
    plain = dojo.Mechanism([ball], [dojo.Joint("floating", None, "ball")], [dojo.Contact("ball", radius=0.1)])

    def simulator(r: np.ndarray) -> dojo.Simulator:
        return dojo.Simulator(plain.with_terrain(stairs(r)), time_step=0.01, kappa=1e-3, tolerance=1e-12)

    def stairs(r: np.ndarray) -> dojo.Terrain:
        return dojo.Terrain.steps(r, depth=0.4, edge=0.3)

    sim = simulator(rises)
    x = sim.neutral()
    x[:3], x[7] = (-0.1, 0.0, 0.15), 1.5
    us = np.zeros((20, sim.nu))
    t = sim.rollout(x, us, throw=True)
    loss = np.random.default_rng(0).normal(size=(21, sim.ndx))
    by_height = sim.vjp(t, loss, wrt=("terrain",))["terrain"]
    by_rise = [by_height @ stairs(unit).heights.ravel() for unit in np.eye(len(rises))]

    def change(r: np.ndarray) -> np.ndarray:
        return np.array([np.sum(loss * sim.difference(simulator(r).rollout(x, us, throw=True).x, t.x))])

    check_jacobian(change, np.array([by_rise]), rises, np.add)


@pytest.mark.parametrize("make", [lambda: hills_case("sliding"), lambda: hills_case("bouncing"), geared])
def test_rollouts(make) -> None:
    """The sweep is the chain of the steps, and so are the derivatives of `linearize_rollout`."""
    case: Case = make()
    sim, rng = case.sim, np.random.default_rng(1)
    us = case.u + 0.1 * rng.normal(size=(4, sim.nu))
    names = sim.parameters().names
    some = ("gear_ratio", "gear_offset") if sim.mechanism.gears else ("terrain", "friction")
    xs, line = sim.linearize_rollout(case.x, us, wrt=(*some, "mass"))
    assert set(line.parameters) == {*some, "mass"}
    for x, u, A, *blocks in zip(xs, us, line.A, *line.parameters.values(), strict=False):
        expected = sim.linearize(x, u, wrt=("state", *line.parameters))
        for block, found in zip(expected.values(), (A, *blocks), strict=True):
            # solved from another guess, to the tolerance
            np.testing.assert_allclose(found, block, rtol=1e-6, atol=1e-6 * np.abs(block).max())
    loss = rng.normal(size=(5, sim.ndx))
    got = sim.vjp((xs, us), loss, wrt=(*some, "mass"))
    costate, gradient = loss[-1], {name: 0.0 for name in got}
    for k in range(3, -1, -1):
        gradient = {name: gradient[name] + costate @ line.parameters[name][k] for name in got}
        costate = loss[k] + costate @ line.A[k]
    for name, value in gradient.items():
        np.testing.assert_allclose(got[name], value, rtol=1e-7, atol=1e-8 * np.abs(value).max())
    plain, without = sim.linearize_rollout(case.x, us)
    assert without.parameters == {} and len(names) > 20
    np.testing.assert_allclose(plain, xs, atol=1e-8)


def test_two_terrains_have_two_names() -> None:
    balls = [dojo.Contact("b", (x, 0.0, 0.0), 0.1, terrain=t) for x, t in ((-0.5, WAVES), (0.5, HILLS))]
    body = dojo.Body("b", 1.0, (0.02, 0.03, 0.04))
    sim = dojo.Simulator(dojo.Mechanism([body], [dojo.Joint("floating", None, "b")], balls), time_step=0.01)
    assert sim.parameters(("terrain:ground[3,5]", "terrain:ground_1[2,1]")).values.tolist() == [
        WAVES.heights[3, 5],
        HILLS.heights[2, 1],
    ]
    raised = sim.with_parameters({"terrain:ground_1": np.ravel(HILLS.heights) + 0.1}).mechanism.contacts
    assert raised[0].terrain is WAVES
    np.testing.assert_allclose(raised[1].terrain.heights, HILLS.heights + 0.1)
    with pytest.raises(ValueError, match=r"no parameter 'terrain:hill'.*terrain:ground, terrain:ground_1"):
        sim.linearize(sim.neutral(), wrt=("terrain:hill",))


# -- shapes that stand on terrain --------------------------------------------------------------------------------------

SOLIDS = {
    "ball": dojo.Sphere(0.1),
    "capsule": dojo.Capsule(0.08, 0.3, orientation=(0.6, 0.0, 0.8, 0.0)),
    "box": dojo.Box(0.3, 0.2, 0.1),
    "stone": dojo.Polytope.about_centroid(np.random.default_rng(0).normal(size=(10, 3)) * (0.2, 0.15, 0.1)),
}


def alone(shape, **parts) -> dojo.Mechanism:
    return dojo.Mechanism([dojo.Body("it", 1.0, shape=shape)], [dojo.Joint("floating", None, "it")], **parts)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_shape_on_a_plane_is_its_collision_with_a_half_space(name: str) -> None:
    level = dojo.Terrain.from_function(lambda X, Y: 0.0 * X, GRID, GRID)
    wall = dojo.Collision("it", shape_b=dojo.HalfSpace(), friction=0.4)
    sims = [
        dojo.Simulator(mech, time_step=0.01, kappa=1e-8, tolerance=1e-12)
        for mech in (
            alone(SOLIDS[name]).with_terrain(level, bodies=["it"], friction=0.4),
            alone(SOLIDS[name], collisions=[wall]),
        )
    ]
    x = sims[0].neutral()
    assert 0.0 < sims[0].step(x).contacts.gap.min() < 1e-3  # it stands there as high as it touches
    x[7:] = 0.5, 0.2, -0.5, 1.0, -2.0, 0.5
    first, second = (run(sim, x, 60) for sim in sims)
    np.testing.assert_allclose(first[:, :7], second[:, :7], atol=1e-5)  # far points press at another place


@pytest.mark.parametrize("name", SOLIDS)
def test_a_shape_tumbles_on_hills(name: str, rng: np.random.Generator) -> None:
    """Let fall from a random pose; no corner goes below the ground, and it never has more energy than at first."""
    mech = alone(SOLIDS[name]).with_terrain(WAVES, bodies=["it"], friction=0.5)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-9)
    x = sim.neutral()
    x[2] += 0.2
    t = sim.rollout(sim.integrate(x, np.r_[0.0, 0.0, 0.0, rng.normal(size=9)]), np.zeros((100, 0)), throw=True)
    assert t.contacts.gap.min() > -1e-7 and (t.contacts.gap.min(axis=1)[-20:] < 1e-3).any()
    assert sim.energy(t.x).max() < sim.energy(t.x[0]) + 1e-6


def test_bodies_that_cannot_stand_are_refused() -> None:
    mech = alone(dojo.Cylinder(0.1, 0.2))
    with pytest.raises(
        ValueError, match=r"body 'it' has the shape Cylinder; expected a Sphere, Capsule, Box or Polytope"
    ):
        mech.with_terrain(WAVES, bodies=["it"])
    with pytest.raises(ValueError, match=r"Mechanism.with_terrain\(bodies=...\): 'leg' is not one of: it"):
        mech.with_terrain(WAVES, bodies=["leg"])
    with pytest.raises(ValueError, match=r"Mechanism.with_terrain\(friction=...\).*bodies=\[...\]"):
        mech.with_terrain(WAVES, friction=0.3)
