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

from sim.collision.axes import Arrangement, deepest, side_of, support
from sim.collision.box import (
    column,
    corner,
    distance_squared,
    nearest,
    to_a,
    to_b,
    vertex_on_box,
    vertex_under_box,
)
from sim.collision.box_axes import facing
from sim.collision.clip import BORDER, clip, crossing, edge_normal, on_edges
from sim.collision.witness import FACE, NOWHERE, TIE, absent, along, axis, dot, edges, vertex_a, vertex_b
from sim.model import Vector
from sim.rotation import Vec3
from solvers.jit import inner_kernel

_RADII = (0.0, 0.0)


@inner_kernel
def box_box(feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Contact point `feature` of two boxes."""
    ha, hb = (sizes[0], sizes[1], sizes[2]), (sizes[4], sizes[5], sizes[6])
    face, edge, s, up, over = arrangement
    i, top, j, bottom = facing(face, up, R)
    if feature < 8:
        found = put_clipped(feature, i, top, j, bottom, ha, hb, R, r, out)
    elif feature < 12:
        found = put_corner(feature - 8, (i, top), (j, bottom), ha, hb, R, r, out)
    else:
        found = False
        if edge >= 0 and put_edges(edge, s, over, ha, hb, R, r, out):
            found = not clipped_has(edge, i, top, j, bottom, ha, hb, R, r, out)
        elif s > 0.0:
            found = put_vertex(ha, hb, R, r, out)
    if not found or (feature < 12 and out[0] < deepest(s, (min(ha[0], hb[0]), min(ha[1], hb[1]), min(ha[2], hb[2])))):
        absent(out)


@inner_kernel
def vertex(k: int, j: int, bottom: float, h: Vec3, R: Vector, r: Vector) -> Vec3:
    """Vertex k = 0..3 of the face `bottom` e_j of a, around it: the signs are ++, -+, --, +-."""
    x = along((r[0], r[1], r[2]), bottom * h[j], column(R, j))
    m, o = (j + 1) % 3, (j + 2) % 3
    x = along(x, h[m] if k == 0 or k == 3 else -h[m], column(R, m))
    return along(x, h[o] if k < 2 else -h[o], column(R, o))


@inner_kernel
def put_clipped(
    feature: int, i: int, top: float, j: int, bottom: float, ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector
) -> bool:
    """Begin (feature 0-3) or end (4-7) of an edge of the face of a above the face of b."""
    k = feature & 3
    x, y = vertex(k, j, bottom, ha, R, r), vertex((k + 1) & 3, j, bottom, ha, R, r)
    m, o = (i + 1) % 3, (i + 2) % 3
    begin, end = clip((x[m], x[o]), (y[m], y[o]), (hb[m], hb[o]))
    if feature < 4 and begin == 1:
        vertex_a(x, axis(i, top), NOWHERE, top * x[i] - hb[i], _RADII, NOWHERE, FACE, out)
        return True
    code = begin if feature < 4 else end
    if code < 2:
        return False
    l = (j + 1) % 3 if k & 1 == 0 else (j + 2) % 3
    middle = (0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1]), 0.5 * (x[2] + y[2]))
    return crossing(middle, column(R, l), ha[l], code - 2, i, top, hb, 0.0, out)


@inner_kernel
def put_corner(
    k: int, up: tuple[int, float], down: tuple[int, float], ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector
) -> bool:
    """Corner k of the face of b under the face of a, unless a vertex of a is in the same place."""
    i, top = up
    j, bottom = down
    m, o = (i + 1) % 3, (i + 2) % 3
    y = axis(i, top * hb[i])
    y = along(y, hb[m] if k == 0 or k == 3 else -hb[m], axis(m, 1.0))
    y = along(y, hb[o] if k < 2 else -hb[o], axis(o, 1.0))
    z = to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2]))
    l, q = (j + 1) % 3, (j + 2) % 3
    if abs(z[l]) > ha[l] or abs(z[q]) > ha[q]:
        return False
    for v in range(4):
        x = vertex(v, j, bottom, ha, R, r)
        if abs(x[m] - y[m]) <= BORDER * hb[m] and abs(x[o] - y[o]) <= BORDER * hb[o]:
            return False
    n = column(R, j)
    n = (-bottom * n[0], -bottom * n[1], -bottom * n[2])
    vertex_b(y, n, NOWHERE, bottom * z[j] - ha[j], _RADII, NOWHERE, FACE, out)
    return True


@inner_kernel
def put_edges(edge: int, s: float, over: float, ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector) -> bool:
    """The two edges that the separating direction points to; False where they pass each other."""
    i, j = edge // 3, edge % 3
    ua, ub = column(R, j), axis(i, 1.0)
    n = edge_normal(ub, ua, over)
    w = to_a(R, n)
    x = to_b(R, support((-w[0], -w[1], -w[2]), j, ha))
    x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
    y = support(n, i, hb)
    if s > 0.0 and not on_edges(x, ua, ha[j], y, ub, hb[i], TIE):
        return False
    edges(x, ua, y, ub, n, _RADII, out)
    return True


@inner_kernel
def clipped_has(
    edge: int, i: int, top: float, j: int, bottom: float, ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector
) -> bool:
    """Whether the two edges that `put_edges` has just written are a crossing of the two faces (features 0-7)."""
    n = (out[1], out[2], out[3])
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
def put_vertex(ha: Vec3, hb: Vec3, R: Vector, r: Vector, out: Vector) -> bool:
    """The nearest corner of one box against an edge or corner of the other; False where those are not the nearest."""
    near, of_a, d2 = NOWHERE, True, 1e300
    for k in range(8):
        x = to_b(R, corner(k, ha))
        x = (x[0] + r[0], x[1] + r[1], x[2] + r[2])
        e2 = distance_squared(x, hb)
        if e2 < d2 * (1.0 - TIE):
            near, d2 = x, e2
    for k in range(8):
        y = corner(k, hb)
        e2 = distance_squared(to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])), ha)
        if e2 < d2 * (1.0 - TIE):
            near, of_a, d2 = y, False, e2
    if of_a:
        if nearest(near, hb)[3] == 1:
            return False
        vertex_on_box(near, hb, 0.0, out)
    else:
        if nearest(to_a(R, (near[0] - r[0], near[1] - r[1], near[2] - r[2])), ha)[3] == 1:
            return False
        vertex_under_box(near, ha, R, r, out)
    n = (out[1], out[2], out[3])
    w = to_a(R, n)
    reach = abs(w[0]) * ha[0] + abs(w[1]) * ha[1] + abs(w[2]) * ha[2]
    reach += abs(n[0]) * hb[0] + abs(n[1]) * hb[1] + abs(n[2]) * hb[2]
    return dot(n, (r[0], r[1], r[2])) - reach >= out[0] - TIE * (hb[0] + hb[1] + hb[2])
