"""Springs of quaternion joints, see joint_forces.py; compiled by scenes with such a spring only.

With s the vector part of the rotation from rest, V_d = (h/2) k |(s(2) + s(3))/2|^2.
"""

from __future__ import annotations

from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Mat3, Quat, cross, left_jacobian, quat_exp, quat_matrix, quat_mul
from solvers.types import Vector


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
def spring_turns(model: Model, data: Data, h: float, q: Vector, v: Vector, i: int) -> tuple[Quat, Quat, Quat]:
    """Rotation from rest of quaternion joint i at configurations 1, 2, 3; continuous, so no sign flips between them."""
    d = model.body_vadr[i] + model.joint_ntrans[i]
    r2 = relative_to_rest(model, i, q)
    e1 = quat_exp(-h * v[d], -h * v[d + 1], -h * v[d + 2])
    e3 = quat_exp(h * data.nu[d], h * data.nu[d + 1], h * data.nu[d + 2])
    r1 = quat_mul(r2[0], r2[1], r2[2], r2[3], e1[0], e1[1], e1[2], e1[3])
    r3 = quat_mul(r2[0], r2[1], r2[2], r2[3], e3[0], e3[1], e3[2], e3[3])
    return r1, r2, r3


@optional(Slot.SPRING_IMPULSE, default=(0.0, 0.0, 0.0))
def spring_impulse(model: Model, data: Data, h: float, q: Vector, v: Vector, i: int) -> tuple[float, float, float]:
    """(h k/2) (c2 I - [s2]) (s1 + 2 s2 + s3), s the vector parts of the rotations from rest."""
    r1, r2, r3 = spring_turns(model, data, h, q, v, i)
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


@optional(Slot.ADD_SPRING_BLOCK)
def add_spring_block(model: Model, data: Data, h: float, q: Vector, v: Vector, i: int) -> None:
    """joint_block[i] += d(spring impulse)/d(nu)."""
    d = model.body_vadr[i]
    n = model.body_vadr[i + 1] - d
    B = data.joint_block[i]
    e = d + n - 3
    _, r2, r3 = spring_turns(model, data, h, q, v, i)
    P = turn_product(r2, r3)
    J = left_jacobian(-h * data.nu[e], -h * data.nu[e + 1], -h * data.nu[e + 2])  # right Jacobian
    g = h * h * model.dof_spring[e]
    for a in range(3):
        for b in range(3):
            t = P[3 * a] * J[b] + P[3 * a + 1] * J[3 + b] + P[3 * a + 2] * J[6 + b]
            B[(n - 3 + a) * n + n - 3 + b] += g * t


@optional(Slot.ADD_BALL_SPRING_DERIVATIVES)
def add_ball_spring_derivatives(model: Model, data: Data, h: float, q: Vector, v: Vector, i: int) -> None:
    """The quaternion part of `add_spring_derivatives`, of joint i."""
    e = model.body_vadr[i] + model.joint_ntrans[i]
    r1, r2, r3 = spring_turns(model, data, h, q, v, i)
    g = h * model.dof_spring[e]
    y = (r1[1] + 2 * r2[1] + r3[1], r1[2] + 2 * r2[2] + r3[2], r1[3] + 2 * r2[3] + r3[3])
    c, s = r2[0], (r2[1], r2[2], r2[3])
    P1 = turn_product(r2, r1)
    P2 = turn_product(r2, r2)
    P3 = turn_product(r2, r3)
    e1 = quat_exp(-h * v[e], -h * v[e + 1], -h * v[e + 2])
    e3 = quat_exp(h * data.nu[e], h * data.nu[e + 1], h * data.nu[e + 2])
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
            data.dR_dq[e + a, e + b] += g * (t + w)
            data.dR_dv[e + a, e + b] += g * w
