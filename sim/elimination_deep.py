"""The elimination of many right-hand sides on deep trees, by wrenches up and twists down; else see elimination_panel.py.

A block of columns goes up the tree and down again before the next one begins, so that its wrenches and twists stay in
the nearest cache.
"""

from __future__ import annotations

from sim import late
from sim.model import Matrix, Model
from sim.work import Work
from solvers.jit import kernel
from solvers.lanes import LANES, Lanes, Six, dot_lanes, load, six, spread, store
from solvers.lu import lu_solve_lanes


@kernel
def _put(P: Matrix, r: int, c: int, w: Six) -> None:
    """P[r : r + 6] = w."""
    store(P, r, c, w[0])
    store(P, r + 1, c, w[1])
    store(P, r + 2, c, w[2])
    store(P, r + 3, c, w[3])
    store(P, r + 4, c, w[4])
    store(P, r + 5, c, w[5])


@kernel
def _plus(w: Six, S: Matrix, d: int, x: Lanes) -> Six:
    """w + S[d] x"""
    s = S[d]
    return w[0] + s[0] * x, w[1] + s[1] * x, w[2] + s[2] * x, w[3] + s[3] * x, w[4] + s[4] * x, w[5] + s[5] * x


@kernel
def _sum(v: Six, w: Six) -> Six:
    """v + w"""
    return v[0] + w[0], v[1] + w[1], v[2] + w[2], v[3] + w[3], v[4] + w[4], v[5] + w[5]


@kernel
def _zero() -> Six:
    """No wrench."""
    o = spread(0.0)
    return o, o, o, o, o, o


@kernel
def _up(model: Model, work: Work, c: int) -> None:
    """From the leaves to the root: columns = D^-1 (columns - S2^T p), p_parent += p + U columns; of a leaf p = 0."""
    X, P = work.columns, work.panel
    for i in range(model.body_parent.shape[0]):
        if model.body_leaf[i] == 0:
            _put(P, 6 * i, 0, _zero())
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        d0 = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        q = model.body_parent[i]
        leaf = model.body_leaf[i] == 1
        w = _zero() if leaf else six(P, 6 * i, 0)
        if end == d0 + 1:
            x = load(X, d0, c) if leaf else load(X, d0, c) - dot_lanes(work.S2, d0, 0, w)
            x = work.D[i, 0] * x
            store(X, d0, c, x)
            w = _plus(w, work.U, d0, x)
        elif end > d0:
            if not leaf:
                for d in range(d0, end):
                    store(X, d, c, load(X, d, c) - dot_lanes(work.S2, d, 0, w))
            lu_solve_lanes(work.D[i], end - d0, int(work.D[i, 36]), X, d0, c)
            if q >= 0:
                for d in range(d0, end):
                    w = _plus(w, work.U, d, load(X, d, c))
        if q >= 0:
            _put(P, 6 * q, 0, _sum(six(P, 6 * q, 0), w))


@kernel
def _down(model: Model, work: Work, c: int) -> None:
    """From the root to the leaves: columns -= L V_parent, V = V_parent + S3nu columns."""
    X, P = work.columns, work.panel
    for i in range(model.body_parent.shape[0]):
        d0 = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        q = model.body_parent[i]
        above = _zero()
        if q >= 0:
            above = six(P, 6 * q, 0)
            for d in range(d0, end):
                store(X, d, c, load(X, d, c) - dot_lanes(work.L, d, 0, above))
        if model.body_leaf[i] == 0:
            for d in range(d0, end):
                above = _plus(above, work.S3nu, d, load(X, d, c))
            _put(P, 6 * i, 0, above)


@late.solve_deep_panel.defined(otherwise=False)
def solve_deep_panel(model: Model, work: Work, count: int) -> bool:
    """columns := H^-1 columns, as many as `count`, in time that is linear in the number of joints. True."""
    for c in range(0, count, LANES):
        _up(model, work, c)
        _down(model, work, c)
    return True
