"""A convex polytope: corners, edges and faces in rows of a table, and the nearest of them to a point.

    row o                   number of corners, edges, faces
    rows from o + 1         corners (x, y, z, 0), then edges (first corner, second corner, face, face), then faces
                            (outward unit normal n, n.x of its points)

Corners are counted from the first corner, faces from the first face. Coplanar facets are one face.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.witness import NOWHERE, TIE, dot
from sim.model.record_columns import Hull, HullEdge, HullFace
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, cross
from solvers.types import Matrix

_NONE = -1


@inner_kernel
def row(hull: Matrix, k: int) -> Vec3:
    """The first three numbers of a row."""
    return hull[k, 0], hull[k, 1], hull[k, 2]


@inner_kernel
def edge(hull: Matrix, o: int, e: int) -> tuple[Vec3, Vec3, float]:
    """First corner, direction and length of edge e."""
    k = o + 1 + int(hull[o, Hull.CORNERS]) + e
    x, y = row(hull, o + 1 + int(hull[k, HullEdge.START])), row(hull, o + 1 + int(hull[k, HullEdge.END]))
    d = (y[0] - x[0], y[1] - x[1], y[2] - x[2])
    length = sqrt(dot(d, d))
    return x, (d[0] / length, d[1] / length, d[2] / length), length


@inner_kernel
def edge_faces(hull: Matrix, o: int, e: int) -> tuple[int, int]:
    """Rows of the two faces of edge e; -1 for the edge of a capsule, which has none."""
    k = o + 1 + int(hull[o, Hull.CORNERS]) + e
    if int(hull[o, Hull.FACES]) == 0:
        return _NONE, _NONE
    first, _ = face_rows(hull, o)
    return first + int(hull[k, HullEdge.LEFT]), first + int(hull[k, HullEdge.RIGHT])


@inner_kernel
def face_rows(hull: Matrix, o: int) -> tuple[int, int]:
    """The row of the first face, and the one behind the last."""
    first = o + 1 + int(hull[o, Hull.CORNERS] + hull[o, Hull.EDGES])
    return first, first + int(hull[o, Hull.FACES])


@inner_kernel
def highest_face(hull: Matrix, o: int, x: Vec3) -> tuple[int, float]:
    """The row of the face that a point is highest above, and the height; -1 without faces."""
    best, height = _NONE, -1e300
    first, end = face_rows(hull, o)
    for f in range(first, end):
        d = dot(row(hull, f), x) - hull[f, HullFace.OFFSET]
        if d > height + TIE * abs(height):
            best, height = f, d
    return best, height


@inner_kernel
def nearest_edge(hull: Matrix, o: int, x: Vec3) -> tuple[int, float, Vec3, bool]:
    """The edge nearest to a point, its squared distance, its nearest point, and whether that is a corner."""
    best, d2, where, corner = _NONE, 1e300, NOWHERE, False
    for e in range(int(hull[o, Hull.EDGES])):
        y, u, length = edge(hull, o, e)
        t = dot(u, x) - dot(u, y)
        s = min(max(t, 0.0), length)
        z = (y[0] + s * u[0], y[1] + s * u[1], y[2] + s * u[2])
        c = (x[0] - z[0], x[1] - z[1], x[2] - z[2])
        e2 = dot(c, c)
        if e2 < d2 * (1.0 - TIE):
            best, d2, where, corner = e, e2, z, t <= 0.0 or t >= length
    return best, d2, where, corner


@inner_kernel
def above(hull: Matrix, o: int, face: int, x: Vec3) -> bool:
    """Whether a point is above a face (its row): on the inner side of all its edges, seen along its normal."""
    n = row(hull, face)
    for e in range(int(hull[o, Hull.EDGES])):
        f, g = edge_faces(hull, o, e)
        if face != f and face != g:
            continue
        y, u, _ = edge(hull, o, e)
        m = cross(u[0], u[1], u[2], n[0], n[1], n[2])
        side = dot(m, (x[0] - y[0], x[1] - y[1], x[2] - y[2]))
        # outwards is where the other face turns to
        if (side if dot(m, row(hull, g if face == f else f)) > 0.0 else -side) > 0.0:
            return False
    return True


@inner_kernel
def nearest_element(hull: Matrix, o: int, x: Vec3) -> int:
    """Row, from o, of the element nearest to a point."""
    if int(hull[o, Hull.EDGES]) == 0:  # a point
        return 1
    face, height = highest_face(hull, o, x)
    if face > 0 and (height <= 0.0 or above(hull, o, face, x)):
        return face - o
    e, _, _, corner = nearest_edge(hull, o, x)
    k = 1 + int(hull[o, Hull.CORNERS]) + e
    if not corner:
        return k
    y, u, length = edge(hull, o, e)
    t = dot(u, x) - dot(u, y)
    return 1 + int(hull[o + k, HullEdge.START if 2.0 * t < length else HullEdge.END])


@inner_kernel
def touching_corners(hull: Matrix, oa: int, ob: int) -> tuple[int, int]:
    """How many corners of two polytopes, in rows oa and ob, may be contact points: all, but none of b for a point a,
    whose own contact is with the nearest element of b, be it a corner.
    """
    return int(hull[oa, Hull.CORNERS]), int(hull[ob, Hull.CORNERS]) if hull[oa, Hull.EDGES] > 0.0 else 0
