"""Polytope against polytope: corners of one against the other, edges against edges. Sphere, capsule, box are polytopes.

    feature k < na      corner k of a against the corner, edge or face of b that is nearest to it; inside b against the
                        face that it is least deep below
    k - na < nb         corner k - na of b against a
    the rest            EDGES pairs of edges that cross, with a normal that points out of b and into a

Codes: 2 + the row of the element of the other polytope (hull.py), from its row o; for two edges 2 + edge of a +
edge of b times _MANY, negative where the normal is along ua x ub. The shapes may have a radius around them.
"""

from __future__ import annotations

from sim.collision.box import to_a, to_b
from sim.collision.clip import edge_normal, on_edges
from sim.collision.hull import above, edge, edge_faces, highest_face, nearest_edge, row
from sim.collision.witness import (
    FACE,
    LINE,
    NOWHERE,
    absent,
    along,
    bend_line,
    bend_point,
    direction,
    dot,
    edges,
    vertex_a,
    vertex_b,
)
from sim.model import Matrix, Vector
from sim.rotation import Vec3, cross
from solvers.jit import inner_kernel

EDGES = 8
_MANY = 4096
_CROSSING = 1e-2  # sine of the angle from which on two edges cross
_LEANING = 0.05  # part of a face normal by which the normal of two edges may lie outside of the arc of their faces


@inner_kernel
def nearest_element(hull: Matrix, o: int, x: Vec3) -> int:
    """Row, from o, of the element nearest to a point."""
    if int(hull[o, 1]) == 0:  # a point
        return 1
    face, height = highest_face(hull, o, x)
    if face > 0 and (height <= 0.0 or above(hull, o, face, x)):
        return face - o
    e, _, _, corner = nearest_edge(hull, o, x)
    k = 1 + int(hull[o, 0]) + e
    if not corner:
        return k
    y, u, length = edge(hull, o, e)
    t = dot(u, x) - dot(u, y)
    return 1 + int(hull[o + k, 0 if 2.0 * t < length else 1])


@inner_kernel
def element(hull: Matrix, o: int, k: int, x: Vec3) -> tuple[Vec3, Vec3, float, Vec3, Vec3]:
    """Normal n, direction u, distance d, bend and slip (witness.py) of the element in row o + k at a point."""
    corners, lines = int(hull[o, 0]), int(hull[o, 1])
    if k > corners + lines:
        n = row(hull, o + k)
        return n, NOWHERE, dot(n, x) - hull[o + k, 3], NOWHERE, FACE
    if k > corners:
        y, u, _ = edge(hull, o, k - corners - 1)
        n, d = direction(x, along(y, dot(u, x) - dot(u, y), u), u)
        return n, u, d, bend_line(d), LINE
    n, d = direction(x, row(hull, o + k), NOWHERE)
    return n, NOWHERE, d, bend_point(d), NOWHERE


@inner_kernel
def _points_out(hull: Matrix, o: int, e: int, u: Vec3, n: Vec3) -> bool:
    """Whether n, across edge e along u, lies between the normals of its two faces, or nearly so."""
    f, g = edge_faces(hull, o, e)
    if f < 0:
        return True
    p, q = row(hull, f), row(hull, g)
    s = dot(u, cross(p[0], p[1], p[2], q[0], q[1], q[2]))
    a = dot(u, cross(n[0], n[1], n[2], q[0], q[1], q[2])) / s
    b = dot(u, cross(p[0], p[1], p[2], n[0], n[1], n[2])) / s
    return a > -_LEANING and b > -_LEANING


@inner_kernel
def two_edges(m: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """The m-th pair of edges that cross with a normal out of b; 0 where there are fewer."""
    oa, ob = int(sizes[0]), int(sizes[4])
    for i in range(int(hull[oa, 1])):
        x, u, la = edge(hull, oa, i)
        mine = along(x, 0.5 * la, u)
        ua = to_b(R, u)
        x = to_b(R, mine)
        x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
        for j in range(int(hull[ob, 1])):
            y, ub, lb = edge(hull, ob, j)
            y = along(y, 0.5 * lb, ub)
            c = dot(ua, ub)
            if 1.0 - c * c < _CROSSING * _CROSSING or not on_edges(x, ua, 0.5 * la, y, ub, 0.5 * lb, 0.0):
                continue
            n = edge_normal(ub, ua, 1.0)
            over = 1.0
            if not _points_out(hull, ob, j, ub, n):
                over = -1.0
                n = (-n[0], -n[1], -n[2])
                if not _points_out(hull, ob, j, ub, n):
                    continue
            w = to_a(R, n)
            if not _points_out(hull, oa, i, u, (-w[0], -w[1], -w[2])):
                continue
            if m == 0:
                return int(over) * (2 + i + _MANY * j)
            m -= 1
    return 0


@inner_kernel
def choose_elements(feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> int:
    """The elements that are contact point `feature` at this pose; writes the contact, too."""
    oa, ob = int(sizes[0]), int(sizes[4])
    na, nb = int(hull[oa, 0]), int(hull[ob, 0])
    if feature < na:
        x = to_b(R, row(hull, oa + 1 + feature))
        code = 2 + nearest_element(hull, ob, (x[0] + r[0], x[1] + r[1], x[2] + r[2]))
    elif feature < na + nb:
        y = row(hull, ob + 1 + feature - na)
        code = 2 + nearest_element(hull, oa, to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])))
    else:
        code = two_edges(feature - na - nb, sizes, hull, R, r)
    put_elements(feature, code, sizes, hull, R, r, out)
    return code


@inner_kernel
def put_elements(feature: int, code: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    """Contact of the elements `code`."""
    oa, ob = int(sizes[0]), int(sizes[4])
    na, nb = int(hull[oa, 0]), int(hull[ob, 0])
    radii = (sizes[1], sizes[5])
    if code == 0:
        absent(out)
    elif feature < na:
        x = to_b(R, row(hull, oa + 1 + feature))
        x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
        n, u, d, bend, slip = element(hull, ob, code - 2, x)
        vertex_a(x, n, u, d, radii, bend, slip, out)
    elif feature < na + nb:
        y = row(hull, ob + 1 + feature - na)
        m, w, d, bend, slip = element(hull, oa, code - 2, to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])))
        n = to_b(R, m)
        vertex_b(y, (-n[0], -n[1], -n[2]), to_b(R, w), d, radii, bend, slip, out)
    else:
        k = abs(code) - 2
        x, u, _ = edge(hull, oa, k % _MANY)
        y, ub, _ = edge(hull, ob, k // _MANY)
        ua = to_b(R, u)
        x = to_b(R, x)
        n = edge_normal(ub, ua, 1.0 if code > 0 else -1.0)
        edges((x[0] + r[0], x[1] + r[1], x[2] + r[2]), ua, y, ub, n, radii, out)
