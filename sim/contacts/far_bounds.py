"""How far the impulses of a far cluster (far.py) may change until they are evaluated again."""

from __future__ import annotations

from sim.model import Model, Vector
from sim.moves import third_quaternion
from sim.work import Work
from solvers.compiler import kernel

ANGLE = 2.25  # an angle up to pi is at most so many times the distance of its quaternions
NEARER = 0.2  # part of its gap that a cluster may come nearer until its impulses are evaluated again


@kernel
def keep_motion(work: Work, h: float, i: int, row: Vector) -> None:
    """The motion of body i at which its far impulses are evaluated."""
    q = third_quaternion(work, i)
    row[7] = q[0]
    for k in range(3):
        row[4 + k] = work.pos3[i, k]
        row[8 + k] = q[1 + k]
        row[11 + k] = work.move[i, k] / h
        row[14 + k] = 2.0 / h * work.turn[i, 1 + k]


@kernel
def bound_changes(model: Model, work: Work, c: int, gap: float) -> None:
    """far[c, 1:3]: how much the wrench of a cluster can change beyond this gap, with the lever about O.

    d gamma <= kappa/gap^2 d(gap),   d beta <= mu d gamma + mu^2 kappa/gap^2 d(slip)
    """
    i = model.contact_body[c]
    mu = model.cluster[c, 6]
    lever = 1.0 + model.cluster[c, 4]
    for k in range(3):
        lever += abs(work.pos2[i, k] - work.origin[k])
    push = (model.cluster_end[c] - c) * work.far_law[0] / gap
    row = work.far[c]
    row[1] = lever * push * (1.0 + mu) / gap
    row[2] = lever * push * mu * mu / gap
