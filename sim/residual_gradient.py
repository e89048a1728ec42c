"""d(residual)/d(q2, v15) of a step, from the composite matrices of the branches of the tree."""

from __future__ import annotations

from sim.elimination import column_and_row, dot_six
from sim.model import Model
from sim.rotation import cross
from sim.work import Work
from solvers.jit import kernel


@kernel
def residual_derivatives(model: Model, work: Work, h: float) -> None:
    """dR_dq and the momentum part of dR_dv (unit columns), without joint-space terms.

    For dofs j and k on one branch, with the composite of the deeper body:
        dR_dq[j, k] = S2_j.(A3 S3_k + A2 S2_k + A1 S1_k) + (S2_k x S2_j).r      dR_dv[j, k] = S2_j.A1 S1_k
    the second term where the test direction j moves with k: k above j, or in the joint of a rotation j;
    r: residual wrench on the subtree of j.
    """
    nv = work.dR_dq.shape[0]
    for j in range(nv):
        for k in range(nv):
            work.dR_dq[j, k] = 0.0
            work.dR_dv[j, k] = 0.0
    for d in range(nv):
        i = model.dof_body[d]
        _composite_products(work, d, i)
        F = work.F[d]
        G = work.G[d]
        rotational = d >= model.body_vadr[i] + model.joint_ntrans[i]
        for e in range(model.body_vadr[i], model.body_vadr[i + 1]):
            b = work.S2[e]
            work.dR_dq[e, d] += dot_six(b, F[:6])
            work.dR_dv[e, d] = dot_six(b, F[6:12])
            if rotational:
                work.dR_dq[d, e] += dot_six(b, F[12:])
        p = model.body_parent[i]
        while p >= 0:
            for e in range(model.body_vadr[p], model.body_vadr[p + 1]):
                s2 = work.S2[e]
                row = dot_six(G[:6], work.S1[e])
                work.dR_dq[d, e] = row + dot_six(G[6:12], s2) + dot_six(G[12:], work.S3[e])
                work.dR_dv[d, e] = row
                work.dR_dq[e, d] = dot_six(F[:6], s2)
                work.dR_dv[e, d] = dot_six(F[6:12], s2)
            p = model.body_parent[p]


@kernel
def _composite_products(work: Work, d: int, i: int) -> None:
    """F[d] = (A3 S3 + A2 S2 + A1 S1, A1 S1, t), G[d] = (S2 A1, S2 A2 + t, S2 A3) with the composites of body i.

    t = (a x f, v x f + a x m): (S_k x S_d).r = S_k.t for S_d = (v, a), r = (f, m).
    """
    s = work.S2[d]
    F = work.F[d]
    G = work.G[d]
    column_and_row(work.A1[i], work.S1[d], s, F[6:12], G[:6])
    column_and_row(work.A2[i], s, s, F[:6], G[6:12])
    column_and_row(work.A3[i], work.S3[d], s, F[12:], G[12:])
    for k in range(6):
        F[k] += F[6 + k] + F[12 + k]
    f = work.subtree[i]
    F[12], F[13], F[14] = cross(s[3], s[4], s[5], f[0], f[1], f[2])
    x, y, z = cross(s[0], s[1], s[2], f[0], f[1], f[2])
    u, v, w = cross(s[3], s[4], s[5], f[3], f[4], f[5])
    F[15], F[16], F[17] = x + u, y + v, z + w
    for k in range(6):
        G[6 + k] += F[12 + k]
