"""Displacements over an interval: rounded to the velocity, not to the pose over h."""

from __future__ import annotations

import numpy as np
import pytest

from sim.simulator.simulator import Simulator
from support.mechanisms import CASES, chain_with, random_state

FAR = 100.0  # [m]


@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_mean_velocities_over_a_tiny_interval(kind: str, on_world: bool) -> None:
    """Over 1e-10 s mean velocities equal instantaneous ones; differences of poses would be off by 1e-5."""
    sim = Simulator(chain_with(kind, on_world), time_step=1e-10)
    q, v = random_state(np.random.default_rng(3), sim.mechanism)
    mean = sim.maximal(np.concatenate([q, v]))
    now = sim.body_states(q, v)
    np.testing.assert_allclose(mean, now, rtol=0, atol=1e-8)


@pytest.mark.parametrize("speed", [1.0, 30.0, 150.0])
@pytest.mark.parametrize("kind", ["orbital", "free_orbital", "spherical", "floating", "planar_axis", "screw"])
def test_increments_end_at_the_poses_of_the_coordinates(kind: str, speed: float) -> None:
    """Also over large turns: the bodies go back to where the coordinates before the interval put them."""
    h = 0.01
    sim = Simulator(chain_with(kind, on_world=False), time_step=h)
    rng = np.random.default_rng(4)
    q, v = random_state(rng, sim.mechanism)
    v *= speed / np.abs(v).max()
    x = np.concatenate([q, v])
    before = sim.integrate(x, np.concatenate([-h * v, np.zeros(sim.nv)]))
    position = sim.maximal(x)[:, :3] - h * sim.maximal(x)[:, 3:6]
    np.testing.assert_allclose(position, sim.maximal(before)[:, :3], rtol=0, atol=1e-13 * (1 + speed))


def test_momentum_is_known_far_from_the_origin() -> None:
    """A floating tree 100 m away has the same momentum over 1 us as at the origin."""
    sim = Simulator(chain_with("spherical", on_world=False), time_step=1e-6)
    q, v = random_state(np.random.default_rng(5), sim.mechanism)
    near, _ = sim.momentum(np.concatenate([q, v]))
    q[:3] += FAR
    far, _ = sim.momentum(np.concatenate([q, v]))
    np.testing.assert_allclose(far, near, rtol=0, atol=1e-12)
