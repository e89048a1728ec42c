"""Capsule against capsule: two segments with a radius around each.

    feature 0, 1    end -, + of a beside b, or the end of b beside a where that is the nearer end of the overlap
    feature 2       the closest points, where they are other ones: a crossing, an end beside the middle

The least of the three is the distance of the capsules. Parallel capsules touch at both ends of the overlap, and the
third is absent: one of two parallel lines has no closest point.

A pair of points is named by (s, t): s = -1, 0, 1 is the - end, the inside, the + end of a; t the same of b.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.witness import (
    LINE,
    NOWHERE,
    TIE,
    Z,
    along,
    bend_line,
    bend_point,
    direction,
    dot,
    edges,
    vertex_a,
    vertex_b,
)
from sim.model.record_columns import PairSize
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3
from solvers.types import Vector

Vec2 = tuple[float, float]

_PARALLEL = 1e-6  # squared sine of the angle below which two segments are parallel


@inner_kernel
def choose_points(feature: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """The pair of points (s, t) that is contact point `feature` of two capsules, both along z; 0 for none.

    1 + 3 (s + 1) + (t + 1), and 16 where the normal of a crossing is along ub x ua.
    """
    c, u = (r[0], r[1], r[2]), (R[2], R[5], R[8])
    la, lb = sizes[1], sizes[PairSize.B + 1]
    low, high = beside(-1.0, c, u, la, lb), beside(1.0, c, u, la, lb)
    code = high
    if feature == 0:
        code = low
        if low == high:
            return 0
    if feature == 2:
        s2 = 1.0 - u[2] * u[2]
        if s2 < _PARALLEL:
            return 0
        code = closest(c, u, la, lb)
        if code == low or code == high:
            return 0
    return 5 + 3 * int(code[0]) + int(code[1]) + (16 if u[1] * c[0] - u[0] * c[1] >= 0.0 else 0)


@inner_kernel
def beside(e: float, c: Vec3, u: Vec3, la: float, lb: float) -> Vec2:
    """(s, t) at end e of segment a: this end beside b, or the end of b on this side beside a."""
    b = e if u[2] >= 0.0 else -e
    z = b * (c[2] + e * la * u[2])
    if z < -lb * (1.0 + TIE):
        return e, -b
    if z <= lb * (1.0 + TIE):
        return e, 0.0
    s = dot(u, (-c[0], -c[1], b * lb - c[2]))
    if abs(s) <= la * (1.0 + TIE):
        return 0.0, b
    return (1.0 if s > 0.0 else -1.0), b


@inner_kernel
def closest(c: Vec3, u: Vec3, la: float, lb: float) -> Vec2:
    """(s, t) of the closest points of two segments that are not parallel.   Ericson 2005, section 5.1.9."""
    cu = dot(c, u)
    s = min(max((u[2] * c[2] - cu) / (1.0 - u[2] * u[2]), -la), la)
    t = c[2] + s * u[2]
    if abs(t) > lb:
        t = lb if t > 0.0 else -lb
        s = min(max(t * u[2] - cu, -la), la)
    return sign_at(s, la), sign_at(t, lb)


@inner_kernel
def sign_at(s: float, half: float) -> float:
    """-1, 0, 1 for a point at the - end, inside, at the + end of |s| <= half."""
    if abs(s) < half:
        return 0.0
    return 1.0 if s > 0.0 else -1.0


@inner_kernel
def put_points(code: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Contact of the points of `choose_points`, which are not 0."""
    c, u = (r[0], r[1], r[2]), (R[2], R[5], R[8])
    half, radii = (sizes[1], sizes[PairSize.B + 1]), (sizes[0], sizes[PairSize.B])
    s, t = float((code - 1 & 15) // 3 - 1), float((code - 1 & 15) % 3 - 1)
    if s == 0.0 and t == 0.0:
        k = sqrt(1.0 - u[2] * u[2])
        k = k if code & 16 else -k
        n = (u[1] / k, -u[0] / k, 0.0)
        edges(c, u, NOWHERE, Z, n, radii, out)
    elif s == 0.0:
        y = (0.0, 0.0, t * half[1])
        x = along(c, dot(u, (-c[0], -c[1], y[2] - c[2])), u)
        n, d = direction(x, y, u)
        vertex_b(y, n, u, d, radii, bend_line(d), LINE, out)
    else:
        x = along(c, s * half[0], u)
        if t == 0.0:
            n, d = direction(x, (0.0, 0.0, x[2]), Z)
            vertex_a(x, n, Z, d, radii, bend_line(d), LINE, out)
        else:
            n, d = direction(x, (0.0, 0.0, t * half[1]), NOWHERE)
            vertex_a(x, n, NOWHERE, d, radii, bend_point(d), NOWHERE, out)
