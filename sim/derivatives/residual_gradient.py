"""d(residual)/d(q2, v15) of a step, from the composite matrices of the branches of the tree."""

from __future__ import annotations

from sim.dynamics.elimination import dot_six, numbers, times_row
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import DirectionRow
from solvers.compiler import kernel
from solvers.lanes import LANES, Lanes, dot_lanes, keep, load, six, spread, store
from solvers.rotation import cross
from solvers.types import Matrix, Vector


@kernel
def residual_derivatives(model: Model, data: Data) -> None:
    """dR_dq and the momentum part of dR_dv (unit columns), without joint-space terms.

    For dofs j and k on one branch, with the composite of the deeper body:
        dR_dq[j, k] = S2_j.(A3 S3_k + A2 S2_k + A1 S1_k) + (S2_k x S2_j).r      dR_dv[j, k] = S2_j.A1 S1_k
    the second term where the test direction j moves with k: k above j, or in the joint of a rotation j;
    r: residual wrench on the subtree of j.
    """
    _unit_columns(data)
    _turned_tests(model, data)
    for i in range(model.body_parent.shape[0]):
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            _composite_products(data, d, i)
    for b in range(model.body_above.shape[1]):
        _rows(model, data, b)
    for i in range(model.body_parent.shape[0]):
        for d in range(model.body_vadr[i] + model.joint_ntrans[i], model.body_vadr[i + 1]):
            for e in range(model.body_vadr[i], model.body_vadr[i + 1]):
                data.dR_dq[d, e] += dot_six(data.S2[e], data.F[d, DirectionRow.TURNED :])


@kernel
def _rows(model: Model, data: Data, b: int) -> None:
    """Block b of columns of all rows: of the dofs above a joint with G, of its own and those below with F."""
    c = b * LANES
    s1, s2, s3 = six(data.S_across, 0, c), six(data.S_across, 6, c), six(data.S_across, 12, c)
    f, f1 = six(data.F_across, 0, c), six(data.F_across, 6, c)
    for i in range(model.body_parent.shape[0]):
        above, below = model.body_above[i, b], model.body_below[i, b]
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            q, v = spread(0.0), spread(0.0)
            if above != 0:
                row = dot_lanes(data.G, d, 0, s1)
                v = keep(above, row)
                q = keep(above, row + dot_lanes(data.G, d, 6, s2) + dot_lanes(data.G, d, 12, s3))
            if below != 0:
                q = q + keep(below, dot_lanes(data.S2, d, 0, f))
                v = v + keep(below, dot_lanes(data.S2, d, 0, f1))
            store(data.dR_dq, d, c, q)
            store(data.dR_dv, d, c, v)


@kernel
def _unit_columns(data: Data) -> None:
    """S_across = the columns of configurations 1, 2 and 3, one per column."""
    for d in range(data.S2.shape[0]):
        for k in range(6):
            data.S_across[k, d] = data.S1[d, k]
            data.S_across[6 + k, d] = data.S2[d, k]
            data.S_across[12 + k, d] = data.S3[d, k]


@kernel
def _row(A: Matrix, i: int, t: Vector) -> Lanes:
    """t^T A[i], A[i] 6 x 6 row-major, in the first six lanes."""
    return (
        (t[0] * load(A, i, 0) + t[1] * load(A, i, 6))
        + (t[2] * load(A, i, 12) + t[3] * load(A, i, 18))
        + (t[4] * load(A, i, 24) + t[5] * load(A, i, 30))
    )


@kernel
def _turned_tests(model: Model, data: Data) -> None:
    """F[d, TURNED:] = t = (a x f, v x f + a x m): (S_k x S_d).r = S_k.t for S_d = (v, a), r = (f, m) below d."""
    for d in range(data.F.shape[0]):
        s = data.S2[d]
        f = data.subtree[model.dof_body[d]]
        F = data.F[d, DirectionRow.TURNED :]
        F[0], F[1], F[2] = cross(s[3], s[4], s[5], f[0], f[1], f[2])
        x, y, z = cross(s[0], s[1], s[2], f[0], f[1], f[2])
        u, v, w = cross(s[3], s[4], s[5], f[3], f[4], f[5])
        F[3], F[4], F[5] = x + u, y + v, z + w


@kernel
def _composite_products(data: Data, d: int, i: int) -> None:
    """Column d of F_across = (A3 S3 + A2 S2 + A1 S1, A1 S1), G[d] = (S2 A1, S2 A2 + t, S2 A3), A of body i, t in F."""
    s = data.S2[d]
    a1, a2, a3 = numbers(data.S1[d]), numbers(s), numbers(data.S3[d])
    A1, A2, A3 = data.A1[i], data.A2[i], data.A3[i]
    for r in range(6):
        momentum = times_row(A1, 6 * r, a1)
        data.F_across[r, d] = momentum + times_row(A2, 6 * r, a2) + times_row(A3, 6 * r, a3)
        data.F_across[6 + r, d] = momentum
    store(data.G, d, 0, _row(data.A1, i, s))
    store(data.G, d, 6, _row(data.A2, i, s) + load(data.F, d, 12))
    store(data.G, d, 12, _row(data.A3, i, s))
