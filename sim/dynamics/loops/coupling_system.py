"""Couplings of branches of the tree, pairs of bodies in contact and closed loops, as a system of their forces.

With the tree eliminated, the twists of bodies are zeta = zeta_0 + Z f, Z the answers to unit forces:

    (E - R_a Z_a - R_b Z_b) f = g + R_a zeta_0a + R_b zeta_0b        E = 1/D or 0,  R = (G3, -G3) for a loop

Derivation: docs/theory/couplings.md. Rows of couple_B, couple_R, ... follow coupling_row, those of gears (gears.py)
come last; couple_live lists the rows of the system, without those of inactive pairs or zero stiffness.
"""

from __future__ import annotations

from sim.dynamics.elimination_panel import column_count
from sim.dynamics.elimination_tree import clear_tree, clear_twists, in_tree, solve_tree
from sim.dynamics.loops.constraint_rows import (
    column_responses,
    enlist,
    is_loop,
    is_pair,
    response_size,
    row_response,
    row_responses,
    unit_impulses,
)
from sim.dynamics.loops.coupling_order import is_apart, moved_tree, order_couplings, set_nodes
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import CoupleRank
from sim.model.slots import Slot
from solvers.block_lu import Nodes, block_lu_factor, block_lu_solve
from solvers.compiler import kernel, optional
from solvers.lanes import LANES, load, put, spread, store, zeros
from solvers.types import Vector

_DEPENDENT = 1e-10  # a pivot below this belongs to a loop constraint that depends on others


@optional(Slot.FACTOR_COUPLING, default=True, rolled=True)
def factor_coupling(model: Model, data: Data) -> bool:
    """The system of the couplings, factored; after `factor`. False if it is singular beyond redundant loops.

    Contacts one coupling after the other; with pivots over all rows where that would be inaccurate.
    """
    count = order_couplings(model, data)
    pairs = enlist(model, data, count)
    data.couple_count[0] = count
    rank = -1
    if is_apart(model) and count > 1:
        rank = _factor_nodes(model, data, False)
    if rank < 0:
        rank = _factor_nodes(model, data, True)
    data.couple_rank[CoupleRank.RANK] = rank
    data.couple_rank[CoupleRank.SIZE] = data.couple_start[count]
    return rank >= pairs


@kernel
def _nodes(data: Data) -> Nodes:
    """The nodes of the last factors."""
    return Nodes(int(data.node_count[0]), data.node_row, data.node_span)


@kernel
def _factor_nodes(model: Model, data: Data, whole: bool) -> int:
    """couple_T filled and factored, whole or a node for each coupling; its rank, -1 where that is inaccurate."""
    count = int(data.couple_count[0])
    set_nodes(data, count, whole)
    _fill(model, data, whole)
    for m in range(count):
        for p in range(data.couple_start[m], data.couple_start[m + 1]):
            data.couple_scale[p] = _scale_row(data, p, m, whole)
    least = 1e-300 if is_apart(model) else _DEPENDENT
    rank = block_lu_factor(data.couple_T, data.couple_pivots, _nodes(data), least)
    data.couple_rank[CoupleRank.PIVOT] = 1.0
    for p in range(rank if whole else 0):
        data.couple_rank[CoupleRank.PIVOT] = min(data.couple_rank[CoupleRank.PIVOT], abs(data.couple_T[p, p]))
    return rank


@kernel
def _fill(model: Model, data: Data, whole: bool) -> None:
    """couple_Y, and couple_T where couplings are linked, or all of it; couple_scale: sizes of the rows of loops."""
    count = int(data.couple_count[0])
    for i in range(model.body_parent.shape[0]):
        put(data.couple_Z, 6 * i, 0, zeros())
    for p in range(data.couple_start[count]):
        data.couple_scale[p] = 0.0
    for m in range(count):
        k = data.couple_order[m]
        _answers(model, data, m, LANES * k)
        left = data.couple_start[m] if whole else LANES * m
        for j in range(count):
            if whole or data.couple_linked[j, m] == 1:
                for p in range(data.couple_start[j], data.couple_start[j + 1]):
                    store(data.couple_T, p, left, -1.0 * row_responses(model, data, p, LANES * k))
        rows = data.couple_start[m + 1] - data.couple_start[m]
        if not is_apart(model):
            add_loop_sizes(model, data, rows)
        for e in range(rows if is_pair(model, k) else 0):
            p = data.couple_start[m] + e
            data.couple_T[p, left + e] += data.couple_E[data.couple_live[p, 0]]
        for side in range(2):
            clear_twists(moved_tree(model, k, side), data.couple_Z)


@kernel
def _answers(model: Model, data: Data, m: int, c: int) -> None:
    """couple_Y and couple_Z: the answers of the trees to unit forces of the rows at place m; columns from c on."""
    k = data.couple_order[m]
    for side in range(2):
        clear_tree(model, moved_tree(model, k, side), data.couple_Y, c)
    unit_impulses(model, data, m, c)
    for side in range(2):
        solve_tree(model, data, moved_tree(model, k, side), data.couple_Y, c, data.couple_Z)


@optional(Slot.ADD_LOOP_SIZES)
def add_loop_sizes(model: Model, data: Data, columns: int) -> None:
    """couple_scale of the rows of loops = their largest `response_size`."""
    for p in range(data.couple_start[data.couple_count[0]]):
        m = data.couple_live[p, 1]
        if is_loop(model, m) and m < model.coupling_body.shape[0]:
            for e in range(columns):
                data.couple_scale[p] = max(data.couple_scale[p], response_size(model, data, p, e))


@kernel
def _scale_row(data: Data, p: int, m: int, whole: bool) -> float:
    """Divide row p, at place m, by its largest entry, or by couple_scale when that is larger; returns one over it."""
    largest = data.couple_scale[p]
    count = int(data.couple_count[0])
    row = data.couple_T[p]
    for j in range(count):
        if whole or data.couple_linked[m, j] == 1:
            left = data.couple_start[j] if whole else LANES * j
            for c in range(left, left + data.couple_start[j + 1] - data.couple_start[j]):
                largest = max(largest, abs(row[c]))
    scale = 1.0 / largest if largest > 0.0 else 1.0
    for j in range(count):
        if whole or data.couple_linked[m, j] == 1:
            left = data.couple_start[j] if whole else LANES * j
            for c in range(left, left + data.couple_start[j + 1] - data.couple_start[j]):
                row[c] *= scale
    return scale


@kernel
def _solve_rows(data: Data) -> None:
    """couple_x := the forces, from the scaled right-hand sides."""
    rank = int(data.couple_rank[CoupleRank.RANK])
    block_lu_solve(data.couple_T, data.couple_pivots, _nodes(data), rank, data.couple_x)


@optional(Slot.SOLVE_COUPLING, rolled=True)
def solve_coupling(model: Model, data: Data, gap_fraction: float, out: Vector) -> None:
    """After out = H0^-1 b of the tree: the answer with couplings, its twists, and couple_step, the forces f.

    gap_fraction: part of the loop gaps to close.
    """
    count = int(data.couple_count[0])
    for p in range(data.couple_start[count]):
        gap = gap_fraction * data.couple_gap[data.couple_live[p, 0]]
        store(data.couple_x, p, 0, spread(data.couple_scale[p] * (gap + row_response(model, data, p, out))))
    _solve_rows(data)
    for row in range(data.couple_step.shape[0]):
        data.couple_step[row] = 0.0
    for p in range(data.couple_start[count]):
        data.couple_step[data.couple_live[p, 0]] = data.couple_x[p, 0]
    for m in range(count):
        _add_answers(model, data, m, out)
    body_twists(model, data, out)


@kernel
def _moved_dofs(model: Model, data: Data, k: int) -> int:
    """couple_dof: the coordinates that impulses of coupling k move; their number."""
    n = 0
    for side in range(2):
        tree = moved_tree(model, k, side)
        for i in range(tree.begin, tree.end):
            if in_tree(model, tree, i):
                for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                    data.couple_dof[n] = d
                    n += 1
    return n


@kernel
def _add_answers(model: Model, data: Data, m: int, out: Vector) -> None:
    """out (nv,) += the answers to the forces of the rows at place m."""
    k = data.couple_order[m]
    first, n = data.couple_start[m], data.couple_start[m + 1] - data.couple_start[m]
    for p in range(_moved_dofs(model, data, k)):
        d = data.couple_dof[p]
        for e in range(n):
            out[d] += data.couple_x[first + e, 0] * data.couple_Y[d, LANES * k + e]


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
    for c in range(0, column_count(model, data), LANES):
        for p in range(data.couple_start[data.couple_count[0]]):
            store(data.couple_x, p, 0, data.couple_scale[p] * column_responses(model, data, p, c))
        _solve_rows(data)
        for m in range(data.couple_count[0]):
            _add_answers_to_columns(model, data, m, c)


@kernel
def _add_answers_to_columns(model: Model, data: Data, m: int, c: int) -> None:
    """columns[:, c : c + LANES] += the answers to the forces of the rows at place m."""
    k = data.couple_order[m]
    first, n = data.couple_start[m], data.couple_start[m + 1] - data.couple_start[m]
    for p in range(_moved_dofs(model, data, k)):
        d = data.couple_dof[p]
        x = load(data.columns, d, c)
        for e in range(n):
            x = x + data.couple_Y[d, LANES * k + e] * load(data.couple_x, first + e, 0)
        store(data.columns, d, c, x)
