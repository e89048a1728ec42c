"""The elimination of many right-hand sides on deep trees, by wrenches up and twists down; see elimination_panel.py.

A block of columns goes up the tree and down again before the next one begins, so that its wrenches and twists stay in
the nearest cache.
"""

from __future__ import annotations

from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import JointFactor
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.lanes import LANES, dot_lanes, load, plus, plus_outer, put, six, store, zeros
from solvers.lu import lu_solve_lanes


@kernel
def _up(model: Model, data: Data, c: int) -> None:
    """From the leaves to the root: columns = D^-1 (columns - S2^T p), p_parent += p + U columns; of a leaf p = 0."""
    X, P = data.columns, data.panel
    for i in range(model.body_parent.shape[0]):
        if model.body_leaf[i] == 0:
            put(P, 6 * i, 0, zeros())
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        d0 = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        q = model.body_parent[i]
        leaf = model.body_leaf[i] == 1
        w = zeros() if leaf else six(P, 6 * i, 0)
        if end == d0 + 1:
            x = load(X, d0, c) if leaf else load(X, d0, c) - dot_lanes(data.S2, d0, 0, w)
            x = data.D[i, JointFactor.INVERSE] * x
            store(X, d0, c, x)
            w = plus_outer(w, data.U[d0], x)
        elif end > d0:
            if not leaf:
                for d in range(d0, end):
                    store(X, d, c, load(X, d, c) - dot_lanes(data.S2, d, 0, w))
            lu_solve_lanes(data.D[i], end - d0, int(data.D[i, JointFactor.SWAPS]), X, d0, c)
            if q >= 0:
                for d in range(d0, end):
                    w = plus_outer(w, data.U[d], load(X, d, c))
        if q >= 0:
            put(P, 6 * q, 0, plus(six(P, 6 * q, 0), w))


@kernel
def _down(model: Model, data: Data, c: int) -> None:
    """From the root to the leaves: columns -= L V_parent, V = V_parent + S3nu columns."""
    X, P = data.columns, data.panel
    for i in range(model.body_parent.shape[0]):
        d0 = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        q = model.body_parent[i]
        above = zeros()
        if q >= 0:
            above = six(P, 6 * q, 0)
            for d in range(d0, end):
                store(X, d, c, load(X, d, c) - dot_lanes(data.L, d, 0, above))
        if model.body_leaf[i] == 0:
            for d in range(d0, end):
                above = plus_outer(above, data.S3nu[d], load(X, d, c))
            put(P, 6 * i, 0, above)


@optional(Slot.SOLVE_DEEP_PANEL, default=0)
def solve_deep_panel(model: Model, data: Data, count: int) -> int:
    """columns[:, :count] := H^-1 columns[:, :count], in time that is linear in the number of joints; returns count."""
    for c in range(0, count, LANES):
        _up(model, data, c)
        _down(model, data, c)
    return count
