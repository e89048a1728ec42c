"""Rim of a cylinder a against a rim of b: the closest points of two circles, with derivatives.

A point of the rim of a is x = c + ra e, e = cos X + sin Y of its angle in the frame (c, X, Y) of that rim. The point of
the other rim that is nearest to it has the same angle as x, so only one angle is unknown (rim.py for the rest).
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

from sim.contact.collision.rim import NOTHING, SAMPLES, Frame, across, combined, put_column
from sim.contact.collision.witness import Z as UP
from sim.contact.collision.witness import along, axis, direction, dot, put
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3
from solvers.types import Vector

_STEPS = 30
_CONVERGED = 1e-15  # [rad]
_STRIDE = 0.3  # [rad]
_FLAT = 1e-3

Radii = tuple[float, float]  # of the rims of a and of b


@inner_kernel
def point_of(rim: Frame, radius: float, angle: float) -> tuple[Vec3, Vec3, Vec3]:
    """x, e and t of a rim of a."""
    e = combined(cos(angle), rim[1], sin(angle), rim[2])
    return along(rim[0], radius, e), e, combined(-sin(angle), rim[1], cos(angle), rim[2])


@inner_kernel
def opposite(x: Vec3, rho: float, z: float) -> tuple[Vec3, Vec3, Vec3, float]:
    """y, e and t of the point of the rim of b that is nearest to x, and the distance of x from the axis."""
    e, a = direction((x[0], x[1], 0.0), (0.0, 0.0, 0.0), UP)
    return (rho * e[0], rho * e[1], z), e, (-e[1], e[0], 0.0), a


@inner_kernel
def rim_slope(rim: Frame, radii: Radii, z: float, angle: float) -> tuple[float, float, float]:
    """Half the squared distance of the point at `angle` from the rim of b, and its two derivatives by the angle.

    f = w.w/2,   f' = ra w.t,   f'' = ra^2 (1 - rb/a (t.tb)^2) - ra w.e,   w = x - y,   a the distance from the axis
    """
    x, e, t = point_of(rim, radii[0], angle)
    y, _, tb, a = opposite(x, radii[1], z)
    w = (x[0] - y[0], x[1] - y[1], x[2] - y[2])
    c = dot(t, tb)
    bent = radii[1] * c * c / a if a > 0.0 else 0.0
    return 0.5 * dot(w, w), radii[0] * dot(w, t), radii[0] * (radii[0] * (1.0 - bent) - dot(w, e))


@inner_kernel
def rim_angle(rim: Frame, radii: Radii, z: float, angle: float) -> float:
    """The angle near to `angle` at which the rim of a is nearest to that of b."""
    for _ in range(_STEPS):
        _, g, c = rim_slope(rim, radii, z, angle)
        step = -g / max(c, _FLAT * radii[0] * radii[0])
        step = min(max(step, -_STRIDE), _STRIDE)
        angle += step
        if abs(step) < _CONVERGED:
            break
    return angle


@inner_kernel
def rim_minimum(k: int, rim: Frame, radii: Radii, z: float) -> float:
    """The k-th angle at which the rims are nearest to each other, of all around; NOTHING where there is none."""
    width = 2.0 * pi / SAMPLES
    before, here = rim_slope(rim, radii, z, -width)[0], rim_slope(rim, radii, z, 0.0)[0]
    for i in range(SAMPLES):
        after = rim_slope(rim, radii, z, (i + 1) * width)[0]
        if here < before and here <= after:
            if k == 0:
                angle = rim_angle(rim, radii, z, i * width) % (2.0 * pi)
                return angle if rim_slope(rim, radii, z, angle)[2] > _FLAT * radii[0] * radii[0] else NOTHING
            k -= 1
        before, here = here, after
    return NOTHING


@inner_kernel
def outwards(n: Vec3, ea: Vec3, eb: Vec3, up: Vec3) -> float:
    """How far n points out of b and into a, out along their radii and up, that of b less that of a."""
    return dot(n, eb) - dot(n, ea) + dot(n, up)


@inner_kernel
def rim_rim(rim: Frame, top: float, angle: float, radii: Radii, z: float, out: Vector) -> None:
    """Contact of the two rims, that of a on the side `top` (1, -1) of its axis; n along ta x tb, out of b and into a.

    With c = ta.tb, delta = v + w x x, the angles change by

    (ra - d n.ea) da - rb c db = -ta.delta - d n.(w x ta),      ra c da - (rb + d n.eb) db = -tb.delta

    dx = delta + ra ta da,   dy = rb tb db,   dn = (I - n n^T)((w x ta - ea da) x tb - ta x eb db)/|ta x tb|
    """
    angle = rim_angle(rim, radii, z, angle)
    x, ea, ta = point_of(rim, radii[0], angle)
    y, eb, tb, _ = opposite(x, radii[1], z)
    n = across(ta, tb)
    size = sqrt(dot(n, n))
    if outwards(n, ea, eb, along((0.0, 0.0, 1.0 if z > 0.0 else -1.0), -top, across(rim[1], rim[2]))) < 0.0:
        size = -size
    n = (n[0] / size, n[1] / size, n[2] / size)
    c, d = dot(ta, tb), dot(n, x) - dot(n, y)
    k0, k1, k2, k3 = radii[0] - d * dot(n, ea), -radii[1] * c, radii[0] * c, -radii[1] - d * dot(n, eb)
    det = k0 * k3 - k1 * k2
    put(d, n, combined(0.5, x, 0.5, y), out)
    for k in range(6):
        turn = k > 2
        delta = across(axis(k - 3, 1.0), x) if turn else axis(k, 1.0)
        q = across(axis(k - 3, 1.0), ta) if turn else (0.0, 0.0, 0.0)
        f, g = -dot(ta, delta) - d * dot(n, q), -dot(tb, delta)
        da, db = (k3 * f - k1 * g) / det, (k0 * g - k2 * f) / det
        dn = along(across(along(q, -da, ea), tb), -db, across(ta, eb))
        dn = along(dn, -dot(n, dn), n)
        dn = (dn[0] / size, dn[1] / size, dn[2] / size)
        dx = along(delta, radii[0] * da, ta)
        put_column(k, dn, combined(0.5, dx, 0.5 * radii[1] * db, tb), out)
