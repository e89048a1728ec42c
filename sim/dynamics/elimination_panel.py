"""The elimination applied to many right-hand sides at once: as many columns as a processor takes in one instruction.

In joint space it is a substitution with two triangles and the factors of the joint blocks between them,

    up      z = D^-1 (b - sum of (S2 . U_k) z_k over the dofs k below)
    down    y = z - sum of (L . S3nu_k) y_k over the dofs k above

which takes one product where wrenches and twists take twelve, but as many as there are pairs of dofs on a branch: on
trees that are deep throughout, elimination_deep.py takes less. Rows of right-hand sides end in zeros (layout.py),
so that the last block of columns needs no care.
"""

from __future__ import annotations

from sim.dynamics.elimination_deep import solve_deep_panel
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import JointFactor
from solvers.compiler import kernel
from solvers.lanes import LANES, SIDE, Lanes, dot_lanes, keep, load, six, spread, store
from solvers.lu import lu_solve_lanes


@kernel
def _fill_triangles(model: Model, data: Data) -> None:
    """triangles[d, k] = S2_d . U_k for k below d, L_d . S3nu_k for k above."""
    across = data.triangle_across
    for d in range(data.U.shape[0]):
        for r in range(6):
            across[r, d] = data.U[d, r]
            across[6 + r, d] = data.S3nu[d, r]
    for b in range(model.body_above.shape[1]):
        u, s = six(across, 0, b * LANES), six(across, 6, b * LANES)
        for i in range(model.body_parent.shape[0]):
            above, below = model.body_above[i, b], model.body_below[i, b]
            if above == 0 and below == 0:
                continue
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                t = spread(0.0)
                if above != 0:
                    t = keep(above, dot_lanes(data.L, d, 0, s))
                if below != 0:
                    t = t + keep(below, dot_lanes(data.S2, d, 0, u))
                store(data.triangles, d, b * LANES, t)


@kernel
def _up(model: Model, data: Data, c: int) -> None:
    """SIDE columns from c on, at whose lanes the processor works side by side, from the leaves to the root."""
    X, T = data.columns, data.triangles
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
            f = data.D[i, JointFactor.INVERSE] if n == 1 else 1.0
            store(X, d, c, f * x)
            store(X, d, c + LANES, f * y)
            store(X, d, c + 2 * LANES, f * z)
        if n > 1:
            for e in range(c, c + SIDE, LANES):
                lu_solve_lanes(data.D[i], n, int(data.D[i, JointFactor.SWAPS]), X, d0, e)


@kernel
def _down(model: Model, data: Data, c: int) -> None:
    """Substitution in the columns from the root to the leaves."""
    X, T = data.columns, data.triangles
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
def _twists(model: Model, data: Data, count: int) -> None:
    """panel[6 i : 6 i + 6] = twist of body i, V_parent + S3nu columns."""
    X, P = data.columns, data.panel
    for i in range(model.body_parent.shape[0]):
        q = model.body_parent[i]
        for c in range(0, count, LANES):
            for r in range(6):
                v: Lanes = load(P, 6 * q + r, c) if q >= 0 else spread(0.0)
                for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                    v = v + data.S3nu[d, r] * load(X, d, c)
                store(P, 6 * i + r, c, v)


@kernel
def column_count(model: Model, data: Data) -> int:
    """Columns in use, 2 nv + nu; the rest of the rows of `columns` is zero."""
    return 2 * data.columns.shape[0] + model.input_kind.shape[0]


@kernel
def clear_columns(data: Data) -> None:
    """columns = 0, couple_panel = 0."""
    for m in range(data.columns.shape[1]):
        for d in range(data.columns.shape[0]):
            data.columns[d, m] = 0.0
    for row in range(data.couple_panel.shape[0]):
        for m in range(data.couple_panel.shape[1]):
            data.couple_panel[row, m] = 0.0


@kernel
def solve_panel(model: Model, data: Data) -> None:
    """columns := H^-1 columns, as `solve` for one right-hand side.

    Leaves the twists of the bodies in `panel` if there are couplings, which need them.
    """
    count = column_count(model, data)
    if solve_deep_panel(model, data, count) == 0:
        _fill_triangles(model, data)
        for c in range(0, count, SIDE):
            _up(model, data, c)
            _down(model, data, c)
    if data.couple_panel.shape[0] > 0:
        _twists(model, data, count)
