"""Energy and momentum of bodies from maximal states, whose velocities belong to one instant."""

from __future__ import annotations

import numpy as np

from sim.model.model import Model
from sim.model.state_columns import BodyState
from solvers.types import Floats


def kinetic_energy(model: Model, z: Floats) -> Floats:
    """Sum of m v.v/2 + w.J w/2 of each row [J].   z: (n, nbody, 13)."""
    vel, omega = z[..., BodyState.VELOCITY], z[..., BodyState.SPIN]
    kinetic = np.einsum("b,nbk,nbk->n", model.body_mass, vel, vel) + np.einsum("nbk,nbk->n", omega, _spin(model, z))
    return np.asarray(0.5 * kinetic)


def momentum(model: Model, z: Floats) -> Floats:
    """(linear [N s], angular about the origin of the world [N m s]) momentum of each row.

    z: (n, nbody, 13); returns (n, 6).
    """
    p = model.body_mass[:, None] * z[..., BodyState.VELOCITY]
    angular = np.cross(z[..., BodyState.POSITION], p) + rotated(z[..., BodyState.QUATERNION], _spin(model, z))
    return np.concatenate([p.sum(axis=1), angular.sum(axis=1)], axis=1)


def rotated(quat: Floats, vector: Floats) -> Floats:
    """R(quat) vector, along the last axes."""
    w, u = quat[..., :1], quat[..., 1:]
    return np.asarray(vector + 2.0 * np.cross(u, np.cross(u, vector) + w * vector))


def _spin(model: Model, z: Floats) -> Floats:
    """J w of every body, body axes."""
    return np.einsum("bij,nbj->nbi", model.body_inertia.reshape(-1, 3, 3), z[..., BodyState.SPIN])
