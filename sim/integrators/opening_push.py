"""Velocities that contacts and limits give as they open on the central path, where hard ones would give none.

A step and its halves have the same kappa/h and are pushed alike, so their difference does not show it. In the second
half the impulse p = kappa/gap of a contact, with the velocity w p that it gives to the contact, is a push of

    min(w p, change of the gap/h)

A contact that carries has w p far above the change of its gap, one that opens by itself less than it.
"""

from __future__ import annotations

from math import inf

from sim.dynamics.elimination import project, solve, subtree_sums
from sim.dynamics.energy import factor_mass_matrix
from sim.integrators.substeps import SubstepState
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bound, ContactRow
from solvers.compiler import kernel
from solvers.dense import clear
from solvers.rotation import cross, three
from solvers.types import Vector

_LITTLE = 0.01  # speed of opening over the accuracy: slower pushes are omitted


@kernel
def _add_impulse(data: Data, i: int, sign: float, row: Vector) -> float:
    """data.wrench[i] += sign times the normal impulse of a contact's row (11,), about O; the size of the impulse."""
    if i < 0:
        return 0.0
    (px, py, pz), (nx, ny, nz) = three(row, ContactRow.IMPULSE), three(row, ContactRow.NORMAL)
    rx, ry, rz = three(row, ContactRow.POINT)
    p, o, w = px * nx + py * ny + pz * nz, data.origin, data.wrench[i]
    x, y, z = sign * p * nx, sign * p * ny, sign * p * nz
    a, b, c = cross(rx - o[0], ry - o[1], rz - o[2], x, y, z)
    w[0], w[1], w[2], w[3], w[4], w[5] = w[0] + x, w[1] + y, w[2] + z, w[3] + a, w[4] + b, w[5] + c
    return p


@kernel
def _pushed(model: Model, data: Data, p: float, opened: float) -> float:
    """Largest velocity of a coordinate by the impulse p, data.residual in joint coordinates, of a gap that opens."""
    solve(model, data, data.residual, data.dnu)
    largest, work = 0.0, 0.0
    for d in range(data.dnu.shape[0]):
        largest, work = max(largest, abs(data.dnu[d])), work + data.residual[d] * data.dnu[d]
    return largest * min(1.0, opened * p / work) if work > 0.0 else 0.0


@kernel
def _by_limits(model: Model, data: Data, line: SubstepState, h: float, least: float) -> float:
    """Sum of those of the limits, without cones."""
    total = 0.0
    for k in range(model.limit_dof.shape[0]):
        d, p = model.limit_dof[k], data.bound[k, Bound.IMPULSE]
        at = model.dof_qadr[d]
        opened = model.limit_sign[k] * (line.mean[at] - line.half[at]) / h
        if model.limit_cone[k] or p <= 0.0 or opened <= least:
            continue
        for e in range(data.residual.shape[0]):
            data.residual[e] = 0.0
        data.residual[d] = p
        total += _pushed(model, data, p, opened)
    return total


@kernel
def opening_push(model: Model, data: Data, line: SubstepState, h: float, accuracy: float) -> float:
    """Sum of the pushes in the second half, of length h, after which the node is in line.mean and in the Data; of each
    the largest velocity that it gives to a coordinate [m/s, rad/s]; infinite where no mass matrix tells it.
    """
    least, ground = _LITTLE * accuracy, model.contact_height.shape[0]
    if not factor_mass_matrix(model, data, h):
        return inf
    total = _by_limits(model, data, line, h, least)
    for c in range(line.parts.shape[1]):
        row = line.parts[1, c]
        opened = (row[ContactRow.GAP] - line.parts[0, c, ContactRow.GAP]) / h
        if opened <= least or three(row, ContactRow.IMPULSE) == (0.0, 0.0, 0.0):
            continue
        clear(data.wrench)
        p = _add_impulse(data, model.contact_body[c], 1.0, row)
        if c >= ground:
            _add_impulse(data, model.coupling_body[model.pair_coupling[c - ground], 1], -1.0, row)
        subtree_sums(model, data.wrench, data.subtree)
        project(model, data.S2, data.subtree, data.residual)
        total += _pushed(model, data, p, opened)
    return total
