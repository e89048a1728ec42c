"""Joint-space terms of a step: springs, dampers and inputs, in the generalized residual and on the joint blocks.

A spring is integrated at the midpoint of each interval, V_d = (h/2) k |(r(2) + r(3))/2|^2: as implicit as the
trapezoidal rule, so stable for every k, and as conservative, so that a vibration keeps its amplitude. A damper acts on
the unknown velocity, implicit and dissipative for every coefficient. An armature adds I (q2 - q1)^2/(2 h) to the
discrete Lagrangian, the energy of a rotor that turns with the coordinate and carries no momentum elsewhere.
"""

from __future__ import annotations

from sim.model import InputKind, Late, Model, Vector, Work
from sim.rotation import Mat3, Quat, cross, left_jacobian, quat_exp, quat_matrix, quat_mul
from solvers.jit import kernel
from solvers.record import call_late

_JOINT = int(InputKind.JOINT)
_SWING_CURVATURE = int(Late.SWING_CURVATURE)


@kernel
def joint_impulses(model: Model, work: Work, h: float, q: Vector, v: Vector, u: Vector) -> None:
    """residual += I (nu - v) + h d nu + h k (q + h (nu - v)/4 - rest) - h u, and the analogue of quaternion joints."""
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            end -= 3
            if model.dof_spring[end] > 0.0:
                t = spring_impulse(model, work, h, q, v, i)
                for k in range(3):
                    work.residual[end + k] += t[k]
            for k in range(end, end + 3):
                work.residual[k] += h * model.dof_damper[k] * work.nu[k]
        for e in range(d, end):
            r = h * model.dof_damper[e] * work.nu[e] + model.dof_armature[e] * (work.nu[e] - v[e])
            if model.dof_spring[e] > 0.0:
                mid = q[model.dof_qadr[e]] + 0.25 * h * (work.nu[e] - v[e]) - model.dof_rest[e]
                r += h * model.dof_spring[e] * mid
            work.residual[e] += r
    for j in range(u.shape[0]):
        if model.input_kind[j] == _JOINT:
            work.residual[model.input_index[j]] -= h * u[j]


@kernel
def relative_to_rest(model: Model, i: int, q: Vector) -> Quat:
    """conj(exp(rest)) q of quaternion joint i, with nonnegative scalar part."""
    a = model.body_qadr[i] + model.joint_ntrans[i]
    d = model.body_vadr[i] + model.joint_ntrans[i]
    r = quat_exp(-model.dof_rest[d], -model.dof_rest[d + 1], -model.dof_rest[d + 2])
    w, x, y, z = quat_mul(r[0], r[1], r[2], r[3], q[a], q[a + 1], q[a + 2], q[a + 3])
    if w < 0.0:
        return -w, -x, -y, -z
    return w, x, y, z


@kernel
def spring_turns(model: Model, work: Work, h: float, q: Vector, v: Vector, i: int) -> tuple[Quat, Quat, Quat]:
    """Rotation from rest of quaternion joint i at configurations 1, 2, 3; continuous, so no sign flips between them."""
    d = model.body_vadr[i] + model.joint_ntrans[i]
    r2 = relative_to_rest(model, i, q)
    e1 = quat_exp(-h * v[d], -h * v[d + 1], -h * v[d + 2])
    e3 = quat_exp(h * work.nu[d], h * work.nu[d + 1], h * work.nu[d + 2])
    r1 = quat_mul(r2[0], r2[1], r2[2], r2[3], e1[0], e1[1], e1[2], e1[3])
    r3 = quat_mul(r2[0], r2[1], r2[2], r2[3], e3[0], e3[1], e3[2], e3[3])
    return r1, r2, r3


@kernel
def spring_impulse(model: Model, work: Work, h: float, q: Vector, v: Vector, i: int) -> tuple[float, float, float]:
    """(h k/2) (c2 I - [s2]) (s1 + 2 s2 + s3), s the vector parts of the rotations from rest."""
    r1, r2, r3 = spring_turns(model, work, h, q, v, i)
    g = 0.5 * h * model.dof_spring[model.body_vadr[i] + model.joint_ntrans[i]]
    x, y, z = r1[1] + 2 * r2[1] + r3[1], r1[2] + 2 * r2[2] + r3[2], r1[3] + 2 * r2[3] + r3[3]
    cx, cy, cz = cross(r2[1], r2[2], r2[3], x, y, z)
    return g * (r2[0] * x - cx), g * (r2[0] * y - cy), g * (r2[0] * z - cz)


@kernel
def turn_product(a: Quat, b: Quat) -> Mat3:
    """(c_a I - [s_a]) (c_b I + [s_b]) / 4: second derivative of s_a.s_b with respect to right rotations of both."""
    a0, a1, a2, a3 = a[0], a[1], a[2], a[3]
    b0, b1, b2, b3 = b[0], b[1], b[2], b[3]
    dot = a1 * b1 + a2 * b2 + a3 * b3
    # -[a] [b] = (a.b) I - b a^T;  c_a [s_b] - c_b [s_a] is skew
    x, y, z = a0 * b1 - b0 * a1, a0 * b2 - b0 * a2, a0 * b3 - b0 * a3
    s = a0 * b0 + dot
    return (
        0.25 * (s - b1 * a1), 0.25 * (-z - b1 * a2), 0.25 * (y - b1 * a3),
        0.25 * (z - b2 * a1), 0.25 * (s - b2 * a2), 0.25 * (-x - b2 * a3),
        0.25 * (-y - b3 * a1), 0.25 * (x - b3 * a2), 0.25 * (s - b3 * a3),
    )  # fmt: skip


@kernel
def joint_blocks(model: Model, work: Work, h: float, q: Vector, v: Vector) -> None:
    """joint_block[i] = d(joint impulses)/d(nu), n x n row-major.

    I + h d + h^2 k/4 on the diagonal, and the springs of quaternion joints.
    """
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        B = work.joint_block[i]
        for k in range(n * n):
            B[k] = 0.0
        for k in range(n):
            B[k * n + k] = h * model.dof_damper[d + k] + model.dof_armature[d + k]
            if model.joint_nrot[i] < 3 or k < n - 3:
                B[k * n + k] += 0.25 * h * h * model.dof_spring[d + k]
        if model.joint_nrot[i] == 3 and model.dof_spring[d + n - 3] > 0.0:
            e = d + n - 3
            _, r2, r3 = spring_turns(model, work, h, q, v, i)
            P = turn_product(r2, r3)
            J = left_jacobian(-h * work.nu[e], -h * work.nu[e + 1], -h * work.nu[e + 2])  # right Jacobian
            g = h * h * model.dof_spring[e]
            for a in range(3):
                for b in range(3):
                    t = P[3 * a] * J[b] + P[3 * a + 1] * J[3 + b] + P[3 * a + 2] * J[6 + b]
                    B[(n - 3 + a) * n + n - 3 + b] += g * t


@kernel
def add_spring_derivatives(model: Model, work: Work, h: float, q: Vector, v: Vector) -> None:
    """dR_dq, dR_dv += springs; dR_dv in unit columns, to be multiplied by -h and -h J(h v)^T like all others.

    scalar        h k and h k/4 + I/h, I the armature
    quaternion    with M = c2 I - [s2], y = s1 + 2 s2 + s3 and ds = (c I + [s])/2 (right rotation) for each s,
                  d(M y) = M dy - (s2.e) y/2 + y x ds2; the turns R1, R3 carry a rotation e of q2 to configurations 1, 3
    """
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.joint_ntrans[i] if model.joint_nrot[i] == 3 else model.body_vadr[i + 1] - d
        for e in range(d, d + n):
            work.dR_dq[e, e] += h * model.dof_spring[e]
            work.dR_dv[e, e] += 0.25 * h * model.dof_spring[e] + model.dof_armature[e] / h
        if model.joint_nrot[i] == 3 and model.dof_spring[d + n] > 0.0:
            _quaternion_spring_derivatives(model, work, h, q, v, i, d + n)


@kernel
def _quaternion_spring_derivatives(model: Model, work: Work, h: float, q: Vector, v: Vector, i: int, e: int) -> None:
    """The quaternion part of `add_spring_derivatives`, rotational dofs e .. e + 2 of joint i."""
    r1, r2, r3 = spring_turns(model, work, h, q, v, i)
    g = h * model.dof_spring[e]
    y = (r1[1] + 2 * r2[1] + r3[1], r1[2] + 2 * r2[2] + r3[2], r1[3] + 2 * r2[3] + r3[3])
    c, s = r2[0], (r2[1], r2[2], r2[3])
    P1 = turn_product(r2, r1)
    P2 = turn_product(r2, r2)
    P3 = turn_product(r2, r3)
    e1 = quat_exp(-h * v[e], -h * v[e + 1], -h * v[e + 2])
    e3 = quat_exp(h * work.nu[e], h * work.nu[e + 1], h * work.nu[e + 2])
    R1 = quat_matrix(e1[0], e1[1], e1[2], e1[3])
    R3 = quat_matrix(e3[0], e3[1], e3[2], e3[3])
    Y = (0.0, -y[2], y[1], y[2], 0.0, -y[0], -y[1], y[0], 0.0)
    dot = y[0] * s[0] + y[1] * s[1] + y[2] * s[2]
    for a in range(3):
        for b in range(3):
            w = 0.0
            t = 2.0 * P2[3 * a + b] + 0.25 * (c * Y[3 * a + b] + s[a] * y[b] - y[a] * s[b])
            for k in range(3):
                w += P1[3 * a + k] * R1[3 * b + k]
                t += P3[3 * a + k] * R3[3 * b + k]
            if a == b:
                t -= 0.25 * dot
            work.dR_dq[e + a, e + b] += g * (t + w)
            work.dR_dv[e + a, e + b] += g * w


@kernel
def add_swing_curvature(model: Model, work: Work, q: Vector) -> None:
    """dR_dq += what changes in the test directions of joints with two rotations, beyond turning (swing.py)."""
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 2:
            a = model.body_qadr[i + 1] - 2
            call_late(model.late[_SWING_CURVATURE], model, work, i, q[a], q[a + 1])
