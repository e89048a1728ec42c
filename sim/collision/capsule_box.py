"""Capsule against box: a segment with a radius around it.

    feature 0, 1    begin and end of the part of the segment above the nearest face of the box: an end of the segment,
                    or where it crosses an edge of the face
    feature 2       elsewhere: the nearest edge or corner of the box

The normal of a face, of an edge across the segment, or between two points, each exact for its pair of elements. Deep
inside, where the segment itself cuts the box, the face or edge of least penetration decides.
"""

from __future__ import annotations

from math import sqrt

from sim.collision.axes import (
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
    support,
)
from sim.collision.box import corner, distance_squared, nearest, vertex_on_box
from sim.collision.clip import clip, crossing, edge_normal, on_edges
from sim.collision.witness import (
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
from sim.model import Vector
from sim.rotation import Vec3
from solvers.jit import inner_kernel


@inner_kernel
def capsule_box(feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    """Contact point `feature` of a capsule along the z axis of its frame against a box."""
    c, u = (r[0], r[1], r[2]), (R[2], R[5], R[8])
    radius, half, h = sizes[0], sizes[1], (sizes[4], sizes[5], sizes[6])
    face, edge, s, top, over = arrangement
    x, y = along(c, -half, u), along(c, half, u)
    m, o = (face + 1) % 3, (face + 2) % 3
    codes = clip((x[m], x[o]), (y[m], y[o]), (h[m], h[o]))
    if feature < 2:
        code = codes[feature]
        if feature == 1:
            x = y
        if code > 1:
            if not crossing(c, u, half, code - 2, face, top, h, radius, out):
                code = 0
        elif code == 1:
            vertex_a(x, axis(face, top), NOWHERE, top * x[face] - h[face], (radius, 0.0), NOWHERE, FACE, out)
        if code == 0 or out[0] + radius < deepest(s, h):
            absent(out)
    elif edge >= 0 and put_edge(edge, c, u, half, h, s, over, radius, out):
        side = side_of(edge, (out[1], out[2], out[3]), face, top)
        if side >= 0 and (codes[0] == 2 + side or codes[1] == 2 + side):
            absent(out)
    elif s <= 0.0 or not put_vertex(c, u, half, h, radius, out):
        absent(out)


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
def put_edge(
    i: int, c: Vec3, u: Vec3, half: float, h: Vec3, s: float, over: float, radius: float, out: Vector
) -> bool:
    """Segment against the edge along e_i that its separating direction points to; False where they pass each other."""
    b = axis(i, 1.0)
    n = edge_normal(b, u, over)
    y = support(n, i, h)
    if s > 0.0 and not on_edges(c, u, half, y, b, h[i], TIE):
        return False
    edges(c, u, y, b, n, (radius, 0.0), out)
    return True


@inner_kernel
def put_vertex(c: Vec3, u: Vec3, half: float, h: Vec3, radius: float, out: Vector) -> bool:
    """An end of the segment against an edge or corner of the box, or a corner of the box against the segment.

    False where neither is the nearest pair: the direction between them does not separate the two.
    """
    x, y = along(c, -half, u), along(c, half, u)
    d2 = distance_squared(x, h)
    e2 = distance_squared(y, h)
    if e2 < d2:
        x, d2 = y, e2
    near, at, at_end = x, 0.0, True
    for k in range(8):
        y = corner(k, h)
        t = dot(u, y) - dot(u, c)
        if abs(t) < half:
            z = along(c, t, u)
            e = (z[0] - y[0], z[1] - y[1], z[2] - y[2])
            e2 = dot(e, e)
            if e2 < d2 * (1.0 - TIE):
                near, at, at_end, d2 = y, t, False, e2
    if at_end:
        if nearest(x, h)[3] == 1:
            return False
        vertex_on_box(x, h, radius, out)
    else:
        n, d = direction(along(c, at, u), near, u)
        vertex_b(near, n, u, d, (radius, 0.0), bend_line(d), LINE, out)
    n = (out[1], out[2], out[3])
    reach = half * abs(dot(n, u)) + abs(n[0]) * h[0] + abs(n[1]) * h[1] + abs(n[2]) * h[2]
    return dot(n, c) - reach >= out[0] + radius - TIE * (half + h[0] + h[1] + h[2])
