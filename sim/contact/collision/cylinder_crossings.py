"""Where two cylinders a and b cross: their axes, the axis of one and a rim of the other, two rims; a point of a rim of
a as a corner.   Codes: see cylinder_cylinder.py.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.box import column, to_a
from sim.contact.collision.cylinder import nearest, reach, vertex_on_cylinder
from sim.contact.collision.edge_clipping import edge_normal, on_edges
from sim.contact.collision.polytope_cylinder_crossings import LEANING, PASSING
from sim.contact.collision.rim import (
    SECTORS,
    Frame,
    across,
    angle_of,
    line_minimum,
    line_rim,
    sector_of,
)
from sim.contact.collision.rim_rim import point_of, rim_minimum, rim_rim
from sim.contact.collision.swapped_shapes import exchange
from sim.contact.collision.witness import Z, along, dot, edges
from sim.model.record_columns import PairSize, Witness
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Vector

_CROSSING = 1e-2  # sine of the angle from which on two lines cross
AXES, AXIS_RIM, RIM_AXIS, RIMS, POINT = 1, 2, 3, 4, 5
_ORIGIN = (0.0, 0.0, 0.0)


@inner_kernel
def turn_around(R: Vector, r: Vector, turned: Vector) -> None:
    """turned = (R^T, -R^T r): the pose of b in the frame of a."""
    for i in range(3):
        for k in range(3):
            turned[3 * i + k] = R[3 * k + i]
    x = to_a(R, (-r[0], -r[1], -r[2]))
    turned[9], turned[10], turned[11] = x


@inner_kernel
def separation_along(n: Vec3, sizes: Vector, R: Vector, r: Vector) -> float:
    """Distance of the two along n, out of b."""
    return (
        dot(n, (r[0], r[1], r[2]))
        - reach(to_a(R, n), sizes[0], sizes[1])
        - reach(n, sizes[PairSize.B], sizes[PairSize.B + 1])
    )


@inner_kernel
def rim_of(top: float, sizes: Vector, R: Vector, r: Vector) -> Frame:
    """The rim of a on the side `top` of its axis, in the frame of b."""
    return along((r[0], r[1], r[2]), top * sizes[1], column(R, 2)), column(R, 0), column(R, 1)


@inner_kernel
def within_cone(n: Vec3, e: Vec3, u: Vec3) -> bool:
    """Whether n points out of a rim, along e and u, within the tolerance LEANING."""
    return dot(n, e) > -LEANING and dot(n, u) > -LEANING


@inner_kernel
def code_of(kind: int, above: bool, rim: int, sector: int) -> int:
    """Number of two elements; above: the side of the normal; rim: bits of the ends of a and of b, 1 on the + side."""
    return 16 + kind + 8 * ((1 if above else 0) + 2 * (rim + 4 * sector))


@inner_kernel
def axis_and_rim(x: Vec3, u: Vec3, l: float, rho: float, z: float, place: int, radius: float, out: Vector) -> int:
    """Where an axis, x + s u with |s| <= l, touches the rim at height z: 1 + the sector, 0 for nowhere. place: which of
    two such places.
    """
    angle = line_minimum(place, x, u, rho, z)
    if angle < 0.0:
        return 0
    line_rim(x, u, angle, rho, z, radius, out)
    n = three(out, Witness.NORMAL)
    y = along(three(out, Witness.POINT), -0.5 * out[Witness.GAP], n)
    e = (y[0] / rho, y[1] / rho, 0.0)
    up = (0.0, 0.0, 1.0 if z > 0.0 else -1.0)
    c = dot(u, across(Z, e))
    past = abs(dot(u, y) - dot(u, x)) > l * (1.0 + PASSING)
    if past or 1.0 - c * c < _CROSSING * _CROSSING or not within_cone(n, e, up):
        return 0
    return 1 + sector_of(angle)


@inner_kernel
def two_rims(rim: int, place: int, sizes: Vector, R: Vector, r: Vector) -> int:
    """Code of two rims where they touch; 0 for nowhere."""
    top, z = (1.0 if rim & 1 else -1.0), (sizes[PairSize.B + 1] if rim & 2 else -sizes[PairSize.B + 1])
    circle, radii = rim_of(top, sizes, R, r), (sizes[0], sizes[PairSize.B])
    angle = rim_minimum(place, circle, radii, z)
    if angle < 0.0:
        return 0
    x, ea, ta = point_of(circle, sizes[0], angle)
    a = sqrt(x[0] * x[0] + x[1] * x[1])
    e = (x[0] / a, x[1] / a, 0.0)
    n = across(ta, across(Z, e))
    size = sqrt(dot(n, n))
    if size < _CROSSING:
        return 0
    up, axis_a = (0.0, 0.0, 1.0 if rim & 2 else -1.0), column(R, 2)
    over = size if dot(n, e) + dot(n, up) - dot(n, ea) - top * dot(n, axis_a) >= 0.0 else -size
    n = (n[0] / over, n[1] / over, n[2] / over)
    into_a = (-n[0], -n[1], -n[2])
    if not within_cone(n, e, up) or not within_cone(into_a, ea, (top * axis_a[0], top * axis_a[1], top * axis_a[2])):
        return 0
    return code_of(RIMS, True, rim, sector_of(angle))


@inner_kernel
def crossing(part: int, sizes: Vector, R: Vector, r: Vector, turned: Vector, out: Vector) -> int:
    """Code of the part-th pair of elements where it touches, its normal out of b and into a, or 0. Writes it, too."""
    code = 0
    u = column(R, 2)
    if part == 0:
        x = (r[0], r[1], r[2])
        if u[0] * u[0] + u[1] * u[1] > _CROSSING * _CROSSING and on_edges(
            x, u, sizes[1], _ORIGIN, Z, sizes[PairSize.B + 1], PASSING
        ):
            code = code_of(AXES, dot(edge_normal(Z, u, 1.0), x) >= 0.0, 0, 0)
    elif part < 5:
        top = (part - 1) // 2
        z = sizes[PairSize.B + 1] if top == 1 else -sizes[PairSize.B + 1]
        k = axis_and_rim((r[0], r[1], r[2]), u, sizes[1], sizes[PairSize.B], z, part & 1, sizes[0], out)
        if k > 0:
            code = code_of(AXIS_RIM, True, 2 * top, k - 1)
    elif part < 9:
        top = (part - 5) // 2
        z = sizes[1] if top == 1 else -sizes[1]
        x = three(turned, 9)
        k = axis_and_rim(x, (R[6], R[7], R[8]), sizes[PairSize.B + 1], sizes[0], z, part & 1, sizes[PairSize.B], out)
        if k > 0:
            code = code_of(RIM_AXIS, True, top, k - 1)
    else:
        code = two_rims((part - 9) // 2, part & 1, sizes, R, r)
    if code != 0:
        put_crossing(code, sizes, R, r, turned, out)
    return code


@inner_kernel
def put_crossing(code: int, sizes: Vector, R: Vector, r: Vector, turned: Vector, out: Vector) -> None:
    """Contact of two elements that cross."""
    kind, k = (code - 16) & 7, (code - 16) >> 3
    over, rim, angle = (1.0 if k & 1 else -1.0), (k >> 1) & 3, angle_of(k >> 3)
    u = column(R, 2)
    top, z = (1.0 if rim & 1 else -1.0), (sizes[PairSize.B + 1] if rim & 2 else -sizes[PairSize.B + 1])
    if kind == AXES:
        n = edge_normal(Z, u, over)
        edges((r[0], r[1], r[2]), u, _ORIGIN, Z, n, (sizes[0], sizes[PairSize.B]), out)
    elif kind == AXIS_RIM:
        line_rim((r[0], r[1], r[2]), u, angle, sizes[PairSize.B], z, sizes[0], out)
    elif kind == RIM_AXIS:
        x = three(turned, 9)
        line_rim(x, (R[6], R[7], R[8]), angle, sizes[0], top * sizes[1], sizes[PairSize.B], out)
        exchange(turned[:9], turned[9:], out)
    elif kind == RIMS:
        rim_rim(rim_of(top, sizes, R, r), top, angle, (sizes[0], sizes[PairSize.B]), z, out)
    else:
        x, _, _ = point_of(rim_of(top, sizes, R, r), sizes[0], angle_of((k >> 3) % SECTORS))
        vertex_on_cylinder((k >> 3) // SECTORS, x, 0.0, sizes[PairSize.B], sizes[PairSize.B + 1], out)


@inner_kernel
def nearest_rim_point(sizes: Vector, R: Vector, r: Vector, turned: Vector, out: Vector) -> int:
    """Code of the point of a rim of a that is nearest to b, as a corner of a: where two rims run along each other, they
    have no other one.
    """
    best, code = 1e300, 0
    for rim in range(2):
        circle = rim_of(1.0 if rim == 1 else -1.0, sizes, R, r)
        for sector in range(SECTORS):
            x, _, _ = point_of(circle, sizes[0], angle_of(sector))
            where = nearest(x, sizes[PairSize.B], sizes[PairSize.B + 1])
            trial = code_of(POINT, True, rim, sector + SECTORS * where)
            put_crossing(trial, sizes, R, r, turned, out)
            if out[Witness.GAP] < best:
                best, code = out[Witness.GAP], trial
    return code
