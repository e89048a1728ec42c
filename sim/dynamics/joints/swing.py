"""Joints with two rotations, Dojo's orbital ones: the child turns about any direction across the axis, never about it.

    rotation       exp(t),  t = p1 V1 + p2 V2,   V1, V2 across the axis     so the quaternion has no part along the axis
    coordinates    p, two plain numbers [rad]: a step adds h v to them, springs, dampers, limits and inputs act on them
    columns        d(rotation)/d(p_k) = J(t)^T V_k in the child's axes, J the left Jacobian of exp

The coordinates are regular for |p| < 2 pi. This is not a universal joint, which is two hinges one after the other and
turns its child about the axis by an amount of second order.

Scenes without such joints do not compile these kernels.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import (
    Quat,
    Vec3,
    cross,
    half_angle,
    left_jacobian,
    quat_exp,
    rotate,
    so3_coefficients,
    transposed_times,
)
from solvers.types import Vector

_STILL = ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
_SMALL = 0.1  # below this square of the half angle, its series are exact to rounding


@kernel
def swing(model: Model, i: int, p1: float, p2: float) -> Vec3:
    """t = p1 V1 + p2 V2"""
    V = model.joint_swing_axes[i]
    return p1 * V[0] + p2 * V[3], p1 * V[1] + p2 * V[4], p1 * V[2] + p2 * V[5]


@optional(Slot.SWING_POSE, default=_STILL)
def swing_pose(model: Model, i: int, p1: float, p2: float) -> tuple[Quat, Vec3, Vec3]:
    """Quaternion of exp(t) and columns J(t)^T V_k = J(-t) V_k in the child's axes, of joint i at p."""
    t = swing(model, i, p1, p2)
    J = left_jacobian(-t[0], -t[1], -t[2])
    V = model.joint_swing_axes[i]
    x, y, z = V[0], V[1], V[2]
    first = J[0] * x + J[1] * y + J[2] * z, J[3] * x + J[4] * y + J[5] * z, J[6] * x + J[7] * y + J[8] * z
    x, y, z = V[3], V[4], V[5]
    second = J[0] * x + J[1] * y + J[2] * z, J[3] * x + J[4] * y + J[5] * z, J[6] * x + J[7] * y + J[8] * z
    return quat_exp(t[0], t[1], t[2]), first, second


@kernel
def half_angle_change(a: float, b: float, x: float) -> tuple[float, float]:
    """Change of (cos a, sin(a)/(2 a)) to half the angle b, x = b^2 - a^2: without the rounding of a difference."""
    s = a + b
    if not s > 0.0:
        return 0.0, 0.0
    d = x / s
    w = -2.0 * sin(0.5 * s) * sin(0.5 * d)
    if s * s < _SMALL:
        y, z = a * a, b * b
        m2 = y * y + y * z + z * z
        m3 = (y + z) * (y * y + z * z)
        m4 = y * y * m2 + z * z * z * (y + z)
        return w, 0.5 * x * (-1 / 6 + (y + z) / 120 - m2 / 5040 + m3 / 362880 - m4 / 39916800)
    small, large = min(a, b), max(a, b)
    return w, 0.5 * (2.0 * cos(0.5 * s) * sin(0.5 * d) - 2.0 * half_angle(4.0 * small * small)[1] * d) / large


@optional(Slot.SWING_TURN, default=_STILL[0])
def swing_turn(model: Model, i: int, p1: float, p2: float, d1: float, d2: float) -> Quat:
    """exp(t)^* exp(t + d) of joint i at p, whose increment is d: in the child's axes, rounded to eps |d|.

    With exp(t) = (w, k t) and the changes dw, dk of w and k, and e = k d + dk (t + d) that of k t:
    (w (w + dw) + k t.(k t + e),  w e - dw k t - k t x e)
    """
    t = swing(model, i, p1, p2)
    d = swing(model, i, d1, d2)
    u = (t[0] + d[0], t[1] + d[1], t[2] + d[2])
    t2 = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
    u2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    x = d[0] * (t[0] + u[0]) + d[1] * (t[1] + u[1]) + d[2] * (t[2] + u[2])
    w, k = half_angle(t2)
    dw, dk = half_angle_change(0.5 * sqrt(t2), 0.5 * sqrt(u2), 0.25 * x)
    r = (k * t[0], k * t[1], k * t[2])
    e = (k * d[0] + dk * u[0], k * d[1] + dk * u[1], k * d[2] + dk * u[2])
    c = cross(r[0], r[1], r[2], e[0], e[1], e[2])
    s = r[0] * (r[0] + e[0]) + r[1] * (r[1] + e[1]) + r[2] * (r[2] + e[2])
    return w * (w + dw) + s, w * e[0] - dw * r[0] - c[0], w * e[1] - dw * r[1] - c[1], w * e[2] - dw * r[2] - c[2]


@kernel
def column_derivative(t: Vec3, x: Vector, y: Vector) -> Vec3:
    """d(J(t)^T x)/dt along y, with J^T x = a x - b t x x + c t (t.x) and a, b, c functions of s = |t|^2:

    2 (t.y) (a' x - b' t x x + c' t (t.x)) - b y x x + c (y (t.x) + t (x.y))
    a' = (cos|t| - a)/(2 s),   b' = (a - 2 b)/(2 s),   c' = (b - 3 c)/(2 s)
    """
    s = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
    a, b, c = so3_coefficients(s)
    if s < 1e-2:
        da = -1 / 6 * (1 - s / 10 * (1 - s / 28 * (1 - s / 54)))
        db = -1 / 24 * (1 - s / 15 * (1 - s / 37.33333333333333 * (1 - s / 67.5)))
        dc = -1 / 120 * (1 - s / 21 * (1 - s / 48 * (1 - s / 82.5)))
    else:
        da = 0.5 * (cos(sqrt(s)) - a) / s
        db = 0.5 * (a - 2.0 * b) / s
        dc = 0.5 * (b - 3.0 * c) / s
    tx = t[0] * x[0] + t[1] * x[1] + t[2] * x[2]
    ty = 2.0 * (t[0] * y[0] + t[1] * y[1] + t[2] * y[2])
    xy = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
    u = cross(t[0], t[1], t[2], x[0], x[1], x[2])
    w = cross(y[0], y[1], y[2], x[0], x[1], x[2])
    k = ty * dc * tx + c * xy
    return (
        ty * (da * x[0] - db * u[0]) - b * w[0] + c * y[0] * tx + k * t[0],
        ty * (da * x[1] - db * u[1]) - b * w[1] + c * y[1] * tx + k * t[1],
        ty * (da * x[2] - db * u[2]) - b * w[2] + c * y[2] * tx + k * t[2],
    )


@optional(Slot.SWING_CURVATURE)
def swing_curvature(model: Model, data: Data, i: int, p1: float, p2: float) -> None:
    """dR_dq += m . d(column j)/d(p_k) of joint i at p, m the residual moment on the subtree about the joint.

    All in the child's axes, in which a test direction changes; that it turns with its joint, `residual_derivatives`
    knows.
    """
    c = model.joint_child_point[i]
    x, y, z = rotate(data.rot2, i, c[0], c[1], c[2])
    x, y, z = (
        x + data.pos2[i, 0] - data.origin[0],
        y + data.pos2[i, 1] - data.origin[1],
        z + data.pos2[i, 2] - data.origin[2],
    )
    f = data.subtree[i]
    x, y, z = cross(x, y, z, f[0], f[1], f[2])
    x, y, z = f[3] - x, f[4] - y, f[5] - z
    m0, m1, m2 = transposed_times(data.rot2[i], x, y, z)
    d = model.body_vadr[i + 1] - 2
    t = swing(model, i, p1, p2)
    V = model.joint_swing_axes[i]
    for j in range(2):
        for k in range(2):
            g = column_derivative(t, V[3 * j : 3 * j + 3], V[3 * k : 3 * k + 3])
            data.dR_dq[d + j, d + k] += g[0] * m0 + g[1] * m1 + g[2] * m2
