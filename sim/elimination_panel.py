"""The elimination applied to many right-hand sides at once: inner loops run along the columns and vectorise."""

from __future__ import annotations

from sim.model import Matrix, Model
from sim.work import Work
from solvers.jit import inlined, kernel
from solvers.lu import lu_solve_rows


@kernel
def _rows_minus(S: Matrix, d: int, P: Matrix, r: int, out: Matrix) -> None:
    """out[d] -= S[d] . P[r : r + 6]"""
    a, b, c, e, f, g = S[d, 0], S[d, 1], S[d, 2], S[d, 3], S[d, 4], S[d, 5]
    p0, p1, p2, p3, p4, p5 = P[r], P[r + 1], P[r + 2], P[r + 3], P[r + 4], P[r + 5]
    x = out[d]
    for k in range(x.shape[0]):
        x[k] -= a * p0[k] + b * p1[k] + c * p2[k] + e * p3[k] + f * p4[k] + g * p5[k]


@kernel
def _add_rows(S: Matrix, d: int, X: Matrix, P: Matrix, r: int) -> None:
    """P[r : r + 6] += S[d] X[d], a row at a time: with more than one row written the loop does not vectorise."""
    x = X[d]
    for j in range(6):
        a = S[d, j]
        p = P[r + j]
        for k in range(x.shape[0]):
            p[k] += a * x[k]


@kernel
def _add_three_rows(S: Matrix, d: int, X: Matrix, P: Matrix, r: int) -> None:
    """`_add_rows` of d, d + 1 and d + 2 at once."""
    x, y, z = X[d], X[d + 1], X[d + 2]
    for j in range(6):
        a, b, c = S[d, j], S[d + 1, j], S[d + 2, j]
        p = P[r + j]
        for k in range(x.shape[0]):
            p[k] += a * x[k] + b * y[k] + c * z[k]


@kernel
def _scale_row(X: Matrix, d: int, f: float) -> None:
    """X[d] *= f"""
    x = X[d]
    for k in range(x.shape[0]):
        x[k] *= f


@kernel
def _clear_rows(P: Matrix, first: int, count: int) -> None:
    """P[first + r] = 0, r < count."""
    for r in range(first, first + count):
        p = P[r]
        for k in range(p.shape[0]):
            p[k] = 0.0


@kernel
def _add_block(P: Matrix, source: int, target: int) -> None:
    """P[target : target + 6] += P[source : source + 6]"""
    for r in range(6):
        p = P[source + r]
        s = P[target + r]
        for k in range(p.shape[0]):
            s[k] += p[k]


@kernel
def _pass_up(P: Matrix, child: int, S: Matrix, d: int, X: Matrix, parent: int) -> None:
    """P[parent : parent + 6] += P[child : child + 6] + S[d] X[d]"""
    x = X[d]
    for r in range(6):
        a = S[d, r]
        p = P[child + r]
        s = P[parent + r]
        for k in range(p.shape[0]):
            s[k] += p[k] + a * x[k]


@kernel
def _pass_down(P: Matrix, parent: int, S: Matrix, d: int, X: Matrix, child: int) -> None:
    """P[child : child + 6] = P[parent : parent + 6] + S[d] X[d]"""
    x = X[d]
    for r in range(6):
        a = S[d, r]
        p = P[parent + r]
        s = P[child + r]
        for k in range(p.shape[0]):
            s[k] = p[k] + a * x[k]


@kernel
def _add_joint(S: Matrix, first: int, last: int, X: Matrix, P: Matrix, r: int) -> None:
    """P[r : r + 6] += the sum of S[d] X[d], first <= d < last."""
    whole = last - (last - first) % 3
    for d in range(first, whole, 3):
        _add_three_rows(S, d, X, P, r)
    for d in range(whole, last):
        _add_rows(S, d, X, P, r)


@inlined
def _panel_up(model: Model, work: Work) -> None:
    """From the leaves to the root: columns = D^-1 (columns - S2^T p), p_parent += p + U columns.

    A leaf has p = 0: nothing to project, and its U columns go to the parent at once.
    """
    X = work.columns
    P = work.panel
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        if model.body_leaf[i] == 0:
            _clear_rows(P, 6 * i, 6)
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        d0 = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d0
        q = model.body_parent[i]
        leaf = model.body_leaf[i] == 1
        if not leaf:
            for d in range(d0, d0 + n):
                _rows_minus(work.S2, d, P, 6 * i, X)
        if n == 1:
            _scale_row(X, d0, work.D[i, 0])
        elif n > 1:
            lu_solve_rows(work.D[i], n, int(work.D[i, 36]), X, d0)
        if q < 0 or n == 0 and leaf:
            continue
        if leaf:
            _add_joint(work.U, d0, d0 + n, X, P, 6 * q)
        elif n == 1:
            _pass_up(P, 6 * i, work.U, d0, X, 6 * q)
        else:
            _add_joint(work.U, d0, d0 + n, X, P, 6 * i)
            _add_block(P, 6 * i, 6 * q)


@kernel
def solve_panel(model: Model, work: Work) -> None:
    """columns := H^-1 columns, as `solve` for one right-hand side.

    Leaves the twists of the bodies in `panel`; of leaves only where there are couplings, which ask for them.
    """
    _panel_up(model, work)
    X = work.columns
    P = work.panel
    coupled = work.couple_panel.shape[0] > 0
    for i in range(model.body_parent.shape[0]):
        d0 = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        q = model.body_parent[i]
        if q >= 0:
            for d in range(d0, end):
                _rows_minus(work.L, d, P, 6 * q, X)
        if model.body_leaf[i] == 1 and not coupled:
            continue
        if q >= 0 and end == d0 + 1:
            _pass_down(P, 6 * q, work.S3nu, d0, X, 6 * i)
            continue
        _clear_rows(P, 6 * i, 6)
        if q >= 0:
            _add_block(P, 6 * q, 6 * i)
        _add_joint(work.S3nu, d0, end, X, P, 6 * i)
