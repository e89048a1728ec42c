"""Energy and momentum of a node in the limit of small steps, and where they are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dojo_opt import models
from sim.dynamics.coordinates import maximal_states
from sim.dynamics.energy import energies, momenta
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import pack
from sim.mechanism.shapes import rotation_matrix
from sim.model.layout import allocate_data, sizes_of, table
from sim.simulator.link_kernels import link_poses
from support.mechanisms import CASES, chain_with, random_state
from support.records import arrays_of

Floats = NDArray[np.float64]


def measure(mech: Mechanism, q: Floats, v: Floats, h: float) -> tuple[Floats, Floats, Floats]:
    """(kinetic, potential), momentum, maximal state."""
    model = pack(mech)
    link_poses(model)
    work = allocate_data(sizes_of(model))
    for array in arrays_of(work).values():
        array[...] = np.nan if array.dtype.kind == "f" else 0
    model_at, data_at = table(model), table(work)
    x = np.concatenate([q, v])[None]
    e, p, z = np.empty((1, 2)), np.empty((1, 6)), np.empty((mech.nbody, 13))
    energies(model_at, data_at, h, x, e)
    momenta(model_at, data_at, h, x, p)
    maximal_states(model_at, data_at, h, x, z)
    return e[0], p[0], z


@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_small_steps_give_the_continuous_energy_and_momentum(kind: str, on_world: bool) -> None:
    mech = chain_with(kind, on_world)
    q, v = random_state(np.random.default_rng(5), mech, speed=2.0)
    (kinetic, _), p, z = measure(mech, q, v, 1e-7)
    expected_energy, linear, angular = 0.0, np.zeros(3), np.zeros(3)
    for body, row in zip(mech.bodies, z, strict=True):
        L = rotation_matrix(row[6:10]) @ np.asarray(body.inertia) @ row[10:]
        expected_energy += 0.5 * body.mass * row[3:6] @ row[3:6] + 0.5 * row[10:] @ np.asarray(body.inertia) @ row[10:]
        linear += body.mass * row[3:6]
        angular += np.cross(row[:3], body.mass * row[3:6]) + L
    np.testing.assert_allclose(kinetic, expected_energy, rtol=1e-5)
    np.testing.assert_allclose(p, [*linear, *angular], rtol=1e-5, atol=1e-5)


def test_potential_energy() -> None:
    mech = models.raiberthopper(spring=50.0)
    q = np.array(mech.neutral)
    q[-1] = 0.4
    (kinetic, potential), _, _ = measure(mech, q, np.zeros(7), 0.05)
    assert potential == pytest.approx(9.81 * (4.18 * 0.55 + 0.52 * 0.15) + 25.0 * 0.1**2)
    # at rest over the last interval, the node carries half a step of gravity
    assert kinetic < 0.5 * 4.7 * (0.5 * 0.05 * 9.81) ** 2 + 1.0


def test_spring_of_a_spherical_joint_is_isotropic() -> None:
    mech = models.npendulum(1, joint="spherical", spring=3.0, gravity=(0, 0, 0))
    for axis in np.eye(3):
        q = np.array([np.cos(0.4), *(np.sin(0.4) * axis)])
        assert measure(mech, q, np.zeros(3), 0.01)[0][1] == pytest.approx(2 * 3.0 * np.sin(0.4) ** 2)


def test_pendulum_at_rest_has_the_momentum_of_half_a_step() -> None:
    h = 0.1
    mech = models.pendulum()
    (kinetic, _), _, _ = measure(mech, np.array([np.pi / 2]), np.zeros(1), h)
    inertia = np.asarray(mech.bodies[0].inertia)[0, 0] + 0.25
    assert kinetic == pytest.approx(0.5 * (0.5 * h * 9.81 * 0.5) ** 2 / inertia)
