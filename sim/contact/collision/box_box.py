"""Box against box.

The face or the two edges that separate the boxes most decide (separating axes). A face of b and the face of a turned
towards it touch in a polygon; each of its corners is a pair of elements, with the exact normal of that pair (all of
them the normal of the face where the two faces are parallel):

    feature 0-3     begin of edges 0-3 of the face of a: its vertex above the face of b, or where the edge crosses a
                    side of that face (edge against edge)
    feature 4-7     end of the same edges, where it is a crossing
    feature 8-11    corners of the face of b below the face of a
    feature 12      elsewhere: the two nearest edges, or a corner and the nearest edge or corner of the other box

Equal boxes exactly on top of each other touch at features 0-3. Of equally good axes the first wins: b's x, y, z, then
a's, then pairs of edges.
"""

from __future__ import annotations

from sim.contact.collision.box import bits, column, corner, distance_squared, nearest, to_a, to_b
from sim.contact.collision.box_axes import facing
from sim.contact.collision.box_elements import (
    BOX_VERTEX,
    CORNER_FACE,
    CROSSING,
    EDGES,
    VERTEX_BOX,
    VERTEX_FACE,
    Facing,
    code_of,
    edge_of,
    face_corner,
    face_edge,
    put_elements,
    vertex,
)
from sim.contact.collision.edge_axes import Arrangement, deepest, side_of
from sim.contact.collision.edge_clipping import BORDER, PAST, clip, edge_normal, on_edges, side_edge
from sim.contact.collision.witness import TIE, absent, axis, dot
from sim.model.record_columns import Witness
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, three
from solvers.types import Vector


@inner_kernel
def choose_elements(
    feature: int, arrangement: Arrangement, ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector
) -> int:
    """The elements (box_elements.py) that are contact point `feature` at this pose; writes the contact, too."""
    face, edge, s, up, over = arrangement
    faces = facing(face, up, R)
    if feature < 8:
        code = clipped(feature, faces, ha, hb, R, r)
    elif feature < 12:
        code = corner_below(feature - 8, faces, ha, hb, R, r)
    else:
        code = two_edges(edge, s, over, ha, hb, R, r) if edge >= 0 else 0
        if code != 0:
            code = 0 if clipped_has(edge, over, faces, ha, hb, R, r) else code
        elif s > 0.0:
            code = nearest_corner(ha, hb, R, r)
    if code != 0:
        put_elements(code, ha, hb, R, r, out)
        if feature == 12:
            if code & 7 < VERTEX_BOX or separates(ha, hb, R, r, out):
                return code
        elif out[Witness.GAP] >= deepest(s, (min(ha[0], hb[0]), min(ha[1], hb[1]), min(ha[2], hb[2]))):
            return code
    absent(out)
    return 0


@inner_kernel
def clipped(feature: int, faces: Facing, ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> int:
    """Begin (feature 0-3) or end (4-7) of an edge of the face of a above the face of b."""
    i, top, j, bottom = faces
    k = feature & 3
    x, y = vertex(k, j, bottom, ha, R, r), vertex((k + 1) & 3, j, bottom, ha, R, r)
    m, o = (i + 1) % 3, (i + 2) % 3
    begin, end = clip((x[m], x[o]), (y[m], y[o]), (hb[m], hb[o]))
    if feature < 4 and begin == 1:
        return code_of(VERTEX_FACE, faces, k, 0)
    code = begin if feature < 4 else end
    if code < 2:
        return 0
    middle, ua, la = face_edge(k, j, bottom, ha, R, r)
    y, ub, lb = side_edge(code - 2, i, top, hb)
    return code_of(CROSSING, faces, k, code - 2) if on_edges(middle, ua, la, y, ub, lb, PAST) else 0


@inner_kernel
def corner_below(k: int, faces: Facing, ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> int:
    """Corner k of the face of b under the face of a, unless a vertex of a is in the same place."""
    i, top, j, bottom = faces
    m, o = (i + 1) % 3, (i + 2) % 3
    y = face_corner(k, i, top, hb)
    z = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
    l, q = (j + 1) % 3, (j + 2) % 3
    if abs(z[l]) > ha[l] or abs(z[q]) > ha[q]:
        return 0
    for v in range(4):
        x = vertex(v, j, bottom, ha, R, r)
        if abs(x[m] - y[m]) <= BORDER * hb[m] and abs(x[o] - y[o]) <= BORDER * hb[o]:
            return 0
    return code_of(CORNER_FACE, faces, k, 0)


@inner_kernel
def two_edges(edge: int, s: float, over: float, ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> int:
    """The two edges that the separating direction points to; 0 where they pass each other."""
    i, j = edge // 3, edge % 3
    ua, ub = column(R, j), axis(i, 1.0)
    n = edge_normal(ub, ua, over)
    w = to_a(R, n)
    k, l = bits((-w[0], -w[1], -w[2])), bits(n)
    x, y = to_b(R, edge_of(k, j, ha)), edge_of(l, i, hb)
    x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
    if s > 0.0 and not on_edges(x, ua, ha[j], y, ub, hb[i], TIE):
        return 0
    return code_of(EDGES, (i, over, j, 1.0), k, l)


@inner_kernel
def clipped_has(edge: int, over: float, faces: Facing, ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> bool:
    """Whether the edges of `two_edges` are a crossing of the two faces (features 0-7)."""
    i, top, j, bottom = faces
    n = edge_normal(axis(edge // 3, 1.0), column(R, edge % 3), over)
    w = to_a(R, n)
    side = side_of(edge // 3, n, i, top)
    mine = side_of(edge % 3, (-w[0], -w[1], -w[2]), j, bottom)
    if side < 0 or mine < 0:
        return False
    # sides -m, +m, -o, +o of the face of a are its edges 1, 3, 2, 0
    k = 1 if mine == 0 else (3 if mine == 1 else (2 if mine == 2 else 0))
    x, y = vertex(k, j, bottom, ha, R, r), vertex((k + 1) & 3, j, bottom, ha, R, r)
    m, o = (i + 1) % 3, (i + 2) % 3
    begin, end = clip((x[m], x[o]), (y[m], y[o]), (hb[m], hb[o]))
    return begin == 2 + side or end == 2 + side


@inner_kernel
def nearest_corner(ha: Vec3, hb: Vec3, R: Vector, r: Vector) -> int:
    """The nearest corner of one box against an edge or corner of the other; 0 where it is nearest to a face."""
    near, of_a, d2 = 0, True, 1e300
    for k in range(8):
        x = to_b(R, corner(k, ha))
        e2 = distance_squared((x[0] + r[0], x[1] + r[1], x[2] + r[2]), hb)
        if e2 < d2 * (1.0 - TIE):
            near, d2 = k, e2
    for k in range(8):
        y = corner(k, hb)
        e2 = distance_squared(to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])), ha)
        if e2 < d2 * (1.0 - TIE):
            near, of_a, d2 = k, False, e2
    if of_a:
        x = to_b(R, corner(near, ha))
        kind = nearest((x[0] + r[0], x[1] + r[1], x[2] + r[2]), hb)[3]
        return 0 if kind == 1 else code_of(VERTEX_BOX, (0, 1.0, 0, 1.0), near, 0)
    y = corner(near, hb)
    kind = nearest(to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])), ha)[3]
    return 0 if kind == 1 else code_of(BOX_VERTEX, (0, 1.0, 0, 1.0), near, 0)


@inner_kernel
def separates(ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector) -> bool:
    """Whether the normal in `out` separates the two boxes by the distance there: the two points are the nearest."""
    n = three(out, Witness.NORMAL)
    w = to_a(R, n)
    reach = abs(w[0]) * ha[0] + abs(w[1]) * ha[1] + abs(w[2]) * ha[2]
    reach += abs(n[0]) * hb[0] + abs(n[1]) * hb[1] + abs(n[2]) * hb[2]
    return dot(n, (r[0], r[1], r[2])) - reach >= out[Witness.GAP] - TIE * (hb[0] + hb[1] + hb[2])
