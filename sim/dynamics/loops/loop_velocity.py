"""Projection of a velocity onto the constraints of loops and gears, in the kinetic metric.

    P v = v - M^-1 G^T (G M^-1 G^T)^-1 G v        M, G at configuration 2

With v = M^-1 p, p without the half of the loops' impulses that acts at the node, P v is the velocity at the node.
"""

from __future__ import annotations

from sim.dynamics.loops.bifurcation import lead_loops
from sim.dynamics.loops.closure import direct_loops, loop_rows
from sim.dynamics.loops.coupling_system import body_twists, factor_coupling, solve_coupling
from sim.dynamics.loops.gears import gear_row
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import CoupleRank
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.types import Vector

_WEAK = 1e-3  # a pivot of G M^-1 G^T above this is that of a configuration where no branches meet


@kernel
def _set_rows(model: Model, data: Data) -> None:
    """couple_R = (B, -B) of loops, and unit rates of gears; no pairs of bodies."""
    pairs = model.coupling_body.shape[0] - model.loop_ntrans.shape[0]
    for k in range(pairs):
        data.coupling_live[k] = 0
    for row in range(model.coupling_row[pairs], model.coupling_row[model.coupling_body.shape[0]]):
        for c in range(6):
            data.couple_R[row, c] = data.couple_B[row, c]
            data.couple_R[row, 6 + c] = -data.couple_B[row, c]
    for k in range(model.gear_dof.shape[0]):
        data.gear_rate[k, 0] = 1.0
        data.gear_rate[k, 1] = -model.gear_ratio[k]


@optional(Slot.CLOSE_VELOCITY)
def close_velocity(model: Model, data: Data, h: float, q: Vector, v: Vector, out: Vector) -> None:
    """out = P out, with the mass matrix of configuration 2 factored; its twists in data.twist.

    q: (nq,) configuration 2; v: (nv,) velocity of the interval 1-2, which tells the branch where two meet: there rows
    of G are those of bifurcation.py.   out: (nv,).
    """
    direct_loops(model, data)
    data.bifurcation_count[0] = 0
    _set_rows(model, data)
    solved = factor_coupling(model, data)
    loops = model.loop_ntrans.shape[0] > 0
    if loops and (
        data.couple_rank[CoupleRank.RANK] < data.couple_rank[CoupleRank.SIZE]
        or data.couple_rank[CoupleRank.PIVOT] < _WEAK
    ):
        lead_loops(model, data, h, q, v)
        _set_rows(model, data)
        data.bifurcation_replaces[0] = 1
        solved = factor_coupling(model, data)
    if solved:
        body_twists(model, data, out)
        solve_coupling(model, data, 0.0, out)
    data.bifurcation_replaces[0] = 0


@kernel
def closing_velocity(model: Model, data: Data, h: float) -> bool:
    """data.dnu = M^-1 G^T f, by which a velocity changes to close loops and gears at configuration 1: G dv = g_1/h.

    With configurations 1 and 2, and the mass matrix of 2 factored; False where the loops are singular.
    """
    direct_loops(model, data)
    data.bifurcation_count[0] = 0
    _set_rows(model, data)
    if not factor_coupling(model, data):
        return False
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, data, m, data.pos1, data.rot1, data.couple_G)
    for k in range(model.gear_dof.shape[0]):
        a, b = data.theta1[model.dof_qadr[model.gear_dof[k, 0]]], data.theta1[model.dof_qadr[model.gear_dof[k, 1]]]
        data.couple_gap[gear_row(model, k)] = a - model.gear_ratio[k] * b - model.gear_offset[k]
    for row in range(data.couple_gap.shape[0]):
        data.couple_gap[row] *= -1.0 / h
    for d in range(data.dnu.shape[0]):
        data.dnu[d] = 0.0
    body_twists(model, data, data.dnu)
    solve_coupling(model, data, 1.0, data.dnu)
    return True
