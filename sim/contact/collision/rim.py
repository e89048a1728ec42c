"""Rims of a cylinder b along z against a plane, a line and a rim of a: points of contact, with derivatives.

A point of a rim is y = rho e + z Z, e = (cos, sin, 0) of its angle, t = (-sin, cos, 0) along the rim. Where a line or
another rim touches it, the vector between the closest points is across both, d n = x - y with n across t and the other
tangent: the equations of the two points hold whether they are apart, touch, or overlap.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

from sim.contact.collision.box import to_a
from sim.contact.collision.witness import along, axis, dot, put
from sim.model.record_columns import Witness
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, cross
from solvers.types import Vector

SECTORS = 256  # angles on a rim from which the closest points are looked for
SAMPLES = 16
NOTHING = -1.0  # no such angle
LEVEL = 1e-4  # sine of the tilt of a plane below which the point nearest to it leaves the rim for its centre
STEEP = 0.5  # cosine of the tilt beyond which a cylinder does not stand on the fixed points of its rims
_COS120, _SIN120 = -0.5, 0.75**0.5
_STEPS = 30  # of Newton's method
_CONVERGED = 1e-15  # [rad]
_STRIDE = 0.3  # [rad]
_FLAT = 1e-3  # curvature of the squared distance over angle, relative to rho^2, below which it has no minimum

Frame = tuple[Vec3, Vec3, Vec3]  # of a rim: its centre, and two axes that span its plane


@inner_kernel
def combined(a: float, x: Vec3, b: float, y: Vec3) -> Vec3:
    """a x + b y"""
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@inner_kernel
def across(x: Vec3, y: Vec3) -> Vec3:
    """x x y"""
    return cross(x[0], x[1], x[2], y[0], y[1], y[2])


@inner_kernel
def put_column(k: int, dn: Vec3, dp: Vec3, out: Vector) -> None:
    """Column k of dn/d(v, w) and dp/d(v, w)."""
    for i in range(3):
        out[Witness.NORMAL_RATE + 6 * i + k] = dn[i]
        out[Witness.POINT_RATE + 6 * i + k] = dp[i]


@inner_kernel
def angle_of(sector: int) -> float:
    """Middle of a sector [rad]."""
    return (sector + 0.5) * 2.0 * pi / SECTORS


@inner_kernel
def sector_of(angle: float) -> int:
    """The sector that an angle is in."""
    turns = angle / (2.0 * pi)
    return int((turns - float(int(turns)) + 1.0) * SECTORS) % SECTORS


# -- a plane -----------------------------------------------------------------------------------------------------------


@inner_kernel
def point_towards(which: int, n: Vec3, rho: float, half: float) -> Vec3:
    """Point of a rim: 0, 1 the farthest along n on rim -, +; 2-4, 5-7 those at 0, 120, 240 degrees.

    y = (rho/sigma n_xy, +-half),   sigma^2 = n_x^2 + n_y^2 + eps^2: smooth also where n is along the axis.
    """
    if which < 2:
        k = rho / sqrt(n[0] * n[0] + n[1] * n[1] + LEVEL * LEVEL)
        return k * n[0], k * n[1], (half if which == 1 else -half)
    k = (which - 2) % 3
    c, s = 1.0, 0.0
    if k > 0:
        c, s = _COS120, (_SIN120 if k == 1 else -_SIN120)
    return rho * c, rho * s, (half if which > 4 else -half)


@inner_kernel
def plane_gap(which: int, n: Vec3, s: float, rho: float, half: float) -> float:
    """Distance of that point from the plane n.x = s of a: s - rho (sigma - eps) -+ half n_z of a farthest point."""
    if which < 2:
        sigma = sqrt(n[0] * n[0] + n[1] * n[1] + LEVEL * LEVEL)
        return s - rho * (sigma - LEVEL) - (half if which == 1 else -half) * n[2]
    return s - dot(n, point_towards(which, n, rho, half))


@inner_kernel
def rim_below(
    which: int, plane: tuple[Vec3, float], size: tuple[float, float], deepest: float, R: Vector, r: Vector
) -> tuple[bool, Vec3]:
    """Whether point `which` of the rims of b, of radius and half length `size`, may touch a plane (n, s) of a: no
    deeper than the shapes are, no fixed point of a cylinder that does not stand; and where it is in the frame of a.
    """
    n, s = plane
    y = point_towards(which, n, size[0], size[1])
    x = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
    if which > 1 and abs(n[2]) < STEEP:
        return False, x
    return not plane_gap(which, n, s, size[0], size[1]) < deepest, x


@inner_kernel
def plane_rim(which: int, n: Vec3, s: float, rho: float, half: float, out: Vector) -> None:
    """Contact of that point with the plane of a.

    dn = w x n,   p = y + phi n/2,   dp = dy + (n dphi + phi dn)/2,   dy = rho (dn_xy - n_xy (n_xy.dn_xy)/sigma^2)/sigma
    """
    y = point_towards(which, n, rho, half)
    phi = plane_gap(which, n, s, rho, half)
    p = along(y, 0.5 * phi, n)
    put(phi, n, p, out)
    m = across(p, n)
    s2 = n[0] * n[0] + n[1] * n[1] + LEVEL * LEVEL
    k = rho / sqrt(s2) if which < 2 else 0.0
    for c in range(6):
        dphi = n[c] if c < 3 else m[c - 3]
        dn = across(axis(c - 3, 1.0), n) if c > 2 else (0.0, 0.0, 0.0)
        f = (n[0] * dn[0] + n[1] * dn[1]) / s2
        dy = (k * (dn[0] - f * n[0]), k * (dn[1] - f * n[1]), 0.0)
        put_column(c, dn, along(along(dy, 0.5 * dphi, n), 0.5 * phi, dn), out)


# -- a line ------------------------------------------------------------------------------------------------------------


@inner_kernel
def line_slope(x: Vec3, u: Vec3, rho: float, z: float, angle: float) -> tuple[float, float, float]:
    """Half the squared distance of the point at `angle` from the line x + s u, and its two derivatives by the angle.

    f = w.w/2,   f' = -rho w.t,   f'' = rho^2 (1 - (u.t)^2) + rho w.e,   w = (I - u u^T)(x - y)
    """
    e, t = (cos(angle), sin(angle), 0.0), (-sin(angle), cos(angle), 0.0)
    w = (x[0] - rho * e[0], x[1] - rho * e[1], x[2] - z)
    w = along(w, -dot(w, u), u)
    c = dot(u, t)
    return 0.5 * dot(w, w), -rho * dot(w, t), rho * rho * (1.0 - c * c) + rho * dot(w, e)


@inner_kernel
def line_angle(x: Vec3, u: Vec3, rho: float, z: float, angle: float) -> float:
    """The angle near to `angle` at which the rim is nearest to a line."""
    for _ in range(_STEPS):
        _, g, c = line_slope(x, u, rho, z, angle)
        step = -g / max(c, _FLAT * rho * rho)
        step = min(max(step, -_STRIDE), _STRIDE)
        angle += step
        if abs(step) < _CONVERGED:
            break
    return angle


@inner_kernel
def line_minimum(k: int, x: Vec3, u: Vec3, rho: float, z: float) -> float:
    """The k-th angle (0, 1) at which a rim is nearest to a line, nearer than around it; NOTHING where there is none."""
    width = 2.0 * pi / SAMPLES
    before, here = line_slope(x, u, rho, z, -width)[0], line_slope(x, u, rho, z, 0.0)[0]
    for i in range(SAMPLES):
        after = line_slope(x, u, rho, z, (i + 1) * width)[0]
        if here < before and here <= after:
            if k == 0:
                angle = line_angle(x, u, rho, z, i * width) % (2.0 * pi)
                return angle if line_slope(x, u, rho, z, angle)[2] > _FLAT * rho * rho else NOTHING
            k -= 1
        before, here = here, after
    return NOTHING


@inner_kernel
def line_rim(x: Vec3, u: Vec3, angle: float, rho: float, z: float, radius: float, out: Vector) -> None:
    """Line x + s u of a, with a radius around it, against the rim at height z; n along u x t, out of the cylinder.

    With c = u.t, delta = v + w x x, q = w x u, and x from here on the closest point of the line:

    (rho (1 - c^2) + d n.e) dangle = t.delta - c (u.delta + d n.q)
    dx = delta + (rho c dangle - u.delta - d n.q) u,   dy = rho t dangle
    dn = (I - n n^T)(q x t - u x e dangle)/|u x t|
    """
    angle = line_angle(x, u, rho, z, angle)
    e, t = (cos(angle), sin(angle), 0.0), (-sin(angle), cos(angle), 0.0)
    y = (rho * e[0], rho * e[1], z)
    x = along(x, dot(u, y) - dot(u, x), u)
    n = across(u, t)
    size = sqrt(dot(n, n))
    if dot(n, e) + (n[2] if z > 0.0 else -n[2]) < 0.0:
        size = -size
    n = (n[0] / size, n[1] / size, n[2] / size)
    c, d = dot(u, t), dot(n, x) - dot(n, y)
    rate = rho * (1.0 - c * c) + d * dot(n, e)
    p = combined(0.5, along(x, -radius, n), 0.5, y)
    put(d - radius, n, p, out)
    for k in range(6):
        turn = k > 2
        delta = across(axis(k - 3, 1.0), x) if turn else axis(k, 1.0)
        q = across(axis(k - 3, 1.0), u) if turn else (0.0, 0.0, 0.0)
        slide = dot(u, delta) + d * dot(n, q)
        da = (dot(t, delta) - c * slide) / rate
        dx = along(delta, rho * c * da - slide, u)
        dn = along(across(q, t), -da, across(u, e))
        dn = along(dn, -dot(n, dn), n)
        dn = (dn[0] / size, dn[1] / size, dn[2] / size)
        put_column(k, dn, along(combined(0.5, dx, 0.5 * rho * da, t), -0.5 * radius, dn), out)
