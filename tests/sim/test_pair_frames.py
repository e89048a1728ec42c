"""Frames of contacts between bodies are orthonormal and continuous, with a derivative, as friction pyramids need."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from sim.contact.pairs.pair_contact import tangents
from sim.contact.pairs.pair_jacobian import frame_turn
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box


def frame(n: np.ndarray) -> np.ndarray:
    """Rows n, t1, t2."""
    return np.array([n, *tangents(*n)])


@pytest.mark.kernel
def test_frames_are_right_handed_and_those_of_the_ground_on_top() -> None:
    for n in np.random.default_rng(0).normal(size=(50, 3)):
        F = frame(n / np.linalg.norm(n))
        np.testing.assert_allclose(F @ F.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(np.cross(F[0], F[1]), F[2], atol=1e-12)
    np.testing.assert_allclose(frame(np.array([0.0, 0.0, 1.0])), np.eye(3)[[2, 0, 1]], atol=1e-15)


@pytest.mark.kernel
def test_frames_do_not_jump() -> None:
    """Along circles through all directions but that opposite the pole, where there is no continuous frame."""
    angles = np.linspace(0.0, 2.0 * np.pi, 20001)
    for axis in np.eye(3):
        u, w = np.roll(axis, 1), np.roll(axis, 2)
        frames = np.array([frame(np.cos(a) * u + np.sin(a) * w) for a in angles])
        assert abs(np.diff(frames, axis=0)).max() < 5e-3


@pytest.mark.kernel
def test_turn_of_the_frame() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        n, rate = rng.normal(size=(2, 3))
        n /= np.linalg.norm(n)
        rate -= n * (n @ rate)
        pair, turn = np.full(64, np.nan), np.full(18, np.nan)
        pair[1:4], pair[7:25] = n, np.outer(rate, [1.0, 0, 0, 0, 0, 0]).ravel()
        frame_turn(pair, turn)
        omega, e = turn.reshape(3, 6)[:, 0], 1e-6
        ahead, behind = (frame((n + s * e * rate) / np.linalg.norm(n + s * e * rate)) for s in (1, -1))
        np.testing.assert_allclose(np.cross(omega, frame(n)), (ahead - behind) / (2 * e), atol=1e-7)


def test_pyramids_of_stones_do_not_jump() -> None:
    """Frames that changed with a component of the normal left some of these steps without a solution."""
    stone = Polytope.about_centroid([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3], [0.2, 0.2, 0.25]])
    bodies = [Body("a", 1.0, (0.01, 0.012, 0.011), shape=stone), Body("b", 2.0, (0.02, 0.022, 0.021))]
    hit = Collision("a", "b", shape_b=Box(0.3, 0.2, 0.25), friction=0.4, law="linear")
    joints = [Joint("floating", None, n) for n in "ab"]
    mech = Mechanism(bodies, joints, collisions=[hit], gravity=(0.0, 0.0, 0.0))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-6, tolerance=1e-10)
    rng = np.random.default_rng(8)
    for _ in range(40):
        turns = [q / np.linalg.norm(q) for q in rng.normal(size=(2, 4))]
        q = np.r_[0, 0, 0, turns[0], 0.42, 0.03 * rng.normal(size=2), turns[1]]
        v = np.r_[2 + rng.normal(), 0.5 * rng.normal(size=2), 2 * rng.normal(size=3)]
        w = np.r_[-1, 0.5 * rng.normal(size=2), 2 * rng.normal(size=3)]
        t = sim.rollout(np.r_[q, v, w], np.zeros((25, 0)))
        assert t.success, t.message
