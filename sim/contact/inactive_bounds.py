"""Bounds of the change of the impulses of an inactive cluster (inactive.py) until their next evaluation."""

from __future__ import annotations

from sim.dynamics.displacements import third_quaternion
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Cluster, Inactive
from solvers.compiler import kernel
from solvers.types import Vector

ANGLE = 2.25  # an angle up to pi is at most so many times the distance of its quaternions
NEARER = 0.2  # part of its gap that a cluster may come nearer until its impulses are evaluated again


@kernel
def keep_motion(data: Data, h: float, i: int, row: Vector) -> None:
    """The motion of body i at which its inactive impulses are evaluated."""
    q = third_quaternion(data, i)
    row[Inactive.QUATERNION] = q[0]
    for k in range(3):
        row[Inactive.POSITION + k] = data.pos3[i, k]
        row[Inactive.QUATERNION + 1 + k] = q[1 + k]
        row[Inactive.VELOCITY + k] = data.move[i, k] / h
        row[Inactive.ANGULAR + k] = 2.0 / h * data.turn[i, 1 + k]


@kernel
def bound_changes(model: Model, data: Data, c: int, gap: float) -> None:
    """BY_GAP and BY_SLIP of Inactive: how much the wrench of a cluster can change beyond this gap, lever about O.

    d gamma <= kappa/gap^2 d(gap),   d beta <= mu d gamma + mu^2 kappa/gap^2 d(slip)
    """
    i = model.contact_body[c]
    mu = model.cluster[c, Cluster.FRICTION]
    lever = 1.0 + model.cluster[c, Cluster.ARM]
    for k in range(3):
        lever += abs(data.pos2[i, k] - data.origin[k])
    push = (model.cluster_end[c] - c) * data.carry.inactive_kappa[0] / gap
    row = data.inactive[c]
    row[Inactive.BY_GAP] = lever * push * (1.0 + mu) / gap
    row[Inactive.BY_SLIP] = lever * push * mu * mu / gap
