"""Edges of a polytope a across the side or a rim of a cylinder b; a point of a rim as a corner of b.

Codes: see polytope_cylinder.py.
"""

from __future__ import annotations

from math import cos, sin

from sim.contact.collision.box import to_a, to_b
from sim.contact.collision.cylinder import RIM_BOTTOM, RIM_TOP, SIDE, reach
from sim.contact.collision.edge_clipping import edge_normal, on_edges
from sim.contact.collision.polytope_polytope import element, points_out
from sim.contact.collision.polytope_table import edge, nearest_element, row
from sim.contact.collision.rim import (
    SECTORS,
    across,
    angle_of,
    line_minimum,
    line_rim,
    sector_of,
)
from sim.contact.collision.witness import Z, along, dot, edges, vertex_b
from sim.model.record_columns import Hull, PairSize, Witness
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Integers, Matrix, Vector

LEANING = 0.05  # part of a unit normal by which it may lie outside of the cone of its elements
PASSING = 1e-6  # parts of the length by which closest points may be past the ends of edges and sides
_MANY = 4096  # edges of a polytope
_CROSSING = 1e-2  # sine of the angle from which on two lines cross
POINT_TOP = 6  # beside the elements of cylinder.py: a point of rim + as a corner; 7 of rim -


@inner_kernel
def corner_of(hull: Matrix, o: int, k: int, R: Vector, r: Vector) -> Vec3:
    """Corner k of a in the frame of b."""
    x = to_b(R, row(hull, o + 1 + k))
    return x[0] + r[0], x[1] + r[1], x[2] + r[2]


@inner_kernel
def edge_of(hull: Matrix, o: int, i: int, R: Vector, r: Vector) -> tuple[Vec3, Vec3, float]:
    """Middle, direction and half length of edge i of a in the frame of b."""
    x, u, length = edge(hull, o, i)
    x = to_b(R, along(x, 0.5 * length, u))
    return (x[0] + r[0], x[1] + r[1], x[2] + r[2]), to_b(R, u), 0.5 * length


@inner_kernel
def separation_along(n: Vec3, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> float:
    """Distance of the two along n, out of b; a without its radius."""
    o = int(sizes[0])
    least = 1e300
    w = to_a(R, n)
    for k in range(int(hull[o, Hull.CORNERS])):
        least = min(least, dot(w, row(hull, o + 1 + k)))
    return least + dot(n, (r[0], r[1], r[2])) - reach(n, sizes[PairSize.B], sizes[PairSize.B + 1])


@inner_kernel
def crossing(i: int, part: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> int:
    """Code of edge i of a where it crosses b at its side (part 0) or at one of two places on rim + (1, 2) or - (3, 4),
    with a normal out of b and into a; 0 for none. Writes the contact.
    """
    o, rho, half = int(sizes[0]), sizes[PairSize.B], sizes[PairSize.B + 1]
    x, u, l = edge_of(hull, o, i, R, r)
    where, sector, over = SIDE, 0, 1.0
    if part == 0:
        if u[0] * u[0] + u[1] * u[1] < _CROSSING * _CROSSING:
            return 0
        if not on_edges(x, u, l, (0.0, 0.0, 0.0), Z, half, PASSING):
            return 0
        n = edge_normal(Z, u, 1.0)
        if dot(n, x) < 0.0:
            over = -1.0
    else:
        where = RIM_TOP if part < 3 else RIM_BOTTOM
        z = half if part < 3 else -half
        angle = line_minimum((part - 1) % 2, x, u, rho, z)
        if angle < 0.0:
            return 0
        sector = sector_of(angle)
        line_rim(x, u, angle, rho, z, sizes[1], out)
        n = three(out, Witness.NORMAL)
        y = along(three(out, Witness.POINT), -0.5 * out[Witness.GAP], n)
        e = (y[0] / rho, y[1] / rho, 0.0)
        rise = n[2] if part < 3 else -n[2]
        c = dot(u, across(Z, e))
        past = abs(dot(u, y) - dot(u, x)) > l * (1.0 + PASSING)
        if past or dot(n, e) < -LEANING or rise < -LEANING or 1.0 - c * c < _CROSSING * _CROSSING:
            return 0
    w = to_a(R, (-over * n[0], -over * n[1], -over * n[2]))
    if not points_out(hull, o, i, to_a(R, u), w, LEANING):
        return 0
    code = 16 + where + 8 * ((1 if over > 0.0 else 0) + 2 * (i + _MANY * sector))
    put_crossing(code, sizes, hull, R, r, out)
    return code


@inner_kernel
def rim_place(where: int, angle: float, sizes: Vector) -> Vec3:
    """The point of rim + or - (POINT_TOP, POINT_BOTTOM) at this angle."""
    return (
        sizes[PairSize.B] * cos(angle),
        sizes[PairSize.B] * sin(angle),
        (sizes[PairSize.B + 1] if where == POINT_TOP else -sizes[PairSize.B + 1]),
    )


@inner_kernel
def nearest_rim_point(sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> int:
    """Code of the point of a rim that is nearest to a, as a corner of b: where a rim runs along an edge, the two have
    no other one.
    """
    o = int(sizes[0])
    best, code = 1e300, 0
    for where in range(POINT_TOP, POINT_TOP + 2):
        for sector in range(SECTORS):
            y = rim_place(where, angle_of(sector), sizes)
            k = nearest_element(hull, o, to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])))
            trial = 16 + where + 16 * (k + _MANY * sector)
            put_crossing(trial, sizes, hull, R, r, out)
            if out[Witness.GAP] < best:
                best, code = out[Witness.GAP], trial
    return code


@inner_kernel
def put_crossing(code: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    """Contact of an edge of a with the side or a rim of b; or of a point of a rim with the element of a in that row."""
    where, k = code & 7, (code - 16) >> 4
    if where >= POINT_TOP:
        y = rim_place(where, angle_of(k // _MANY), sizes)
        m, w, d, bend, slip = element(hull, int(sizes[0]), k % _MANY, to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])))
        n = to_b(R, m)
        vertex_b(y, (-n[0], -n[1], -n[2]), to_b(R, w), d, (sizes[1], 0.0), bend, slip, out)
        return
    over = 1.0 if ((code - 16) >> 3) & 1 else -1.0
    x, u, _ = edge_of(hull, int(sizes[0]), k % _MANY, R, r)
    if where == SIDE:
        edges(x, u, (0.0, 0.0, 0.0), Z, edge_normal(Z, u, over), (sizes[1], sizes[PairSize.B]), out)
        return
    z = sizes[PairSize.B + 1] if where == RIM_TOP else -sizes[PairSize.B + 1]
    line_rim(x, u, angle_of(k // _MANY), sizes[PairSize.B], z, sizes[1], out)


@inner_kernel
def crossings(
    sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector, codes: Integers, first: int, room: int
) -> tuple[float, int]:
    """Largest separation along the normal of an edge that crosses b, and its code; the codes of all from `first`."""
    best, which, found = -1e300, 0, 0
    for i in range(int(hull[int(sizes[0]), Hull.EDGES])):
        for part in range(5):
            code = crossing(i, part, sizes, hull, R, r, out)
            if code == 0:
                continue
            s = separation_along(three(out, Witness.NORMAL), sizes, hull, R, r)
            if s > best:
                best, which = s, code
            if found < room:
                codes[first + found] = code
                found += 1
    return best, which
