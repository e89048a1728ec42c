"""Quaternions (w, x, y, z; Hamilton; body to world) and rotation vectors, as scalars in and tuples out.

Tuples of scalars stay in registers: 3 ns for a product, where an array would cost an allocation.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from solvers.compiler import kernel
from solvers.dense import Matrix, Vector

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
Mat3 = tuple[float, float, float, float, float, float, float, float, float]

_SERIES = 1e-2  # below this squared angle the Taylor series is exact to rounding


@kernel
def cross(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> Vec3:
    """a x b"""
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


@kernel
def three(a: Vector, k: int) -> Vec3:
    """Entries k, k + 1 and k + 2 of a row."""
    return a[k], a[k + 1], a[k + 2]


@kernel
def put_three(v: Vec3, k: int, out: Vector) -> None:
    """Entries k, k + 1 and k + 2 of a row = v."""
    out[k], out[k + 1], out[k + 2] = v


@kernel
def rotate(R: Matrix, i: int, x: float, y: float, z: float) -> Vec3:
    """R[i] (x, y, z); R: (n, 9), row-major 3 x 3 matrices."""
    return (
        R[i, 0] * x + R[i, 1] * y + R[i, 2] * z,
        R[i, 3] * x + R[i, 4] * y + R[i, 5] * z,
        R[i, 6] * x + R[i, 7] * y + R[i, 8] * z,
    )


@kernel
def quat_mul(a0: float, a1: float, a2: float, a3: float, b0: float, b1: float, b2: float, b3: float) -> Quat:
    """Hamilton product a b."""
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


@kernel
def quat_turn(a0: float, a1: float, a2: float, a3: float, b0: float, b1: float, b2: float, b3: float) -> Quat:
    """b a^*, the rotation from a to b in world axes, with nonnegative scalar part."""
    w = b0 * a0 + b1 * a1 + b2 * a2 + b3 * a3
    x = -b0 * a1 + b1 * a0 - b2 * a3 + b3 * a2
    y = -b0 * a2 + b1 * a3 + b2 * a0 - b3 * a1
    z = -b0 * a3 - b1 * a2 + b2 * a1 + b3 * a0
    if w < 0.0:
        return -w, -x, -y, -z
    return w, x, y, z


@kernel
def quat_matrix(w: float, x: float, y: float, z: float) -> Mat3:
    """Rotation matrix R(q), row-major."""
    return (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )


@kernel
def half_angle(t2: float) -> tuple[float, float]:
    """(cos t/2, sin(t/2)/t) at the squared angle t2."""
    if t2 < _SERIES:
        u = 0.25 * t2
        w = 1.0 - u * (1 / 2 - u * (1 / 24 - u * (1 / 720 - u * (1 / 40320))))
        return w, 1 / 2 - u * (1 / 12 - u * (1 / 240 - u * (1 / 10080 - u * (1 / 725760))))
    t = sqrt(t2)
    return cos(0.5 * t), sin(0.5 * t) / t


@kernel
def quat_exp(x: float, y: float, z: float) -> Quat:
    """Quaternion of the rotation vector (x, y, z): (cos |t|/2, sin(|t|/2)/|t| t)."""
    w, k = half_angle(x * x + y * y + z * z)
    return w, k * x, k * y, k * z


@kernel
def quat_log(w: float, x: float, y: float, z: float) -> Vec3:
    """Rotation vector of a unit quaternion, of angle in [0, pi]; (q and -q give the same)."""
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    n2 = x * x + y * y + z * z
    n = sqrt(n2)
    # 2 atan2(n, w) / n; below the threshold its series in (n / w)
    k = 2.0 * atan2(n, w) / n if n2 > 1e-12 else 2.0 / w * (1.0 - n2 / (3.0 * w * w))
    return k * x, k * y, k * z


@kernel
def so3_coefficients(t2: float) -> Vec3:
    """(sin t / t, (1 - cos t) / t^2, (t - sin t) / t^3) at the squared angle t2."""
    if t2 < _SERIES:
        a = 1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72)))
        b = 0.5 * (1 - t2 / 12 * (1 - t2 / 30 * (1 - t2 / 56 * (1 - t2 / 90))))
        c = 1 / 6 * (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72 * (1 - t2 / 110))))
        return a, b, c
    t = sqrt(t2)
    a = sin(t) / t
    return a, (1 - cos(t)) / t2, (1 - a) / t2


@kernel
def left_jacobian(x: float, y: float, z: float) -> Mat3:
    """J(t) = sin t/t I + (1 - cos t)/t^2 [t] + (t - sin t)/t^3 t t^T, the left Jacobian of exp.

    exp(t + d) = exp(J d) exp(t).

    Its transpose is the right Jacobian: exp(t + d) = exp(t) exp(J^T d).   Chirikjian, Stochastic Models 2, eq. 10.86.
    """
    a, b, c = so3_coefficients(x * x + y * y + z * z)
    return (
        a + c * x * x,
        c * x * y - b * z,
        c * x * z + b * y,
        c * x * y + b * z,
        a + c * y * y,
        c * y * z - b * x,
        c * x * z - b * y,
        c * y * z + b * x,
        a + c * z * z,
    )


@kernel
def inverse_right_jacobian(x: float, y: float, z: float) -> Mat3:
    """(J^T)^-1 = I + [t]/2 + e [t]^2,  e = (1 - a/(2 b)) / t^2 with a = sin t / t, b = (1 - cos t) / t^2."""
    t2 = x * x + y * y + z * z
    if t2 < _SERIES:
        e = 1 / 12 * (1 + t2 / 60 * (1 + t2 / 42 * (1 + t2 / 40)))
    else:
        a, b, _ = so3_coefficients(t2)
        e = (1 - 0.5 * a / b) / t2
    return (
        1 - e * (y * y + z * z),
        e * x * y - 0.5 * z,
        e * x * z + 0.5 * y,
        e * x * y + 0.5 * z,
        1 - e * (x * x + z * z),
        e * y * z - 0.5 * x,
        e * x * z - 0.5 * y,
        e * y * z + 0.5 * x,
        1 - e * (x * x + y * y),
    )


@kernel
def times(M: Mat3 | Vector, x: float, y: float, z: float) -> Vec3:
    """M (x, y, z)"""
    return (
        M[0] * x + M[1] * y + M[2] * z,
        M[3] * x + M[4] * y + M[5] * z,
        M[6] * x + M[7] * y + M[8] * z,
    )


@kernel
def transposed_times(M: Mat3 | Vector, x: float, y: float, z: float) -> Vec3:
    """M^T (x, y, z): with the rows of M for a frame, x times the first one, + y the second, + z the third."""
    return (
        M[0] * x + M[3] * y + M[6] * z,
        M[1] * x + M[4] * y + M[7] * z,
        M[2] * x + M[5] * y + M[8] * z,
    )


@kernel
def rows_of(R: Matrix, i: int) -> Mat3:
    """R[i] as a tuple."""
    return R[i, 0], R[i, 1], R[i, 2], R[i, 3], R[i, 4], R[i, 5], R[i, 6], R[i, 7], R[i, 8]


@kernel
def join(out: Vector, v: Vec3, w: Vec3) -> None:
    """out (6) = (v, w), a twist or a wrench."""
    for k in range(3):
        out[k] = v[k]
        out[3 + k] = w[k]
