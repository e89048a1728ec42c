"""d(residual)/d(q2, v15) of a step, from the composite matrices of the branches of the tree."""

from __future__ import annotations

from sim.elimination import dot_six
from sim.model import Matrix, Model, Vector
from sim.rotation import cross
from sim.work import Work
from solvers.jit import kernel
from solvers.lanes import LANES, Lanes, keep, load, spread, store


@kernel
def residual_derivatives(model: Model, work: Work, h: float) -> None:
    """dR_dq and the momentum part of dR_dv (unit columns), without joint-space terms.

    For dofs j and k on one branch, with the composite of the deeper body:
        dR_dq[j, k] = S2_j.(A3 S3_k + A2 S2_k + A1 S1_k) + (S2_k x S2_j).r      dR_dv[j, k] = S2_j.A1 S1_k
    the second term where the test direction j moves with k: k above j, or in the joint of a rotation j;
    r: residual wrench on the subtree of j.

    A row is written LANES columns at a time: those above its joint with G, its own and those below with F.
    """
    _unit_columns(work)
    for i in range(model.body_parent.shape[0]):
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            _composite_products(work, d, i)
    for i in range(model.body_parent.shape[0]):
        for b in range(model.body_above.shape[1]):
            above = model.body_above[i, b]
            below = model.body_below[i, b]
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                q, v = spread(0.0), spread(0.0)
                if above != 0:
                    row = _dot_lanes(work.G, d, 0, work.S_across, 0, b)
                    v = keep(above, row)
                    row = row + _dot_lanes(work.G, d, 6, work.S_across, 6, b)
                    q = keep(above, row + _dot_lanes(work.G, d, 12, work.S_across, 12, b))
                if below != 0:
                    q = q + keep(below, _dot_lanes(work.S2, d, 0, work.F_across, 0, b))
                    v = v + keep(below, _dot_lanes(work.S2, d, 0, work.F_across, 6, b))
                store(work.dR_dq, d, b * LANES, q)
                store(work.dR_dv, d, b * LANES, v)
        for d in range(model.body_vadr[i] + model.joint_ntrans[i], model.body_vadr[i + 1]):
            for e in range(model.body_vadr[i], model.body_vadr[i + 1]):
                work.dR_dq[d, e] += dot_six(work.S2[e], work.F[d, 12:])


@kernel
def _dot_lanes(S: Matrix, d: int, first: int, P: Matrix, r: int, b: int) -> Lanes:
    """S[d, first : first + 6] . P[r : r + 6], block b of columns."""
    s = S[d, first : first + 6]
    c = b * LANES
    return (
        (s[0] * load(P, r, c) + s[1] * load(P, r + 1, c))
        + (s[2] * load(P, r + 2, c) + s[3] * load(P, r + 3, c))
        + (s[4] * load(P, r + 4, c) + s[5] * load(P, r + 5, c))
    )


@kernel
def _unit_columns(work: Work) -> None:
    """S_across = the columns of configurations 1, 2 and 3, one per column."""
    for d in range(work.S2.shape[0]):
        for k in range(6):
            work.S_across[k, d] = work.S1[d, k]
            work.S_across[6 + k, d] = work.S2[d, k]
            work.S_across[12 + k, d] = work.S3[d, k]


@kernel
def _row(A: Matrix, i: int, t: Vector) -> Lanes:
    """t^T A[i], A[i] 6 x 6 row-major, in the first six lanes."""
    return (
        (t[0] * load(A, i, 0) + t[1] * load(A, i, 6))
        + (t[2] * load(A, i, 12) + t[3] * load(A, i, 18))
        + (t[4] * load(A, i, 24) + t[5] * load(A, i, 30))
    )


@kernel
def _composite_products(work: Work, d: int, i: int) -> None:
    """Column d of F_across = (A3 S3 + A2 S2 + A1 S1, A1 S1), F[d, 12:] = t, G[d] = (S2 A1, S2 A2 + t, S2 A3), A of body i.

    t = (a x f, v x f + a x m): (S_k x S_d).r = S_k.t for S_d = (v, a), r = (f, m).
    """
    s = work.S2[d]
    for r in range(6):
        k = 6 * r
        momentum = dot_six(work.A1[i, k : k + 6], work.S1[d])
        rest = dot_six(work.A2[i, k : k + 6], s) + dot_six(work.A3[i, k : k + 6], work.S3[d])
        work.F_across[r, d] = momentum + rest
        work.F_across[6 + r, d] = momentum
    store(work.G, d, 0, _row(work.A1, i, s))
    store(work.G, d, 6, _row(work.A2, i, s))
    store(work.G, d, 12, _row(work.A3, i, s))
    F, G = work.F[d], work.G[d]
    f = work.subtree[i]
    F[12], F[13], F[14] = cross(s[3], s[4], s[5], f[0], f[1], f[2])
    x, y, z = cross(s[0], s[1], s[2], f[0], f[1], f[2])
    u, v, w = cross(s[3], s[4], s[5], f[3], f[4], f[5])
    F[15], F[16], F[17] = x + u, y + v, z + w
    for k in range(6):
        G[6 + k] += F[12 + k]
