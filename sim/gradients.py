"""Derivatives of a step by the implicit function theorem: d(next state)/d(state, input) in tangent coordinates.

The residual R(q2, v15, u, v25) = 0 of a converged step gives  dv25 = -H^-1 (R_q dq2 + R_v dv15 + R_u du).  On the
central path the condensed contact matrices W are the exact derivatives of the impulses: nothing but W is needed.
"""

from __future__ import annotations

from sim.coupling import factor_coupling, solve_coupling_panel
from sim.coupling_gradient import add_coupling_composites, add_coupling_derivatives
from sim.elimination import factor
from sim.elimination_panel import solve_panel
from sim.inequalities import add_stiffness
from sim.joints import add_spring_derivatives, add_swing_curvature, joint_blocks
from sim.kinematics import velocity_columns
from sim.limits import add_limit_derivatives
from sim.model import InputKind, Late, Matrix, Model, Vector, Work
from sim.pair_far import all_near
from sim.pose_jacobians import inertial_jacobians, pose2_to_origin, sum_composites
from sim.restitution import add_bounce_composites, add_bounce_derivatives
from sim.rotation import left_jacobian, quat_exp, quat_matrix, rotate
from solvers.jit import kernel
from solvers.late import late

_JOINT = int(InputKind.JOINT)
_BODY = int(InputKind.BODY)


@late(Late.GRADIENT, False)
def gradient(model: Model, work: Work, h: float, kappa: float, q: Vector, v: Vector, A: Matrix, B: Matrix) -> bool:
    """A = dx3/dx2 (2 nv, 2 nv), B = dx3/du (2 nv, nu) of the step now in `work`, solved at kappa.  False if singular.

    Needs work as a step leaves it: configurations, residual wrenches and cone variables at the solution.
    """
    inertial_jacobians(model, work, h)
    velocity_columns(model, work.S3, work.nu, h, work.S3nu)
    joint_blocks(model, work, h, q, v)
    all_near(model, work)
    add_stiffness(model, work, h, kappa)
    pose2_to_origin(work)
    add_bounce_composites(model, work)
    for i in range(work.A.shape[0]):
        for k in range(36):
            work.A[i, k] = work.A3[i, k]
    if not factor(model, work):
        return False
    add_coupling_composites(model, work, h)
    sum_composites(model, work)
    residual_derivatives(model, work, h)
    add_swing_curvature(model, work, q)  # before `factor_coupling`, whose solves use up work.subtree
    add_bounce_derivatives(model, work)
    add_coupling_derivatives(model, work)
    if not factor_coupling(model, work):
        return False
    add_spring_derivatives(model, work, h, q, v)
    _joint_columns(model, work, h, v)
    _input_columns(model, work, h)
    solve_panel(model, work)
    solve_coupling_panel(model, work)
    _next_state(model, work, h, A, B)
    return True


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


@kernel
def _joint_columns(model: Model, work: Work, h: float, v: Vector) -> None:
    """columns[:, :2 nv] = -(dR_dq, dR_dv): limits added, dR_dv from unit columns to velocities (-h, -h J(h w)^T)."""
    nv = v.shape[0]
    R = work.dR_dv
    for i in range(model.body_parent.shape[0]):
        e = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            end -= 3
            J = left_jacobian(h * v[end], h * v[end + 1], h * v[end + 2])
            for d in range(nv):
                a, b, c = R[d, end], R[d, end + 1], R[d, end + 2]
                R[d, end] = -h * (a * J[0] + b * J[1] + c * J[2])
                R[d, end + 1] = -h * (a * J[3] + b * J[4] + c * J[5])
                R[d, end + 2] = -h * (a * J[6] + b * J[7] + c * J[8])
        for k in range(e, end):
            for d in range(nv):
                R[d, k] *= -h
    add_limit_derivatives(model, work, h)
    for d in range(nv):
        for k in range(nv):
            work.columns[d, k] = -work.dR_dq[d, k]
            work.columns[d, nv + k] = -R[d, k]


@kernel
def _input_columns(model: Model, work: Work, h: float) -> None:
    """columns[:, 2 nv:] = -dR/du: h at the dof of a joint input, h S2^T wrench above the body of the others."""
    nv = work.columns.shape[0]
    for j in range(model.input_kind.shape[0]):
        col = 2 * nv + j
        for d in range(nv):
            work.columns[d, col] = 0.0
        if model.input_kind[j] == _JOINT:
            work.columns[model.input_index[j], col] = h
            continue
        i = model.input_index[j]
        w = model.input_wrench[j]
        f = (w[0], w[1], w[2])
        t = (w[3], w[4], w[5])
        if model.input_kind[j] == _BODY:
            f = rotate(work.rot2, i, f[0], f[1], f[2])
            t = rotate(work.rot2, i, t[0], t[1], t[2])
        x = work.pos2[i, 0] - work.origin[0]
        y = work.pos2[i, 1] - work.origin[1]
        z = work.pos2[i, 2] - work.origin[2]
        t = (t[0] + y * f[2] - z * f[1], t[1] + z * f[0] - x * f[2], t[2] + x * f[1] - y * f[0])
        while i >= 0:
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                s = work.S2[d]
                work.columns[d, col] = h * (
                    s[0] * f[0] + s[1] * f[1] + s[2] * f[2] + s[3] * t[0] + s[4] * t[1] + s[5] * t[2]
                )
            i = model.body_parent[i]


@kernel
def _next_state(model: Model, work: Work, h: float, A: Matrix, B: Matrix) -> None:
    """A, B from dv25 = columns:  dq3 = dq2 + h dv25, and R(h w)^T dphi2 + h J(h w)^T dw for quaternion joints."""
    nv = work.columns.shape[0]
    nu = B.shape[1]
    for d in range(nv):
        X = work.columns[d]
        for k in range(2 * nv):
            A[nv + d, k] = X[k]
            A[d, k] = h * X[k]
        for k in range(nu):
            B[nv + d, k] = X[2 * nv + k]
            B[d, k] = h * X[2 * nv + k]
        A[d, d] += 1.0
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] != 3:
            continue
        d = model.body_vadr[i + 1] - 3
        x, y, z = h * work.nu[d], h * work.nu[d + 1], h * work.nu[d + 2]
        J = left_jacobian(x, y, z)
        e = quat_exp(x, y, z)
        R = quat_matrix(e[0], e[1], e[2], e[3])
        X = work.columns
        for r in range(3):
            j0, j1, j2 = h * J[r], h * J[3 + r], h * J[6 + r]
            for k in range(2 * nv):
                A[d + r, k] = j0 * X[d, k] + j1 * X[d + 1, k] + j2 * X[d + 2, k]
            for k in range(nu):
                m = 2 * nv + k
                B[d + r, k] = j0 * X[d, m] + j1 * X[d + 1, m] + j2 * X[d + 2, m]
            for k in range(3):
                A[d + r, d + k] += R[3 * k + r]
