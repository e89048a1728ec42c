"""A point against a box; the edges and corners of a box."""

from __future__ import annotations

from sim.collision.witness import FACE, LINE, NOWHERE, TIE, axis, bend_line, bend_point, direction, vertex_a, vertex_b
from sim.model import Vector
from sim.rotation import Vec3
from solvers.compiler import inner_kernel


@inner_kernel
def column(R: Vector, j: int) -> Vec3:
    """Column j of R (9,), row-major: axis j of a in the frame of b."""
    return R[j], R[3 + j], R[6 + j]


@inner_kernel
def to_b(R: Vector, x: Vec3) -> Vec3:
    """R x"""
    return (
        R[0] * x[0] + R[1] * x[1] + R[2] * x[2],
        R[3] * x[0] + R[4] * x[1] + R[5] * x[2],
        R[6] * x[0] + R[7] * x[1] + R[8] * x[2],
    )


@inner_kernel
def to_a(R: Vector, x: Vec3) -> Vec3:
    """R^T x"""
    return (
        R[0] * x[0] + R[3] * x[1] + R[6] * x[2],
        R[1] * x[0] + R[4] * x[1] + R[7] * x[2],
        R[2] * x[0] + R[5] * x[1] + R[8] * x[2],
    )


@inner_kernel
def corner(k: int, h: Vec3) -> Vec3:
    """Corner k = 0..7 of a box with half extents h; the bits of k are the signs."""
    return (h[0] if k & 1 else -h[0]), (h[1] if k & 2 else -h[1]), (h[2] if k & 4 else -h[2])


@inner_kernel
def bits(n: Vec3) -> int:
    """The corner of a box farthest along n."""
    return (1 if n[0] >= 0.0 else 0) + (2 if n[1] >= 0.0 else 0) + (4 if n[2] >= 0.0 else 0)


@inner_kernel
def distance_squared(x: Vec3, h: Vec3) -> float:
    """Squared distance of a point to the solid box."""
    a, b, c = max(abs(x[0]) - h[0], 0.0), max(abs(x[1]) - h[1], 0.0), max(abs(x[2]) - h[2], 0.0)
    return a * a + b * b + c * c


@inner_kernel
def nearest(x: Vec3, h: Vec3) -> tuple[Vec3, Vec3, float, int]:
    """Normal n, direction u of the edge, distance d and kind (1 face, 2 edge, 3 corner) of a box at the point x.

    Inside, the nearest face; of equally near faces the first of x, y, z, and its + side.
    """
    g = (abs(x[0]) - h[0], abs(x[1]) - h[1], abs(x[2]) - h[2])
    outside, best = 0, 0
    for i in range(3):
        if g[i] > TIE * h[i]:
            outside += 1
        if g[i] > g[best]:
            best = i
    if outside <= 1:
        return axis(best, 1.0 if x[best] >= 0.0 else -1.0), NOWHERE, g[best], 1
    y = (min(max(x[0], -h[0]), h[0]), min(max(x[1], -h[1]), h[1]), min(max(x[2], -h[2]), h[2]))
    if outside == 3:
        n, d = direction(x, y, NOWHERE)
        return n, NOWHERE, d, 3
    inside = 0
    for i in range(3):
        if g[i] < g[inside]:
            inside = i
    u = axis(inside, 1.0)
    c = x[inside]
    y = ((c if inside == 0 else y[0]), (c if inside == 1 else y[1]), (c if inside == 2 else y[2]))
    n, d = direction(x, y, u)
    return n, u, d, 2


@inner_kernel
def curvature(kind: int, d: float) -> tuple[Vec3, Vec3]:
    """Bend and slip (witness.vertex_a) around a face, edge or corner of `nearest`."""
    if kind == 1:
        return NOWHERE, FACE
    if kind == 2:
        return bend_line(d), LINE
    return bend_point(d), NOWHERE


@inner_kernel
def vertex_on_box(x: Vec3, h: Vec3, radius: float, out: Vector) -> None:
    """Vertex x of a, with a radius around it, against the box b."""
    n, u, d, kind = nearest(x, h)
    bend, slip = curvature(kind, d)
    vertex_a(x, n, u, d, (radius, 0.0), bend, slip, out)


@inner_kernel
def vertex_under_box(y: Vec3, h: Vec3, R: Vector, r: Vector, out: Vector) -> None:
    """Vertex y of b against the box a."""
    m, w, d, kind = nearest(to_a(R, (y[0] - r[0], y[1] - r[1], y[2] - r[2])), h)
    bend, slip = curvature(kind, d)
    n = to_b(R, m)
    vertex_b(y, (-n[0], -n[1], -n[2]), to_b(R, w), d, (0.0, 0.0), bend, slip, out)
