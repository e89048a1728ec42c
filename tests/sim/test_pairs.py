"""Contacts between bodies: momentum, Newton's third law, no overlap, derivatives; stacks and mass ratios."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, Cylinder, HalfSpace, Sphere, String
from support.towers import tower
from support.two_bodies import SHAPES, approaching, two


def touching(sim: dojo.Simulator, seed: int) -> np.ndarray:
    """The state of a motion towards one another when they are about to touch."""
    x = approaching(sim, seed, 1.0)
    for _ in range(60):
        r = sim.step(x)
        assert r.success, r.message
        if r.contacts.gap.min() < 0.01:
            return x
        x = r.x
    return x


@pytest.mark.parametrize("b", SHAPES)
@pytest.mark.parametrize("a", SHAPES)
def test_collisions_conserve_momentum_and_do_not_overlap(a: str, b: str) -> None:
    sim = dojo.Simulator(two(SHAPES[a], SHAPES[b]), time_step=0.01, tolerance=1e-11)
    hit = 0
    for seed in range(4):
        x = approaching(sim, seed, 1.0)
        p0, L0 = sim.momentum(x)
        t = sim.rollout(x, np.zeros((60, sim.nu)))
        assert t.success, t.message
        p, L = sim.momentum(t.x)
        np.testing.assert_allclose(p, np.tile(p0, (len(p), 1)), atol=1e-8)
        np.testing.assert_allclose(L, np.tile(L0, (len(L), 1)), atol=1e-8)
        assert t.contacts.gap.min() > -1e-6
        energy = sim.energy(t.x)
        assert energy[-1] < energy[0] + 2e-3  # kappa pushes from afar
        hit += bool(np.abs(t.contacts.impulse).max() > 0.1)
    assert hit > 0


@pytest.mark.parametrize(
    ("a", "b", "seeds"),
    [
        ("box", "box", [9, 14, 20, 37, 61, 89, 102, 109, 148, 235]),
        ("capsule", "box", [9, 12, 22, 43, 79, 94, 123, 152, 225, 227]),
        ("capsule", "capsule", [0, 1]),
    ],
)
def test_corners_that_slide_over_edges(a: str, b: str, seeds: list[int]) -> None:
    """Motions (benchmarks/collisions.py) with steps that have no solution, or one that gains energy, when the elements
    in contact follow the iterates.
    """
    sim = dojo.Simulator(two(SHAPES[a], SHAPES[b]), time_step=0.01, kappa=1e-6)
    for seed in seeds:
        t = sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu)))
        assert t.success, (seed, t.message)
        assert np.diff(sim.energy(t.x)).max() < 1e-2, seed  # kappa pushes from afar
        assert t.contacts.gap.min() > 0.0


@pytest.mark.parametrize("obstacle", ["sphere", "capsule", "cylinder", "box"])
@pytest.mark.parametrize("shape", ["sphere", "capsule", "box", "cylinder"])
def test_obstacles_of_every_shape(shape: str, obstacle: str) -> None:
    """In either order of the two; a body dropped on an obstacle stays outside, and has the right derivatives."""
    fixed = Cylinder(0.3, 0.4) if obstacle == "cylinder" else SHAPES[obstacle]
    solid = Cylinder(0.2, 0.3) if shape == "cylinder" else SHAPES[shape]
    body, joint = Body("a", 1.0, (0.02, 0.03, 0.04), shape=solid), Joint("floating", None, "a")
    forward = Collision("a", shape_b=fixed, friction=0.4)
    backward = Collision("world", "a", shape_a=fixed, friction=0.4)
    runs = []
    for collision in (forward, backward):
        mech = Mechanism([body], [joint], collisions=[collision])
        sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-4, tolerance=1e-12)
        x = np.concatenate([[0.05, 0.03, 0.9, 0.8, 0.4, -0.2, 0.4], [0.1, 0.0, -1.0, 2.0, -1.0, 0.5]])
        x[3:7] /= np.linalg.norm(x[3:7])
        t = sim.rollout(x, np.zeros((40, sim.nu)))
        assert t.success, t.message
        assert t.contacts.gap.min() > 0.0
        assert np.abs(t.contacts.impulse).max() > 0.1
        runs.append(t)
    np.testing.assert_allclose(runs[0].x, runs[1].x, atol=1e-6)
    hit = int(np.argmax(np.abs(t.contacts.impulse).max(axis=(1, 2))))
    A, _ = sim.linearize(t.x[hit])
    F = np.empty_like(A)
    e = 1e-5
    for k, d in enumerate(e * np.eye(sim.ndx)):
        p, m, p2, m2 = (sim.step(sim.integrate(t.x[hit], s * d)).x for s in (1, -1, 2, -2))
        F[:, k] = (8 * sim.difference(p, m) - sim.difference(p2, m2)) / (12 * e)
    np.testing.assert_allclose(A, F, atol=1e-6 * np.abs(A).max())


def balls(count: int, spacing: float) -> Mechanism:
    """Balls on a line, all of which may collide."""
    names = [f"b{k}" for k in range(count)]
    bodies = [Body(n, 1.0 + k, shape=Sphere(0.1)) for k, n in enumerate(names)]
    pairs = [Collision(a, b) for a, b in combinations(names, 2)]
    neutral = {n: [spacing * k, 0, 0, 1, 0, 0, 0] for k, n in enumerate(names)}
    joints = [Joint("floating", None, n) for n in names]
    return Mechanism(bodies, joints, collisions=pairs, gravity=(0, 0, 0), neutral=neutral)


@pytest.mark.parametrize("kappa", [1e-6, 1e-4])
def test_far_pairs_are_the_same_as_near_ones(kappa: float) -> None:
    """The law of a far pair is evaluated, not omitted; momentum is kept, and derivatives include all pairs."""
    sim, other = (dojo.Simulator(balls(4, 0.7), time_step=0.01, kappa=kappa, tolerance=1e-11) for _ in range(2))
    other._engine.model.pair_bound[:, 3] = np.inf  # nothing is far for bodies without inertia
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(0).normal(size=sim.nv)
    runs = [s.rollout(x, np.zeros((10, 0)), throw=True) for s in (sim, other)]
    np.testing.assert_allclose(runs[0].x, runs[1].x, atol=1e-10)
    np.testing.assert_allclose(runs[0].contacts.impulse, runs[1].contacts.impulse, atol=1e-10)
    np.testing.assert_allclose(np.ptp(sim.momentum(runs[0].x)[0], axis=0), 0.0, atol=1e-9)
    for A, B in zip(sim.linearize(x), other.linearize(x), strict=True):
        np.testing.assert_allclose(A, B, atol=1e-7)


def test_a_far_pair_comes_near_within_a_step() -> None:
    """A ball at rest above a fixed one: nothing says before the step that it falls through the gap in one."""
    ball, joint = Body("a", 1.0, shape=Sphere(0.1)), Joint("floating", None, "a")
    above = Collision("a", shape_b=Sphere(0.1))
    falls = []
    for gravity in (10.0, 1000.0):
        mech = Mechanism([ball], [joint], collisions=[above], gravity=(0, 0, -gravity))
        sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-8)
        x = sim.neutral()
        x[2] = 0.25
        falls.append(sim.step(x, throw=True))
        assert sim.inactive_contacts(x) == (("a-world",) if gravity == 10.0 else ())
    assert falls[0].contacts.gap[0] == pytest.approx(0.049, abs=1e-6)
    assert 0.0 < falls[1].contacts.gap[0] < 1e-8
    assert falls[1].contacts.impulse[0, 2] == pytest.approx(5.0, rel=1e-6)  # 10 N s less 0.05 m / 0.01 s * 1 kg


@pytest.mark.sweep(5)
@pytest.mark.parametrize("kappa", [1e-2, 1e-4])
@pytest.mark.parametrize(("law", "friction"), [("nonlinear", 0.5), ("linear", 0.5), ("impact", 0.0)])
@pytest.mark.parametrize("pair", [("sphere", "sphere"), ("sphere", "box"), ("capsule", "capsule"), ("box", "box")])
def test_derivatives_of_a_step_with_a_collision(pair: tuple[str, str], law: str, friction: float, kappa: float) -> None:
    sim = dojo.Simulator(
        two(SHAPES[pair[0]], SHAPES[pair[1]], friction, law), time_step=0.01, kappa=kappa, tolerance=1e-12
    )
    x = touching(sim, 3 if pair[0] != "box" else 5)
    A, _ = sim.linearize(x)
    best = np.inf
    for e in (1e-5, 1e-6):  # the curvature of a contact and rounding each want another step
        F = np.empty_like(A)
        for k, d in enumerate(e * np.eye(sim.ndx)):
            p, m = (sim.step(sim.integrate(x, s * d)).x for s in (1, -1))
            p2, m2 = (sim.step(sim.integrate(x, 2 * s * d)).x for s in (1, -1))
            F[:, k] = (8 * sim.difference(p, m) - sim.difference(p2, m2)) / (12 * e)
        best = min(best, float(np.abs(A - F).max() / np.abs(A).max()))
    assert best < 1e-6


@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e6])
def test_heavy_balls_rest_on_light_ones(ratio: float) -> None:
    sim = dojo.Simulator(tower(Sphere(0.1), [1.0, ratio], "prismatic"), time_step=0.01)
    t = sim.rollout(sim.neutral(), np.zeros((200, sim.nu)))
    assert t.success, t.message
    assert t.contacts.gap.min() > 0.0 and t.x[-1, 1] == pytest.approx(0.3, abs=1e-6)


def test_a_stack_of_boxes_stands() -> None:
    sim = dojo.Simulator(tower(Box(0.2, 0.2, 0.2), [1.0] * 4), time_step=0.01)
    t = sim.rollout(sim.neutral(), np.zeros((100, sim.nu)))
    assert t.success, t.message
    centers = sim.maximal(t.x[-1])[:, :3]
    np.testing.assert_allclose(centers, [[0, 0, 0.1 + 0.2 * k] for k in range(4)], atol=1e-3)
    load = t.contacts.force[-1, :, 2]
    names = sim.mechanism.contact_names
    for k in range(4):
        below = sum(f for f, name in zip(load, names, strict=True) if name.startswith(f"body{k}-"))
        assert abs(below) == pytest.approx(9.81 * (4 - k), rel=1e-3)  # Newton's third law, whoever comes first


def test_the_ground_as_a_collision_is_the_ground_as_a_contact() -> None:
    ball = Body("ball", 1.0, shape=Sphere(0.1))
    start = {"ball": [0, 0, 0.2, 1, 0, 0, 0]}
    joint = Joint("floating", None, "ball")
    a = Mechanism([ball], [joint], [Contact("ball", radius=0.1, friction=0.4)], neutral=start)
    b = Mechanism([ball], [joint], collisions=[Collision("ball", shape_b=HalfSpace(), friction=0.4)], neutral=start)
    x = dojo.Simulator(a, time_step=0.01).neutral()
    x[7:] = [1.0, 0.5, -1.0, 3.0, -2.0, 1.0]
    runs = [dojo.Simulator(m, time_step=0.01, kappa=1e-8).rollout(x, np.zeros((60, 0))) for m in (a, b)]
    np.testing.assert_allclose(runs[0].x, runs[1].x, atol=1e-5)
    np.testing.assert_allclose(runs[0].contacts.impulse, runs[1].contacts.impulse, atol=1e-5)


def test_a_polytope_falls_as_the_box_that_it_is() -> None:
    corners = np.array(list(product((-0.2, 0.2), (-0.15, 0.15), (-0.25, 0.25))))
    runs = []
    for shape in (SHAPES["box"], Polytope(corners)):
        slope = HalfSpace(orientation=(np.cos(0.05), 0.0, np.sin(0.05), 0.0))
        mech = Mechanism([Body("a", 1.0, shape=shape)], [Joint("floating", None, "a")], collisions=[
            Collision("a", shape_b=slope, friction=0.3)])  # fmt: skip
        sim = dojo.Simulator(mech, time_step=0.01)
        x = np.concatenate([[0, 0, 0.5, 0.8, 0.4, -0.2, 0.4], [0.5, 0.0, -1.0, 2.0, -1.0, 0.5]])
        runs.append(sim.rollout(x, np.zeros((80, sim.nu)), throw=True).x)
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-5)


def test_collisions_are_checked() -> None:
    bodies = [Body("a", 1.0, (1, 1, 1)), Body("b", 1.0, shape=Cylinder(0.1, 0.2)), Body("c", 1.0, shape=Box(1, 1, 1))]
    joints = [Joint("floating", None, b.name) for b in bodies]
    cases = {
        "body 'a' has no shape": Collision("a", "b"),
        "no collision of Cylinder and String": Collision("b", "c", shape_b=String(1.0)),
        "'nobody' is not one of": Collision("nobody", "c"),
    }
    for message, collision in cases.items():
        with pytest.raises(ValueError, match=message):
            dojo.Simulator(Mechanism(bodies, joints, collisions=[collision]), time_step=0.01)
    with pytest.raises(ValueError, match="collide with itself"):
        Collision("a", "a")
    with pytest.raises(ValueError, match="give shape_b=..., the shape of the obstacle"):
        Collision("a")
