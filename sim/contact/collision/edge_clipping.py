"""An edge of a, clipped by a rectangular face of b along the normal of the face.

    0         nothing: the edge does not begin (end) here
    1         at its own vertex
    2 + side  where it crosses a side of the face: 2 m + (1 on the + side), m = 0, 1 the coordinate that is constant

A vertex on the border is inside. An edge almost parallel to a side is inside of it or outside, as a whole: where two
lines cross at a small angle, the normal that they share turns fast.
"""

from __future__ import annotations

from sim.contact.collision.witness import along, axis, dot
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3, cross

BORDER = 1e-4  # a vertex this far outside of a face still belongs to it (relative)
_ALONG = 1e-2  # sine of the angle below which an edge is parallel to a side
PAST = 2e-2  # closest points of two lines this far past the ends of their edges still belong to them (relative)

Vec2 = tuple[float, float]


@inner_kernel
def clip(a: Vec2, b: Vec2, h: Vec2) -> tuple[int, int]:
    """Begin and end of the edge from a to b in the rectangle |y0| <= h0, |y1| <= h1."""
    e = (b[0] - a[0], b[1] - a[1])
    first = 0 if abs(e[0]) >= abs(e[1]) else 1
    flat = _ALONG * abs(e[first])
    t0, t1, side0, side1 = 0.0, 1.0, -1, -1
    for k in range(2):
        m = first if k == 0 else 1 - first
        if abs(e[m]) <= flat:
            if abs(a[m] + 0.5 * (t0 + t1) * e[m]) > h[m] * (1.0 + BORDER):
                t1 = t0 - 1.0
            continue
        s = 1.0 if e[m] > 0.0 else -1.0
        enter, leave = (-s * h[m] - a[m]) / e[m], (s * h[m] - a[m]) / e[m]
        if enter > t0:
            t0, side0 = enter, 2 * m + (1 if s < 0.0 else 0)
        if leave < t1:
            t1, side1 = leave, 2 * m + (1 if s > 0.0 else 0)
    return _code(a, h, side0, t0 < t1), _code(b, h, side1, t0 < t1)


@inner_kernel
def _code(a: Vec2, h: Vec2, side: int, overlap: bool) -> int:
    if abs(a[0]) <= h[0] * (1.0 + BORDER) and abs(a[1]) <= h[1] * (1.0 + BORDER):
        return 1
    if not overlap:
        return 0
    return 2 + side if side >= 0 else 1


@inner_kernel
def side_edge(side: int, i: int, top: float, h: Vec3) -> tuple[Vec3, Vec3, float]:
    """Centre, direction and half length of the edge of b at `side` of its face `top` e_i (top = 1, -1)."""
    m, o = (i + 1) % 3, (i + 2) % 3
    if side > 1:
        m, o = o, m
    return along(axis(i, top * h[i]), h[m] if side & 1 else -h[m], axis(m, 1.0)), axis(o, 1.0), h[o]


@inner_kernel
def on_edges(x: Vec3, ua: Vec3, la: float, y: Vec3, ub: Vec3, lb: float, past: float) -> bool:
    """Whether the closest points of two lines lie on the edges |s| <= la, |t| <= lb around x, y, or `past` them."""
    c = dot(ua, ub)
    e = (x[0] - y[0], x[1] - y[1], x[2] - y[2])
    ea, eb, s2 = dot(ua, e), dot(ub, e), 1.0 - c * c
    return abs(c * eb - ea) <= s2 * la * (1.0 + past) and abs(eb - c * ea) <= s2 * lb * (1.0 + past)


@inner_kernel
def edge_normal(ub: Vec3, ua: Vec3, over: float) -> Vec3:
    """Unit vector along `over` ub x ua (over = 1, -1)."""
    n = cross(ub[0], ub[1], ub[2], ua[0], ua[1], ua[2])
    k = over * dot(n, n) ** 0.5
    return n[0] / k, n[1] / k, n[2] / k


@inner_kernel
def common_normal(ua: Vec3, ub: Vec3, out_of: Vec3) -> Vec3:
    """Unit vector along ua x ub, on the side of `out_of`."""
    n = cross(ua[0], ua[1], ua[2], ub[0], ub[1], ub[2])
    k = dot(n, n) ** 0.5
    if dot(n, out_of) < 0.0:
        k = -k
    return n[0] / k, n[1] / k, n[2] / k
