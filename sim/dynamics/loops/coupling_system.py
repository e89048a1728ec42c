"""Couplings of branches of the tree, pairs of bodies in contact and closed loops, as a small dense system.

A coupling of the bodies a and b adds B f to the wrench on a and takes it from that on b, about O:

    pairs in contact    (K_a, K_b) = B D R        f/D - R_a zeta_a - R_b zeta_b = 0
    closed loop         B = G2^T                      - G3 zeta_a + G3 zeta_b = g

K are the derivatives of the wrench by the twists of the bodies, of rank six at most; taking them apart keeps the
stiffness D of contacts, up to 1e16, out of the sums. With the tree eliminated, twists are zeta = zeta_0 + Z f, where
zeta_0 answers the right-hand side and Z the unit forces:

    (E - R_a Z_a - R_b Z_b) f = g + R_a zeta_0a + R_b zeta_0b        E = 1/D or 0,  R = (G3, -G3) for a loop

so trees stay linear, and pay nothing. Rows of couple_B, couple_R, ... follow coupling_row, those of gears (gears.py)
come last; couple_live lists the rows of the dense system, without those of inactive pairs or zero stiffness.
Redundant constraints (a planar loop in space) are found by the pivots, and their forces set to zero; their
rows are rounding, and kept so by a scale that does not look at directions.
"""

from __future__ import annotations

from sim.dynamics.elimination import solve
from sim.dynamics.loops.constraint_rows import add_columns, enlist, is_loop, response_size, row_response, unit_impulse
from sim.model.columns import CoupleRank
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.full_lu import full_lu_factor, full_lu_solve
from solvers.types import Matrix, Vector

_DEPENDENT = 1e-10  # a pivot below this belongs to a loop constraint that depends on others


@kernel
def scale_row(T: Matrix, p: int, size: float) -> float:
    """Divide row p by its largest entry, or by `size` when that is larger; returns one over it."""
    largest = size
    for q in range(T.shape[1]):
        largest = max(largest, abs(T[p, q]))
    scale = 1.0 / largest if largest > 0.0 else 1.0
    for q in range(T.shape[1]):
        T[p, q] *= scale
    return scale


@optional(Slot.FACTOR_COUPLING, default=True)
def factor_coupling(model: Model, data: Data) -> bool:
    """The dense system of the couplings, factored; after `factor`. False if it is singular beyond redundant loops."""
    n = enlist(model, data)
    T = data.couple_T[:n, :n]
    pairs = 0
    for p in range(n):
        data.couple_scale[p] = 0.0
    for q in range(n):
        col, k = data.couple_live[q, 0], data.couple_live[q, 1]
        unit_impulse(model, data, q, data.rhs)
        y = data.couple_Y[col]
        solve(model, data, data.rhs, y)
        for p in range(n):
            T[p, q] = -row_response(model, data, p, y)
            m = data.couple_live[p, 1]
            if is_loop(model, m) and m < model.coupling_body.shape[0]:
                data.couple_scale[p] = max(data.couple_scale[p], response_size(model, data, m, data.couple_live[p, 0]))
        if not is_loop(model, k):
            T[q, q] += data.couple_E[col]
            pairs += 1
    for p in range(n):
        data.couple_scale[p] = scale_row(T, p, data.couple_scale[p])
    least = _DEPENDENT if model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0 else 1e-300
    rank = full_lu_factor(T, data.couple_pivots, least)
    data.couple_rank[CoupleRank.RANK] = rank
    data.couple_rank[CoupleRank.SIZE] = n
    data.couple_rank[CoupleRank.PIVOT] = 1.0
    for p in range(rank):
        data.couple_rank[CoupleRank.PIVOT] = min(data.couple_rank[CoupleRank.PIVOT], abs(T[p, p]))
    return rank >= pairs


@optional(Slot.SOLVE_COUPLING)
def solve_coupling(model: Model, data: Data, share: float, out: Vector) -> None:
    """After out = H0^-1 b of the tree: the answer with couplings, its twists, and couple_step, the forces f.

    share: part of the loop gaps to close.
    """
    n = int(data.couple_rank[CoupleRank.SIZE])
    x = data.couple_x[:n]
    for p in range(n):
        gap = share * data.couple_gap[data.couple_live[p, 0]]
        x[p, 0] = data.couple_scale[p] * (gap + row_response(model, data, p, out))
    full_lu_solve(data.couple_T[:n, :n], data.couple_pivots, int(data.couple_rank[CoupleRank.RANK]), x)
    for row in range(data.couple_step.shape[0]):
        data.couple_step[row] = 0.0
    for p in range(n):
        f = x[p, 0]
        row = data.couple_live[p, 0]
        data.couple_step[row] = f
        Y = data.couple_Y[row]
        for d in range(out.shape[0]):
            out[d] += f * Y[d]
    body_twists(model, data, out)


@kernel
def body_twists(model: Model, data: Data, y: Vector) -> None:
    """twist[i] = twist[parent] + S3nu y."""
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        V = data.twist[i]
        for k in range(6):
            V[k] = data.twist[p, k] if p >= 0 else 0.0
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            for k in range(6):
                V[k] += data.S3nu[d, k] * y[d]


@optional(Slot.SOLVE_COUPLING_PANEL)
def solve_coupling_panel(model: Model, data: Data) -> None:
    """`solve_coupling` for all columns, after `solve_panel`; couple_panel holds g of each column."""
    n = int(data.couple_rank[CoupleRank.SIZE])
    X = data.couple_panel[:n]
    for p in range(n):
        add_columns(model, data, p, X[p])
        for m in range(X.shape[1]):
            X[p, m] *= data.couple_scale[p]
    full_lu_solve(data.couple_T[:n, :n], data.couple_pivots, int(data.couple_rank[CoupleRank.RANK]), X)
    for p in range(n):
        Y = data.couple_Y[data.couple_live[p, 0]]
        for d in range(data.columns.shape[0]):
            f = Y[d]
            for m in range(X.shape[1]):
                data.columns[d, m] += f * X[p, m]
