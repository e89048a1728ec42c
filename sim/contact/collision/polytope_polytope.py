"""Polytope against polytope: corners of one against the other, edges against edges. Sphere, capsule, box are polytopes.

    feature k < na      corner k of a against the corner, edge or face of b that is nearest to it; inside b against the
                        face that it is least deep below. Where the shapes overlap least along the normal of a face of
                        b: below that face against it
    k - na < nb         corner k - na of b against a, unless a is a point: nothing of b is nearer to it than feature 0
    the rest            EDGES pairs of edges that cross, with a normal that points out of b and into a; or SPARE

Codes: 2 + the row of the element of the other polytope (polytope_table.py), from its row o; for two edges
2 + edge of a + edge of b times _MANY, negative where the normal is along ua x ub. The shapes may have a
radius around them.
"""

from __future__ import annotations

from sim.contact.collision.box import to_a, to_b
from sim.contact.collision.edge_axes import Arrangement
from sim.contact.collision.edge_clipping import edge_normal, on_edges
from sim.contact.collision.feature_code import substituted_feature
from sim.contact.collision.polytope_table import (
    above,
    edge,
    edge_faces,
    face_rows,
    highest_face,
    nearest_element,
    row,
    touching_corners,
)
from sim.contact.collision.witness import (
    FACE,
    LINE,
    NOWHERE,
    TIE,
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
from sim.model.model import Model
from sim.model.record_columns import Hull, HullFace, PairSize
from sim.model.slots import Slot
from solvers.compiler import inner_kernel, optional
from solvers.rotation import Vec3, cross
from solvers.types import Matrix, Vector

_MANY = 4096
_CROSSING = 1e-2  # sine of the angle from which on two edges cross
_LEANING = 0.05  # part of a face normal by which the normal of two edges may lie outside of the arc of their faces


@inner_kernel
def below(hull: Matrix, o: int, face: int, x: Vec3) -> bool:
    """Whether a point is below a face (its row), seen along its normal."""
    return dot(row(hull, face), x) < hull[face, HullFace.OFFSET] and above(hull, o, face, x)


@inner_kernel
def element(hull: Matrix, o: int, k: int, x: Vec3) -> tuple[Vec3, Vec3, float, Vec3, Vec3]:
    """Normal n, direction u, distance d, bend and slip (witness.py) of the element in row o + k at a point."""
    corners, lines = int(hull[o, Hull.CORNERS]), int(hull[o, Hull.EDGES])
    if k > corners + lines:
        n = row(hull, o + k)
        return n, NOWHERE, dot(n, x) - hull[o + k, HullFace.OFFSET], NOWHERE, FACE
    if k > corners:
        y, u, _ = edge(hull, o, k - corners - 1)
        n, d = direction(x, along(y, dot(u, x) - dot(u, y), u), u)
        return n, u, d, bend_line(d), LINE
    n, d = direction(x, row(hull, o + k), NOWHERE)
    return n, NOWHERE, d, bend_point(d), NOWHERE


@inner_kernel
def points_out(hull: Matrix, o: int, e: int, u: Vec3, n: Vec3, leaning: float) -> bool:
    """Whether n, across edge e along u, lies between the normals of its two faces, or `leaning` beyond them."""
    f, g = edge_faces(hull, o, e)
    if f < 0:
        return True
    p, q = row(hull, f), row(hull, g)
    s = dot(u, cross(p[0], p[1], p[2], q[0], q[1], q[2]))
    a = dot(u, cross(n[0], n[1], n[2], q[0], q[1], q[2])) / s
    b = dot(u, cross(p[0], p[1], p[2], n[0], n[1], n[2])) / s
    return a > -leaning and b > -leaning


@inner_kernel
def _straddles(hull: Matrix, o: int, e: int, u: Vec3) -> bool:
    """Whether the normals between the two faces of edge e reach the plane across u, or lean over to it; u: an edge of
    the other shape. If not, `points_out` is false for the normal of both edges: its terms are dot(u, face)/|u x ue|.
    """
    f, g = edge_faces(hull, o, e)
    if f < 0:
        return True
    p, q = dot(row(hull, f), u), dot(row(hull, g), u)
    return min(p, q) < _LEANING and max(p, q) > -_LEANING


@inner_kernel
def _edge_axis(
    i: int, j: int, leaning: float, sizes: Vector, hull: Matrix, R: Vector, r: Vector
) -> tuple[int, float, bool]:
    """Code of edge i of a and edge j of b where their normal points out of b and into a, 0 where none does; their
    distance along it; whether they cross, seen along it.
    """
    oa, ob = int(sizes[0]), int(sizes[PairSize.B])
    x, u, la = edge(hull, oa, i)
    y, ub, lb = edge(hull, ob, j)
    ua = to_b(R, u)
    c = dot(ua, ub)
    if 1.0 - c * c < _CROSSING * _CROSSING or not _straddles(hull, oa, i, to_a(R, ub)):
        return 0, 0.0, False
    x, y = to_b(R, along(x, 0.5 * la, u)), along(y, 0.5 * lb, ub)
    x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
    n = edge_normal(ub, ua, 1.0)
    over = 1
    if not points_out(hull, ob, j, ub, n, leaning):
        over, n = -1, (-n[0], -n[1], -n[2])
        if not points_out(hull, ob, j, ub, n, leaning):
            return 0, 0.0, False
    w = to_a(R, n)
    if not points_out(hull, oa, i, u, (-w[0], -w[1], -w[2]), leaning):
        return 0, 0.0, False
    d = dot(n, x) - dot(n, y)
    return over * (2 + i + _MANY * j), d, on_edges(x, ua, 0.5 * la, y, ub, 0.5 * lb, 0.0)


@inner_kernel
def apart_along_faces(sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> tuple[int, float]:
    """Row of the face along whose normal the two are farthest apart, or overlap least, and the distance along it
    without their radii: at most that of the shapes.
    """
    oa, ob = int(sizes[0]), int(sizes[PairSize.B])
    na, nb = int(hull[oa, Hull.CORNERS]), int(hull[ob, Hull.CORNERS])
    best, face = -1e300, -1
    start, behind = face_rows(hull, ob)
    for f in range(start, behind):
        n = row(hull, f)
        w = to_a(R, n)
        height = dot(n, (r[0], r[1], r[2])) - hull[f, HullFace.OFFSET]
        least = 1e300
        for k in range(na):
            least = min(least, dot(w, row(hull, oa + 1 + k)))
        if least + height > best:
            best, face = least + height, f
    start, behind = face_rows(hull, oa)
    for f in range(start, behind):
        n = to_b(R, row(hull, f))
        height = -dot(n, (r[0], r[1], r[2])) - hull[f, HullFace.OFFSET]
        least = 1e300
        for k in range(nb):
            least = min(least, dot(n, row(hull, ob + 1 + k)))
        if least + height > best:
            best, face = least + height, f
    return face, best


@optional(Slot.APART_POLYTOPES, default=-1e300)
def apart_polytopes(model: Model, sizes: Vector, R: Vector, r: Vector) -> float:
    """`apart_at_least` of collide.py for this pair."""
    return apart_along_faces(sizes, model.hull, R, r)[1] - sizes[1] - sizes[PairSize.B + 1]


@inner_kernel
def separation(sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> Arrangement:
    """Of the normals of faces and of pairs of edges, the one along which the two are farthest apart, or overlap least:
    (row of the face, or -1 for edges; how many pairs `two_edges` finds at most; distance along it; 1; 1).
    """
    face, best = apart_along_faces(sizes, hull, R, r)
    oa, ob = int(sizes[0]), int(sizes[PairSize.B])
    outside, inside = 0, 0
    for i in range(int(hull[oa, Hull.EDGES])):
        u = to_b(R, edge(hull, oa, i)[1])
        for j in range(int(hull[ob, Hull.EDGES])):
            if not _straddles(hull, ob, j, u):
                continue
            code, d, _ = _edge_axis(i, j, 0.0, sizes, hull, R, r)
            if code != 0 and d > best + TIE * abs(best):
                best, face = d, -1
            code, d, crosses = _edge_axis(i, j, _LEANING, sizes, hull, R, r)
            if code != 0 and crosses:
                outside, inside = outside + (d >= 0.0), inside + (d < 0.0)
    return face, outside + (0 if best > 0.0 else inside), best, 1.0, 1.0


@inner_kernel
def two_edges(m: int, deepest: float, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """The m-th pair of edges that cross with a normal out of b; 0 where there are fewer.

    Edges on the far sides of the two cross as well, with a negative distance. Such pairs count only where the shapes
    overlap, and least along that normal: by `deepest`.
    """
    oa, ob = int(sizes[0]), int(sizes[PairSize.B])
    for i in range(int(hull[oa, Hull.EDGES])):
        u = to_b(R, edge(hull, oa, i)[1])
        for j in range(int(hull[ob, Hull.EDGES])):
            if not _straddles(hull, ob, j, u):
                continue
            code, d, crosses = _edge_axis(i, j, _LEANING, sizes, hull, R, r)
            if code == 0 or not crosses:
                continue
            if d < 0.0 and (deepest > 0.0 or d < (1.0 + TIE) * deepest):
                continue
            if m == 0:
                return code
            m -= 1
    return 0


@inner_kernel
def face_towards(feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    """The elements of feature `feature` where it is a corner: the face of the other shape that it is highest above, if
    it is not below that one, else the nearest element. 0 if that is not a corner.
    """
    radius = sizes[1] + sizes[PairSize.B + 1]
    oa, ob = int(sizes[0]), int(sizes[PairSize.B])
    na, nb = touching_corners(hull, oa, ob)
    if feature < na:
        x = to_b(R, row(hull, oa + 1 + feature))
        x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
        face, height = highest_face(hull, ob, x)
        return 2 + (face - ob if face > 0 and height >= radius else nearest_element(hull, ob, x))
    if feature < na + nb:
        y = row(hull, ob + 1 + feature - na)
        y = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
        face, height = highest_face(hull, oa, y)
        return 2 + (face - oa if face > 0 and height >= radius else nearest_element(hull, oa, y))
    return 0


@inner_kernel
def choose_elements(
    feature: int, arrangement: Arrangement, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector
) -> int:
    """The elements that are contact point `feature` at this pose; writes the contact, too."""
    face, crossings, s, _, _ = arrangement
    oa, ob = int(sizes[0]), int(sizes[PairSize.B])
    na, nb = touching_corners(hull, oa, ob)
    if feature < na:
        x = to_b(R, row(hull, oa + 1 + feature))
        x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
        code = 2 + (face - ob if s < 0.0 and face > ob and below(hull, ob, face, x) else nearest_element(hull, ob, x))
    elif feature < na + nb:
        y = row(hull, ob + 1 + feature - na)
        y = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
        own = s < 0.0 and 0 <= face < ob and below(hull, oa, face, y)
        code = 2 + (face - oa if own else nearest_element(hull, oa, y))
    else:
        m = feature - na - nb
        code = two_edges(m, s, sizes, hull, R, r) if m < crossings else 0
    put_elements(feature, code, sizes, hull, R, r, out)
    return code


@inner_kernel
def put_elements(feature: int, code: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    """Contact of the elements `code`."""
    feature, code = substituted_feature(feature, code)
    oa, ob = int(sizes[0]), int(sizes[PairSize.B])
    na, nb = touching_corners(hull, oa, ob)
    radii = (sizes[1], sizes[PairSize.B + 1])
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
