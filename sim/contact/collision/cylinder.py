"""A point against a cylinder along the z axis of its frame: an end, the side, or a rim; the extent of a cylinder."""

from __future__ import annotations

from math import sqrt

from sim.contact.collision.witness import FACE, LINE, NOWHERE, TIE, Z, bend_line, bend_point, direction, vertex_a
from solvers.compiler import inner_kernel
from solvers.rotation import Vec3
from solvers.types import Vector

# elements of a cylinder; those on the side of -z are one more than those on +z
TOP, BOTTOM, SIDE, RIM_TOP, RIM_BOTTOM = 1, 2, 3, 4, 5


@inner_kernel
def reach(n: Vec3, rho: float, half: float) -> float:
    """Largest n.x over the points x of a cylinder of radius rho and half length half."""
    return rho * sqrt(n[0] * n[0] + n[1] * n[1]) + half * abs(n[2])


@inner_kernel
def nearest(x: Vec3, rho: float, half: float) -> int:
    """The element nearest to a point; inside, the nearest of side and ends."""
    below = 0 if x[2] >= 0.0 else 1
    a = sqrt(x[0] * x[0] + x[1] * x[1]) - rho
    high = abs(x[2]) - half
    if a <= rho * TIE and (high > half * TIE or high >= a):
        return TOP + below
    return SIDE if high <= half * TIE else RIM_TOP + below


@inner_kernel
def vertex_on_cylinder(where: int, x: Vec3, radius: float, rho: float, half: float, out: Vector) -> None:
    """Vertex x of a, with a radius around it, against the element `where` of the cylinder b.

    Around a rim of radius rho: dy = (rho/|x_xy|) t t^T delta, K = (I - n n^T - t t^T)/d + (n.e/|x_xy|) t t^T, with e
    the radial and t the tangential direction.
    """
    if where == TOP or where == BOTTOM:
        top = 1.0 if where == TOP else -1.0
        vertex_a(x, (0.0, 0.0, top), NOWHERE, top * x[2] - half, (radius, 0.0), NOWHERE, FACE, out)
        return
    e, a = direction((x[0], x[1], 0.0), NOWHERE, Z)
    if where == SIDE:
        vertex_a(x, e, Z, a, (radius, rho), bend_line(a), LINE, out)
        return
    n, d = direction(x, (rho * e[0], rho * e[1], half if where == RIM_TOP else -half), NOWHERE)
    k = bend_point(d)[0]
    bend = (k, -k, (n[0] * e[0] + n[1] * e[1]) / a - k)
    vertex_a(x, n, (-e[1], e[0], 0.0), d, (radius, 0.0), bend, (0.0, 0.0, rho / a), out)
