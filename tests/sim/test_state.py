"""integrate and difference are inverse to each other on the manifold of states."""

from __future__ import annotations

import numpy as np
import pytest

from sim.simulator.simulator import Simulator
from support.mechanisms import chain_with

SIM = Simulator(chain_with("planar_free", on_world=False))
SPECIAL = (0.0, 1e-300, 1e-160, 1e-12, 0.5, 1.0)  # shares of the largest number, where mistakes are likely
CASES = 500


def numbers(rng: np.random.Generator, largest: float) -> np.ndarray:
    """(CASES, ndx) of both signs; of some cases all are special, of others some or none."""
    drawn = rng.uniform(-1.0, 1.0, (CASES, SIM.ndx))
    special = rng.choice(SPECIAL, drawn.shape) * rng.choice((-1.0, 1.0), drawn.shape)
    return largest * np.where(rng.random(drawn.shape) < rng.choice((0.0, 0.3, 1.0), (CASES, 1)), special, drawn)


def states(rng: np.random.Generator) -> np.ndarray:
    """Any states: quaternions from any rotation vector."""
    return np.asarray(SIM.integrate(SIM.neutral(), numbers(rng, 10.0)))


def perturbations(rng: np.random.Generator) -> np.ndarray:
    """Steps with rotations below half a turn, from tiny to large."""
    sizes = [0.0, 1e-300, 1e-160, 1e-12, 1e-6, 1e-3, 0.1, 1.0]
    return rng.choice(sizes, (CASES, 1)) * numbers(rng, 1.8)


def test_difference_inverts_integrate(rng: np.random.Generator) -> None:
    x, dx = states(rng), perturbations(rng)
    np.testing.assert_allclose(SIM.difference(SIM.integrate(x, dx), x), dx, rtol=1e-9, atol=1e-14)


def test_integrate_inverts_difference(rng: np.random.Generator) -> None:
    x0, x1 = states(rng), states(rng)
    back = SIM.integrate(x0, SIM.difference(x1, x0))
    np.testing.assert_allclose(SIM.difference(x1, back), 0.0, atol=1e-9)


def test_quaternions_stay_of_length_one(rng: np.random.Generator) -> None:
    moved = SIM.integrate(states(rng), perturbations(rng))
    for joint in SIM.mechanism.joints:
        if joint.nrot == 3:
            stop = SIM.mechanism.q_slice(joint.name).stop
            np.testing.assert_allclose(np.linalg.norm(moved[:, stop - 4 : stop], axis=1), 1.0, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-9, 1e-4, 0.1, 3.0, np.pi - 1e-3, np.pi - 1e-9, np.pi])
def test_every_angle_to_half_a_turn(angle: float) -> None:
    x, dx = SIM.neutral(), np.zeros(SIM.ndx)
    dx[3:6] = angle * np.array([2.0, -1.0, 2.0]) / 3
    back = SIM.difference(SIM.integrate(x, dx), x)
    # at half a turn itself the two directions are the same rotation
    sign = np.sign(back[3] * dx[3]) if angle == np.pi else 1.0
    np.testing.assert_allclose(sign * back, dx, rtol=1e-12, atol=1e-300)


def test_opposite_quaternions_are_the_same_state() -> None:
    x = SIM.neutral()
    other = x.copy()
    other[3:7] *= -1.0
    np.testing.assert_array_equal(SIM.difference(x, other), 0.0)


def test_leading_axes_are_broadcast() -> None:
    x = SIM.neutral()
    dx = 0.1 * np.arange(3 * 2 * SIM.ndx, dtype=float).reshape(3, 2, SIM.ndx) / SIM.ndx
    moved = SIM.integrate(x, dx)
    assert moved.shape == (3, 2, SIM.nx)
    np.testing.assert_allclose(moved[2, 1], SIM.integrate(x, dx[2, 1]), rtol=1e-15)
    np.testing.assert_allclose(SIM.difference(moved, x), dx, atol=1e-13)
    with pytest.raises(ValueError, match=r"Simulator.integrate: leading axes \(3,\) of x and \(2,\) of dx do not"):
        SIM.integrate(np.tile(x, (3, 1)), dx[0])
