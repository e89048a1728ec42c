"""Polytopes in motion: steps against every shape are solved, keep momentum, gain no energy; their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, Sphere
from support.free_collision import check_motion
from support.jacobians import check_step
from support.two_bodies import ROCK, SHAPES, approaching, two

OTHERS = {**SHAPES, "polytope": Polytope.about_centroid([[0.3, 0, 0], [-0.3, 0.2, 0], [-0.1, -0.3, 0], [0, 0, 0.4]])}


@pytest.mark.sweep(3)
@pytest.mark.parametrize("first", [True, False], ids=["rock first", "rock second"])
@pytest.mark.parametrize("name", OTHERS)
def test_motions_keep_momentum_and_gain_no_energy(name: str, first: bool) -> None:
    pair = (ROCK, OTHERS[name]) if first else (OTHERS[name], ROCK)
    sim = dojo.Simulator(two(*pair), time_step=0.01, kappa=1e-8, tolerance=1e-12)
    hit = 0
    for seed in range(12):
        t = sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu)))
        assert t.success, (seed, t.message)
        hit += check_motion(sim, t, seed)
    assert hit > 5


@pytest.mark.sweep(4)
@pytest.mark.parametrize("name", OTHERS)
def test_derivatives_of_a_step(name: str) -> None:
    """In the step that hits, and in the one before."""
    sim = dojo.Simulator(two(ROCK, OTHERS[name]), time_step=0.01, kappa=1e-4, tolerance=1e-12)
    checked = 0
    for seed in (0, 1, 3, 4):
        t = sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu)), throw=True)
        push = np.abs(t.contacts.impulse).max(axis=(1, 2))
        if push.max() < 0.1:
            continue
        for k in (int(push.argmax()) - 1, int(push.argmax())):
            check_step(sim, t.x[k])
            checked += 1
    assert checked >= 4


def test_a_polytope_rests_on_a_box_as_the_box_that_it_is() -> None:
    """Lowered onto a table, face on face; then pushed along it below its friction: it stays."""
    corners = 0.1 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    table = Collision("a", shape_b=Box(1.0, 1.0, 0.2, center=(0, 0, -0.1)), friction=0.5)
    body = Body("a", 1.0, shape=Polytope(corners))
    mech = Mechanism([body], [Joint("floating", None, "a")], collisions=[table], gravity=(3.0, 0, -9.81))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-10)
    x = sim.neutral()
    x[2] = 0.105
    t = sim.rollout(x, np.zeros((100, sim.nu)), throw=True)
    np.testing.assert_allclose(t.x[-1, 2], 0.1, atol=1e-6)
    np.testing.assert_allclose(t.x[-1, sim.nq :], 0.0, atol=1e-4)
    np.testing.assert_allclose(t.contacts.force[-1].sum(axis=0), [-3.0, 0.0, 9.81], atol=1e-4)


def test_a_ball_touches_a_polytope_in_one_point() -> None:
    """In every place: its corners, which are farther away or where the ball touches, have no contacts of their own."""
    ball = Collision("a", "b", Sphere(0.1), ROCK)
    bodies = [Body("a", 1.0, 0.004 * np.eye(3)), Body("b", 1.0, shape=ROCK)]
    joints = [Joint("floating", None, "a"), Joint("floating", None, "b")]
    sim = dojo.Simulator(Mechanism(bodies, joints, collisions=[ball], gravity=(0, 0, 0)), time_step=0.01, kappa=1e-4)
    corners = np.asarray(ROCK.vertices)
    x = sim.neutral()
    for corner in (corners[0], corners[:2].mean(axis=0), corners[:3].mean(axis=0)):
        x[:3] = 1.5 * corner
        contacts = sim.step(x, throw=True).contacts
        assert (contacts.gap < 1.0).sum() == 1
        assert len(sim.mechanism.contact_candidates) == 3  # with two spare ones
