"""The elimination applied to many right-hand sides at once: as many columns as a processor takes in one instruction.

In joint space it is a substitution with two triangles and the factors of the joint blocks between them,

    up      z = D^-1 (b - sum of (S2 . U_k) z_k over the dofs k below)
    down    y = z - sum of (L . S3nu_k) y_k over the dofs k above

which takes one product where wrenches and twists take twelve, but as many as there are pairs of dofs on a branch: on
trees that are deep throughout, elimination_deep.py takes less. Rows of right-hand sides end in zeros (`sim/layout.py`),
so that the last block of columns needs no care.
"""

from __future__ import annotations

from sim.late import solve_deep_panel
from sim.model import Model
from sim.work import Work
from solvers.compiler import kernel
from solvers.lanes import LANES, SIDE, Lanes, dot_lanes, keep, load, six, spread, store
from solvers.lu import lu_solve_lanes


@kernel
def _fill_triangles(model: Model, work: Work) -> None:
    """triangles[d, k] = S2_d . U_k for k below d, L_d . S3nu_k for k above."""
    across = work.triangle_across
    for d in range(work.U.shape[0]):
        for r in range(6):
            across[r, d] = work.U[d, r]
            across[6 + r, d] = work.S3nu[d, r]
    for b in range(model.body_above.shape[1]):
        u, s = six(across, 0, b * LANES), six(across, 6, b * LANES)
        for i in range(model.body_parent.shape[0]):
            above, below = model.body_above[i, b], model.body_below[i, b]
            if above == 0 and below == 0:
                continue
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                t = spread(0.0)
                if above != 0:
                    t = keep(above, dot_lanes(work.L, d, 0, s))
                if below != 0:
                    t = t + keep(below, dot_lanes(work.S2, d, 0, u))
                store(work.triangles, d, b * LANES, t)


@kernel
def _up(model: Model, work: Work, c: int) -> None:
    """SIDE columns from c on, at whose lanes the processor works side by side, from the leaves to the root."""
    X, T = work.columns, work.triangles
    for i in range(model.body_parent.shape[0] - 1, -1, -1):
        d0 = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d0
        below = model.dofs_below[i]
        for d in range(d0, d0 + n):
            x, y, z = load(X, d, c), load(X, d, c + LANES), load(X, d, c + 2 * LANES)
            for m in range(model.count_below[i]):
                k = below[m]
                t = T[d, k]
                x = x - t * load(X, k, c)
                y = y - t * load(X, k, c + LANES)
                z = z - t * load(X, k, c + 2 * LANES)
            f = work.D[i, 0] if n == 1 else 1.0
            store(X, d, c, f * x)
            store(X, d, c + LANES, f * y)
            store(X, d, c + 2 * LANES, f * z)
        if n > 1:
            for e in range(c, c + SIDE, LANES):
                lu_solve_lanes(work.D[i], n, int(work.D[i, 36]), X, d0, e)


@kernel
def _down(model: Model, work: Work, c: int) -> None:
    """The same columns, from the root to the leaves."""
    X, T = work.columns, work.triangles
    for i in range(model.body_parent.shape[0]):
        above = model.dofs_above[i]
        if model.count_above[i] == 0:
            continue
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            x, y, z = load(X, d, c), load(X, d, c + LANES), load(X, d, c + 2 * LANES)
            for m in range(model.count_above[i]):
                k = above[m]
                t = T[d, k]
                x = x - t * load(X, k, c)
                y = y - t * load(X, k, c + LANES)
                z = z - t * load(X, k, c + 2 * LANES)
            store(X, d, c, x)
            store(X, d, c + LANES, y)
            store(X, d, c + 2 * LANES, z)


@kernel
def _twists(model: Model, work: Work, count: int) -> None:
    """panel[6 i : 6 i + 6] = twist of body i, V_parent + S3nu columns."""
    X, P = work.columns, work.panel
    for i in range(model.body_parent.shape[0]):
        q = model.body_parent[i]
        for c in range(0, count, LANES):
            for r in range(6):
                v: Lanes = load(P, 6 * q + r, c) if q >= 0 else spread(0.0)
                for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                    v = v + work.S3nu[d, r] * load(X, d, c)
                store(P, 6 * i + r, c, v)


@kernel
def column_count(model: Model, work: Work) -> int:
    """Columns in use, 2 nv + nu; the rows of `columns` go on with zeros."""
    return 2 * work.columns.shape[0] + model.input_kind.shape[0]


@kernel
def solve_panel(model: Model, work: Work) -> None:
    """columns := H^-1 columns, as `solve` for one right-hand side.

    Leaves the twists of the bodies in `panel` where there are couplings, which ask for them.
    """
    count = column_count(model, work)
    if solve_deep_panel(model, work, count) == 0:
        _fill_triangles(model, work)
        for c in range(0, count, SIDE):
            _up(model, work, c)
            _down(model, work, c)
    if work.couple_panel.shape[0] > 0:
        _twists(model, work, count)
