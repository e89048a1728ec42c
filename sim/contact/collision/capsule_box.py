"""Capsule against box: a segment with a radius around it.

    feature 0, 1    begin and end of the part of the segment above the nearest face of the box: an end of the segment,
                    or where it crosses an edge of the face; an end that is not above it against the nearest feature
    feature 2       the segment across an edge of the box, or against the corner nearest to it
    feature 3, 4    the two corners of the edge of the box that the segment is most parallel to

The normal of a face, of an edge across the segment, or between two points, each exact for its pair of elements. Deep
inside, where the segment itself cuts the box, the face or edge of least penetration decides.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.box import bits, corner, distance_squared, vertex_on_box
from sim.contact.collision.box_elements import CROSSING, code_of, edge_of, faces_of
from sim.contact.collision.edge_axes import (
    OPEN,
    PARALLEL,
    SWINGS,
    Arrangement,
    deepest,
    edge_must_exceed,
    opened,
    separates_from,
    side,
    side_of,
)
from sim.contact.collision.edge_clipping import PAST, clip, common_normal, edge_normal, on_edges, side_edge
from sim.contact.collision.witness import (
    FACE,
    LINE,
    NOWHERE,
    TIE,
    absent,
    along,
    axis,
    bend_line,
    direction,
    dot,
    edges,
    vertex_a,
    vertex_b,
)
from sim.model.record_columns import Witness
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3
from solvers.types import Vector

# kinds of elements, beside the CROSSING of the segment and a side of the face
END_FACE, EDGES, END_BOX, SEGMENT_CORNER = 1, 3, 5, 6


@inner_kernel
def choose_elements(
    feature: int, arrangement: Arrangement, radius: float, half: float, h: Vec3, R: Vector, r: Vector, out: Vector
) -> int:
    """The elements that are contact point `feature` of a capsule along the z axis of its frame; writes it, too."""
    c, u = (r[0], r[1], r[2]), (R[2], R[5], R[8])
    face, edge, s, top, over = arrangement
    faces = (face, top, 0, 1.0)
    x, y = along(c, -half, u), along(c, half, u)
    m, o = (face + 1) % 3, (face + 2) % 3
    codes = clip((x[m], x[o]), (y[m], y[o]), (h[m], h[o]))
    code = 0
    if feature > 2:
        code = edge_end(feature - 3, c, u, half, h) if s > 0.0 else 0
    elif feature < 2:
        where = codes[feature]
        if where == 1:
            code = code_of(END_FACE, faces, feature, 0)
        elif where > 1:
            z, ub, lb = side_edge(where - 2, face, top, h)
            code = code_of(CROSSING, faces, 0, where - 2) if on_edges(c, u, half, z, ub, lb, PAST) else 0
        if code == 0 and s > 0.0:
            code = code_of(END_BOX, (0, 1.0, 0, 1.0), feature, 0)
    elif edge >= 0 and two_edges(edge, s, over, c, u, half, h):
        n = edge_normal(axis(edge, 1.0), u, over)
        side = side_of(edge, n, face, top)
        if side < 0 or (codes[0] != 2 + side and codes[1] != 2 + side):
            code = code_of(EDGES, (edge, over, 0, 1.0), 0, bits(n))
    elif s > 0.0:
        code = nearest_corner(c, u, half, h)
        if code == edge_end(0, c, u, half, h) or code == edge_end(1, c, u, half, h):
            code = 0
    if code != 0:
        put_elements(code, radius, half, h, R, r, out)
        if feature > 1:
            return code
        elif out[Witness.GAP] + radius >= deepest(s, h):
            return code
    absent(out)
    return 0


@inner_kernel
def put_elements(code: int, radius: float, half: float, h: Vec3, R: Vector, r: Vector, out: Vector) -> None:
    """Contact of the two elements `code`, which is not 0."""
    c, u = (r[0], r[1], r[2]), (R[2], R[5], R[8])
    kind, other = code & 7, (code >> 12) & 7
    i, top, _, _ = faces_of(code)
    end = along(c, half if code & 512 else -half, u)
    if kind == END_FACE:
        vertex_a(end, axis(i, top), NOWHERE, top * end[i] - h[i], (radius, 0.0), NOWHERE, FACE, out)
    elif kind == CROSSING:
        y, ub, _ = side_edge(other, i, top, h)
        edges(c, u, y, ub, common_normal(u, ub, axis(i, top)), (radius, 0.0), out)
    elif kind == EDGES:
        b = axis(i, 1.0)
        edges(c, u, edge_of(other, i, h), b, edge_normal(b, u, top), (radius, 0.0), out)
    elif kind == END_BOX:
        vertex_on_box(end, h, radius, out)
    else:
        y = corner(other, h)
        n, d = direction(along(c, dot(u, y) - dot(u, c), u), y, u)
        vertex_b(y, n, u, d, (radius, 0.0), bend_line(d), LINE, out)


@inner_kernel
def across(i: int, c: Vec3, u: Vec3, h: Vec3) -> tuple[float, float, float]:
    """(x, reach, length) along n = e_i x u: n.c, the reach of the box, and |n|."""
    k, l = (i + 1) % 3, (i + 2) % 3
    x = c[l] * u[k] - c[k] * u[l]
    return x, h[k] * abs(u[l]) + h[l] * abs(u[k]), sqrt(u[k] * u[k] + u[l] * u[l])


@inner_kernel
def separation(c: Vec3, u: Vec3, half: float, h: Vec3, sides: int) -> Arrangement:
    """(face, edge, s, side of the face, side of the edge) of the open sides, or of all faces where none is open.

    face: axis of the face that separates the segment c + t u most, |t| <= half; edge: that of the edge of the box, or
    -1 where the face does better; s: the separation along the better one, negative inside. Axis 3 + i is e_i x u.
    """
    if sides & 63 == 0:
        sides |= 63
    face, edge, s, top, over = 0, -1, -1e300, 1.0, 1.0
    for i in range(3):
        t = side(c[i], sides, i)
        if t == 0.0:
            continue
        d = t * c[i] - h[i] - half * abs(u[i])
        if d > s:
            face, s, top = i, d, t
    least = edge_must_exceed(s, h)
    for i in range(3):
        x, reach, q = across(i, c, u, h)
        t = side(x, sides, 3 + i)
        if q > PARALLEL and t != 0.0:
            d = (t * x - reach) / q
            if d > least:
                edge, s, least, over = i, d, d, t
    return face, edge, s, top, over


@inner_kernel
def open_sides(c: Vec3, u: Vec3, half: float, h: Vec3) -> int:
    """The axes, with their sides, that separate the segment from the box."""
    best = separates_from(separation(c, u, half, h, OPEN)[2], h)
    found = 0
    for i in range(3):
        if abs(c[i]) - h[i] - half * abs(u[i]) >= best:
            found |= opened(i, c[i])
        x, reach, q = across(i, c, u, h)
        if q < SWINGS:
            found |= 3 << (2 * (3 + i))
        elif abs(x) - reach >= best * q:
            found |= opened(3 + i, x)
    return found


@inner_kernel
def two_edges(i: int, s: float, over: float, c: Vec3, u: Vec3, half: float, h: Vec3) -> bool:
    """Whether the segment and the edge along e_i that their separating direction points to do not pass each other."""
    b = axis(i, 1.0)
    y = edge_of(bits(edge_normal(b, u, over)), i, h)
    return s <= 0.0 or on_edges(c, u, half, y, b, h[i], TIE)


@inner_kernel
def nearest_corner(c: Vec3, u: Vec3, half: float, h: Vec3) -> int:
    """The corner of the box nearest to the segment; 0 where an end of the segment is nearer to the box."""
    d2 = min(distance_squared(along(c, -half, u), h), distance_squared(along(c, half, u), h))
    near = -1
    for k in range(8):
        y = corner(k, h)
        t = dot(u, y) - dot(u, c)
        if abs(t) < half:
            z = along(c, t, u)
            e = (z[0] - y[0], z[1] - y[1], z[2] - y[2])
            e2 = dot(e, e)
            if e2 < d2 * (1.0 - TIE):
                near, d2 = k, e2
    return code_of(SEGMENT_CORNER, (0, 1.0, 0, 1.0), 0, near) if near >= 0 else 0


@inner_kernel
def edge_end(k: int, c: Vec3, u: Vec3, half: float, h: Vec3) -> int:
    """Corner k = 0, 1 of the edge most parallel to the segment, on its side of the box; 0 where it is past its ends."""
    i = 0 if abs(u[0]) >= abs(u[1]) and abs(u[0]) >= abs(u[2]) else (1 if abs(u[1]) >= abs(u[2]) else 2)
    other = bits(c) & (7 - (1 << i))
    if k == 1:
        other |= 1 << i
    y = corner(other, h)
    return code_of(SEGMENT_CORNER, (0, 1.0, 0, 1.0), 0, other) if abs(dot(u, y) - dot(u, c)) < half else 0
