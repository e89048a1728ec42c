"""d(residual)/d(q2, v15) of a step, from the composite matrices of the branches of the tree."""

from __future__ import annotations

from sim.model import Model, Work
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
        _composite_products(work, d, i, model.body_parent[i] < 0)
        F = work.F[d]
        G = work.G[d]
        rotational = d >= model.body_vadr[i] + model.joint_ntrans[i]
        for e in range(model.body_vadr[i], model.body_vadr[i + 1]):
            b = work.S2[e]
            t = 0.0
            w = 0.0
            for k in range(6):
                t += b[k] * F[k]
                w += b[k] * F[6 + k]
            work.dR_dq[e, d] += t
            work.dR_dv[e, d] = w
            if rotational:
                t = 0.0
                for k in range(6):
                    t += b[k] * F[12 + k]
                work.dR_dq[d, e] += t
        p = model.body_parent[i]
        while p >= 0:
            for e in range(model.body_vadr[p], model.body_vadr[p + 1]):
                s1 = work.S1[e]
                s2 = work.S2[e]
                s3 = work.S3[e]
                row = 0.0
                row1 = 0.0
                col = 0.0
                col1 = 0.0
                for k in range(6):
                    row1 += G[k] * s1[k]
                    row += G[6 + k] * s2[k] + G[12 + k] * s3[k]
                    col += s2[k] * F[k]
                    col1 += s2[k] * F[6 + k]
                work.dR_dq[d, e] = row + row1
                work.dR_dv[d, e] = row1
                work.dR_dq[e, d] = col
                work.dR_dv[e, d] = col1
            p = model.body_parent[p]


@kernel
def _composite_products(work: Work, d: int, i: int, root: bool) -> None:
    """F[d] = (A3 S3 + A2 S2 + A1 S1, A1 S1, t), G[d] = (S2 A1, S2 A2 + t, S2 A3) with the composites of body i.

    t = (a x f, v x f + a x m): (S_k x S_d).r = S_k.t for S_d = (v, a), r = (f, m).
    """
    A1 = work.A1[i]
    A2 = work.A2[i]
    A3 = work.A3[i]
    s1 = work.S1[d]
    s2 = work.S2[d]
    s3 = work.S3[d]
    F = work.F[d]
    G = work.G[d]
    for r in range(6):
        t = 0.0
        w = 0.0
        for k in range(6):
            w += A1[6 * r + k] * s1[k]
            t += A2[6 * r + k] * s2[k] + A3[6 * r + k] * s3[k]
        F[r] = t + w
        F[6 + r] = w
    f = work.subtree[i]
    F[12] = s2[4] * f[2] - s2[5] * f[1]
    F[13] = s2[5] * f[0] - s2[3] * f[2]
    F[14] = s2[3] * f[1] - s2[4] * f[0]
    F[15] = s2[1] * f[2] - s2[2] * f[1] + s2[4] * f[5] - s2[5] * f[4]
    F[16] = s2[2] * f[0] - s2[0] * f[2] + s2[5] * f[3] - s2[3] * f[5]
    F[17] = s2[0] * f[1] - s2[1] * f[0] + s2[3] * f[4] - s2[4] * f[3]
    if root:  # no joint above, no row to pair with
        return
    for k in range(6):
        g1 = 0.0
        g2 = 0.0
        g3 = 0.0
        for r in range(6):
            g1 += s2[r] * A1[6 * r + k]
            g2 += s2[r] * A2[6 * r + k]
            g3 += s2[r] * A3[6 * r + k]
        G[k] = g1
        G[6 + k] = g2 + F[12 + k]
        G[12 + k] = g3
