"""Gears: rows of the system of the couplings that act on joint coordinates instead of bodies.

    g = q3_a - ratio q3_b - offset = 0        impulse f on coordinate a, -ratio f on coordinate b

They come after the rows of pairs and loops. Their directions are constant, so they add nothing to derivatives but g.
"""

from __future__ import annotations

from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.lanes import load, store
from solvers.types import Matrix, Vector


@kernel
def gear_row(model: Model, k: int) -> int:
    """Row of gear k in that system."""
    return int(model.coupling_row[model.coupling_body.shape[0]]) + k


@optional(Slot.APPLY_GEARS, default=0.0)
def apply_gears(model: Model, data: Data, h: float) -> float:
    """residual -= impulses of gears; fills couple_gap and gear_rate, d(gap)/d(v25) of both; returns the largest gap.

    Impulses of loops along directions in joint space (bifurcation.py) are taken off too.
    """
    error = 0.0
    for k in range(model.gear_dof.shape[0]):
        a = model.gear_dof[k, 0]
        b = model.gear_dof[k, 1]
        row = gear_row(model, k)
        gap = data.theta3[model.dof_qadr[a]] - model.gear_ratio[k] * data.theta3[model.dof_qadr[b]]
        data.couple_gap[row] = gap - model.gear_offset[k]
        data.gear_rate[k, 0] = h
        data.gear_rate[k, 1] = -h * model.gear_ratio[k]
        data.residual[a] -= data.carry.couple_force[row]
        data.residual[b] += model.gear_ratio[k] * data.carry.couple_force[row]
        error = max(error, abs(data.couple_gap[row]))
    if data.bifurcation_count[0] > 0:
        for row in range(gear_row(model, 0)):
            for d in range(data.residual.shape[0]):
                data.residual[d] -= data.carry.couple_force[row] * data.bifurcation_direction[row, d]
    return error


@optional(Slot.UNIT_GEAR_IMPULSE)
def unit_gear_impulse(model: Model, k: int, out: Matrix, c: int) -> None:
    """Column c of out (nv, ...) += the generalized impulse of gear k, of size one."""
    out[model.gear_dof[k, 0], c] += 1.0
    out[model.gear_dof[k, 1], c] -= model.gear_ratio[k]


@optional(Slot.GEAR_RESPONSE, default=0.0)
def gear_response(model: Model, data: Data, k: int, y: Vector) -> float:
    """d(gap of gear k)/d(v25) y."""
    return data.gear_rate[k, 0] * y[model.gear_dof[k, 0]] + data.gear_rate[k, 1] * y[model.gear_dof[k, 1]]


@optional(Slot.GEAR_RESPONSES)
def gear_responses(model: Model, data: Data, k: int, X: Matrix, c: int, p: int) -> None:
    """couple_x[p] = d(gap of gear k)/d(v25) X, of LANES columns of X from c on."""
    a, b = data.gear_rate[k, 0], data.gear_rate[k, 1]
    store(data.couple_x, p, 0, a * load(X, model.gear_dof[k, 0], c) + b * load(X, model.gear_dof[k, 1], c))


@optional(Slot.GEAR_DERIVATIVES)
def gear_derivatives(model: Model, X: Matrix) -> None:
    """X[row of gear] = d(gap)/d(q2)."""
    for k in range(model.gear_dof.shape[0]):
        row = gear_row(model, k)
        for m in range(X.shape[1]):
            X[row, m] = 0.0
        X[row, model.gear_dof[k, 0]] += 1.0
        X[row, model.gear_dof[k, 1]] -= model.gear_ratio[k]
