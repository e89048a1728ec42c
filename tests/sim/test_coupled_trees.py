"""Many bodies in contact with one another: couplings are eliminated over the trees that they join."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import HalfSpace, Sphere
from support.jacobians import check_step
from support.towers import tower

BALL = Sphere(0.1)


def heap(touching: list[tuple[int, int]], places: list[tuple[float, float, float]]) -> Mechanism:
    """Balls at these places, some of which may touch one another."""
    bodies = [Body(f"b{k}", 1.0 + 0.5 * k, shape=BALL) for k in range(len(places))]
    joints = [Joint("floating", None, b.name) for b in bodies]
    collisions = [Collision(f"b{i}", f"b{j}") for i, j in touching]
    collisions += [Collision(b.name, shape_b=HalfSpace()) for b in bodies]
    neutral = {b.name: [*p, 1, 0, 0, 0] for b, p in zip(bodies, places, strict=True)}
    return Mechanism(bodies, joints, collisions=collisions, neutral=neutral)


def pyramid() -> Mechanism:
    """Four balls, each on or beside two others: their couplings form a circle with a chord."""
    places = [(-0.1, 0.0, 0.1), (0.1, 0.0, 0.1), (0.0, 0.173, 0.1), (0.0, 0.058, 0.264)]
    return heap([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], places)


def arms() -> Mechanism:
    """Two arms of two links, listed in turns, a ball between their tips, and one that touches the first arm only."""
    names = ["left1", "right1", "left2", "right2"]
    bodies = [Body(n, 1.0, (0.01, 0.01, 0.01), shape=BALL) for n in names]
    bodies += [Body("ball", 0.5, shape=BALL), Body("other", 0.7, shape=BALL)]
    down, up = (0.0, 0.0, -0.15), (0.0, 0.0, 0.15)
    joints = [
        Joint("revolute", None, "left1", parent_point=(-0.2, 0.0, 0.6), child_point=up, axis=(0.0, 1.0, 0.0)),
        Joint("revolute", None, "right1", parent_point=(0.2, 0.0, 0.6), child_point=up, axis=(0.0, 1.0, 0.0)),
        Joint("spherical", "left1", "left2", parent_point=down, child_point=up),
        Joint("spherical", "right1", "right2", parent_point=down, child_point=up),
        Joint("floating", None, "ball"),
        Joint("floating", None, "other"),
    ]
    collisions = [Collision("ball", "left2"), Collision("ball", "right2"), Collision("other", "left2")]
    place = {"ball": [0.0, 0.0, 0.15, 1, 0, 0, 0], "other": [-0.39, 0.02, 0.15, 1, 0, 0, 0]}
    return Mechanism(bodies, joints, collisions=collisions, neutral=place)


@pytest.mark.parametrize("scene", [lambda: tower(BALL, [1.0, 3.0, 0.5, 2.0]), pyramid, arms])
def test_derivatives_of_steps_in_contact(scene) -> None:
    sim = dojo.Simulator(scene(), time_step=0.01, kappa=1e-5, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = 0.05 * np.random.default_rng(0).normal(size=sim.nv)
    for _ in range(3):
        x = sim.step(x, throw=True).x
    r = check_step(sim, x)
    pressed = np.abs(r.contacts.impulse).max(axis=1) > 1e-3
    assert len(sim.mechanism.collisions) > 2 and pressed.sum() >= 2


def pattern(mechanism: Mechanism) -> tuple[list[tuple[int, int]], np.ndarray]:
    """The couplings of bodies in the order of their elimination, and which of them meet, in a step from neutral."""
    sim = dojo.Simulator(mechanism, time_step=0.01)
    sim.step(sim.neutral(), throw=True)
    data = sim._engine.last()
    count = int(data.couple_count[0])
    assert data.node_count[0] == count
    couplings = [tuple(sim.model.coupling_body[k].tolist()) for k in data.couple_order[:count]]
    return couplings, data.couple_linked[:count, :count].copy()


def test_the_rows_of_a_tower_have_no_fill() -> None:
    couplings, linked = pattern(tower(BALL, [1.0] * 8))
    assert len(set(couplings)) == 8
    assert linked.sum() == 8 + 2 * 7  # each meets the one above and the one below
    for i, j in zip(*np.nonzero(linked), strict=True):
        assert set(couplings[i]) & set(couplings[j]) - {-1}


def test_a_ball_that_touches_many_comes_last() -> None:
    """Its couplings meet one another; those of its neighbours with the ground meet one of them, and come first."""
    ring = [(0.2001 * np.cos(a), 0.2001 * np.sin(a), 0.1) for a in np.arange(5) * (2.0 * np.pi / 5.0)]
    couplings, linked = pattern(heap([(0, k) for k in range(1, 6)], [(0.0, 0.0, 0.1), *ring]))
    assert set(couplings[:5]) == {(k, -1) for k in range(1, 6)}
    assert linked[5:, 5:].all() and linked[:5].sum() == 5 + 5


def test_islands_do_not_meet() -> None:
    places = [(x, y, 0.1) for x in (0.0, 1.0, 2.0) for y in (0.0, 0.2001)]
    couplings, linked = pattern(heap([(0, 1), (2, 3), (4, 5)], places))
    assert linked.sum() == 3 * (3 + 2 * 2)
    for i, j in zip(*np.nonzero(linked), strict=True):
        assert couplings[i][0] // 2 == couplings[j][0] // 2
