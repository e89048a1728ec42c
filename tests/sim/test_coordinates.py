"""Maximal and minimal states: inverse to each other, and their Jacobians, for every joint kind."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sim.dynamics.coordinates import maximal_states, minimal_states
from sim.dynamics.coordinates_jacobian import maximal_jacobian_at, minimal_jacobian_at
from sim.dynamics.state_manifold import integrate_states, state_differences
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import pack
from sim.model.layout import allocate_data, sizes_of, table
from sim.simulator.link_kernels import link_poses
from support.mechanisms import CASES, chain_with, random_state
from support.records import arrays_of

Floats = NDArray[np.float64]
H = 0.05


class Maps:
    """The maps of one mechanism as NumPy functions."""

    def __init__(self, mech: Mechanism) -> None:
        self.mech = mech
        self.model = pack(mech)
        link_poses(self.model)
        self.model_at = table(self.model)
        self.work = allocate_data(sizes_of(self.model))
        for array in arrays_of(self.work).values():
            array[...] = np.nan if array.dtype.kind == "f" else -(2**62)
        self.data_at = table(self.work)
        self.nx, self.ndx = mech.nq + mech.nv, 2 * mech.nv

    def maximal(self, x: Floats) -> Floats:
        out = np.full((self.mech.nbody, 13), np.nan)
        maximal_states(self.model_at, self.data_at, H, x[None], out)
        return out

    def minimal(self, z: Floats) -> Floats:
        out = np.full((1, self.nx), np.nan)
        minimal_states(self.model_at, self.data_at, H, z, out)
        return out[0]

    def integrate(self, x: Floats, dx: Floats) -> Floats:
        out = np.full((1, self.nx), np.nan)
        integrate_states(self.model_at, x[None], dx[None], out)
        return out[0]

    def difference(self, x0: Floats, x1: Floats) -> Floats:
        out = np.full((1, self.ndx), np.nan)
        state_differences(self.model_at, x0[None], x1[None], out)
        return out[0]


def quat_mul(a: Floats, b: Floats) -> Floats:
    w, v = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([w, *v])


def rotation_vector(q: Floats) -> Floats:
    q = q if q[0] >= 0 else -q
    s = float(np.linalg.norm(q[1:]))
    return q[1:] * (2 * np.arctan2(s, q[0]) / s if s > 1e-12 else 2.0)


def exponential(t: Floats) -> Floats:
    a = float(np.linalg.norm(t))
    return np.array([np.cos(a / 2), *(t * np.sinc(a / 2 / np.pi) / 2)])


def move(z: Floats, dz: Floats) -> Floats:
    """z (+) dz, tangent order position, velocity, rotation, angular velocity per body."""
    out = z.copy()
    for row, d in zip(out, dz.reshape(-1, 12), strict=True):
        row[:6] += d[:6]
        row[6:10] = quat_mul(row[6:10], exponential(d[6:9]))
        row[10:] += d[9:]
    return out


def apart(z0: Floats, z1: Floats) -> Floats:
    """z1 (-) z0."""
    conjugate = np.array([1.0, -1, -1, -1])
    return np.concatenate(
        [
            np.concatenate([b[:6] - a[:6], rotation_vector(quat_mul(a[6:10] * conjugate, b[6:10])), b[10:] - a[10:]])
            for a, b in zip(z0, z1, strict=True)
        ]
    )


def setup(kind: str, on_world: bool) -> tuple[Maps, Floats]:
    mech = chain_with(kind, on_world)
    q, v = random_state(np.random.default_rng(3), mech, speed=3.0)
    return Maps(mech), np.concatenate([q, v])


@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_minimal_inverts_maximal(kind: str, on_world: bool) -> None:
    maps, x = setup(kind, on_world)
    z = maps.maximal(x)
    back = maps.minimal(z)
    np.testing.assert_allclose(maps.difference(x, back), 0.0, atol=1e-12)
    np.testing.assert_allclose(apart(z, maps.maximal(back)), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(z[:, 6:10], axis=1), 1.0, rtol=1e-14)


@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_velocities_agree_with_the_interval(kind: str, on_world: bool) -> None:
    maps, x = setup(kind, on_world)
    q, v = x[: maps.mech.nq], x[maps.mech.nq :]
    before = maps.integrate(x, np.concatenate([-H * v, 0 * v]))
    z, z1 = maps.maximal(x), maps.maximal(before)
    step = apart(z1, z).reshape(-1, 12)
    np.testing.assert_allclose(z[:, 3:6], step[:, :3] / H, atol=1e-12)
    np.testing.assert_allclose(z[:, 10:], step[:, 6:9] / H, atol=1e-12)
    assert q.shape == (maps.mech.nq,)


@pytest.mark.sweep(5)
@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_jacobian_of_maximal(kind: str, on_world: bool) -> None:
    maps, x = setup(kind, on_world)
    J = np.full((12 * maps.mech.nbody, maps.ndx), np.nan)
    maximal_jacobian_at(maps.model_at, maps.data_at, H, x, J)
    z, e = maps.maximal(x), 1e-6
    for k, d in enumerate(np.eye(maps.ndx)):
        plus, minus = (apart(z, maps.maximal(maps.integrate(x, s * e * d))) for s in (1, -1))
        np.testing.assert_allclose(
            J[:, k], (plus - minus) / (2 * e), atol=1e-6 * np.abs(J).max(), err_msg=f"column {k}"
        )


@pytest.mark.sweep(3)
@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_jacobian_of_minimal(kind: str, on_world: bool) -> None:
    maps, x = setup(kind, on_world)
    J = np.full((maps.ndx, 12 * maps.mech.nbody), np.nan)
    z, e = maps.maximal(x), 1e-6
    minimal_jacobian_at(maps.model_at, maps.data_at, H, z, J)
    for k, d in enumerate(np.eye(12 * maps.mech.nbody)):
        plus, minus = (maps.difference(x, maps.minimal(move(z, s * e * d))) for s in (1, -1))
        # off the joints too: the map takes the part along the free directions
        np.testing.assert_allclose(
            J[:, k], (plus - minus) / (2 * e), atol=1e-6 * np.abs(J).max(), err_msg=f"column {k}"
        )


@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_jacobians_are_inverse(kind: str, on_world: bool) -> None:
    maps, x = setup(kind, on_world)
    forward = np.empty((12 * maps.mech.nbody, maps.ndx))
    back = np.empty((maps.ndx, 12 * maps.mech.nbody))
    maximal_jacobian_at(maps.model_at, maps.data_at, H, x, forward)
    minimal_jacobian_at(maps.model_at, maps.data_at, H, maps.maximal(x), back)
    np.testing.assert_allclose(back @ forward, np.eye(maps.ndx), atol=1e-10)


def test_angle_comes_back_within_half_a_turn() -> None:
    maps, x = setup("revolute", True)
    x[0] = 3.0 + 2 * np.pi
    assert maps.minimal(maps.maximal(x))[0] == pytest.approx(3.0, abs=1e-12)


@pytest.mark.parametrize("turns", [-3.0, 0.0, 0.5, 40.0])
def test_a_screw_counts_its_turns(turns: float) -> None:
    maps, x = setup("screw", True)
    x[0] += 2 * np.pi * turns
    assert maps.minimal(maps.maximal(x))[0] == pytest.approx(x[0], abs=1e-10)


def test_turn_of_almost_half_a_turn_per_step() -> None:
    maps, x = setup("floating", True)
    x[maps.mech.nq + 3 : maps.mech.nq + 6] = np.array([0.6, -0.8, 0.0]) * 0.9999 * np.pi / H
    x[maps.mech.nq + 6 :] = 0.0
    np.testing.assert_allclose(maps.difference(x, maps.minimal(maps.maximal(x))), 0.0, atol=1e-9)
