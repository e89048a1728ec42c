"""Sphere, capsule, box and cylinder against the half-space z <= 0 of b."""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.box import corner, to_b
from sim.contact.collision.witness import FACE, NOWHERE, Z, absent, along, axis, moment, put, put_rows, vertex_a
from sim.model.record_columns import PairSize
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Vector

_LEVEL = 1e-4  # sine of the tilt below which the lowest point of a rim leaves the rim for its centre
_STEEP = 0.5  # cosine of the tilt beyond which the fixed points of the rims are omitted
_COS120, _SIN120 = -0.5, 0.75**0.5


@inner_kernel
def point_plane(x: Vec3, radius: float, out: Vector) -> None:
    """phi = x_z - radius"""
    vertex_a(x, Z, NOWHERE, x[2], (radius, 0.0), NOWHERE, FACE, out)


@inner_kernel
def sphere_halfspace(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = r_z - radius"""
    point_plane((r[0], r[1], r[2]), sizes[0], out)


@inner_kernel
def capsule_halfspace(feature: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Ends - and + of the segment."""
    half = sizes[1] if feature == 1 else -sizes[1]
    point_plane(along((r[0], r[1], r[2]), half, (R[2], R[5], R[8])), sizes[0], out)


@inner_kernel
def box_halfspace(feature: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Corners; the bits of `feature` are the signs of x, y, z."""
    x = to_b(R, corner(feature, three(sizes, PairSize.A)))
    point_plane((r[0] + x[0], r[1] + x[1], r[2] + x[2]), 0.0, out)


@inner_kernel
def cylinder_halfspace(feature: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Lowest points of the rims - and + (0, 1); points at 0, 120, 240 degrees on the rim - (2, 3, 4) and + (5, 6, 7).

    A wheel rolls on the lowest points. A standing cylinder has no lowest point: it stands on the fixed ones, which are
    absent where the axis is more than 60 degrees from the vertical.
    """
    if feature < 2:
        lowest(sizes[1] if feature == 1 else -sizes[1], sizes[0], R, r, out)
        return
    if abs(R[8]) < _STEEP:
        absent(out)
        return
    k = (feature - 2) % 3
    c, s = 1.0, 0.0
    if k > 0:
        c, s = _COS120, (_SIN120 if k == 1 else -_SIN120)
    half = sizes[1] if feature > 4 else -sizes[1]
    x = to_b(R, (sizes[0] * c, sizes[0] * s, half))
    point_plane((r[0] + x[0], r[1] + x[1], r[2] + x[2]), 0.0, out)


@inner_kernel
def lowest(half: float, radius: float, R: Vector, r: Vector, out: Vector) -> None:
    """Lowest point of the rim around c = r + half u, u the axis of a: with g = |u_xy|, sigma^2 = g^2 + eps^2

    phi = c_z - radius (sigma - eps),   p_xy = c_xy + radius u_z u_xy/sigma

    which is the height of the rim to radius eps, and has derivatives also where the axis is vertical.
    """
    u = (R[2], R[5], R[8])
    c = along((r[0], r[1], r[2]), half, u)
    sigma = sqrt(u[0] * u[0] + u[1] * u[1] + _LEVEL * _LEVEL)
    phi = c[2] - radius * (sigma - _LEVEL)
    k = radius * u[2] / sigma
    put(phi, Z, (c[0] + k * u[0], c[1] + k * u[1], 0.5 * phi), out)
    # dk = radius (1/sigma + u_z^2/sigma^3) du_z,   du_z = (u x z).w;   p_z = phi/2
    turn = moment(u, Z)
    rate = radius * (1.0 + u[2] * u[2] / (sigma * sigma)) / sigma
    for i in range(3):
        s = 0.5 if i == 2 else 1.0
        e = axis(i, s)
        Gw = along(moment(c, e), k, moment(u, e))
        put_rows(i, NOWHERE, NOWHERE, e, along(Gw, 0.0 if i == 2 else rate * u[i], turn), out)
