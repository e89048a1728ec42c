"""Sphere against sphere, capsule, box and cylinder; a string between two points."""

from __future__ import annotations

from sim.collision.box import vertex_on_box
from sim.collision.witness import FACE, LINE, NOWHERE, TIE, Z, bend_line, bend_point, direction, vertex_a
from sim.model import Vector
from solvers.jit import inner_kernel


@inner_kernel
def sphere_sphere(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = |r| - ra - rb; of concentric spheres the normal is z."""
    x = (r[0], r[1], r[2])
    n, d = direction(x, NOWHERE, NOWHERE)
    vertex_a(x, n, NOWHERE, d, (sizes[0], sizes[4]), bend_point(d), NOWHERE, out)


@inner_kernel
def sphere_capsule(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = |r - y| - ra - rb, y the nearest point of the segment of b; a centre on the segment has the normal x."""
    x, half = (r[0], r[1], r[2]), sizes[5]
    if abs(x[2]) <= half * (1.0 + TIE):
        n, d = direction(x, (0.0, 0.0, x[2]), Z)
        u, bend, slip = Z, bend_line(d), LINE
    else:
        n, d = direction(x, (0.0, 0.0, half if x[2] > 0.0 else -half), NOWHERE)
        u, bend, slip = NOWHERE, bend_point(d), NOWHERE
    vertex_a(x, n, u, d, (sizes[0], sizes[4]), bend, slip, out)


@inner_kernel
def sphere_box(sizes: Vector, r: Vector, out: Vector) -> None:
    """Distance to the nearest face, edge or corner; a centre inside is pushed out of the nearest face."""
    vertex_on_box((r[0], r[1], r[2]), (sizes[4], sizes[5], sizes[6]), sizes[0], out)


@inner_kernel
def sphere_cylinder(sizes: Vector, r: Vector, out: Vector) -> None:
    """Distance to the side, an end face or a rim; a centre inside is pushed out of the nearest of side and ends.

    Around a rim of radius rho: dy = (rho/|r_xy|) t t^T delta, K = (I - n n^T - t t^T)/d + (n.e/|r_xy|) t t^T, with e
    the radial and t the tangential direction.
    """
    x, radius, rho, half = (r[0], r[1], r[2]), sizes[0], sizes[4], sizes[5]
    top = 1.0 if x[2] >= 0.0 else -1.0
    e, a = direction((x[0], x[1], 0.0), NOWHERE, Z)
    high = abs(x[2]) - half
    u, bend, slip, rb = NOWHERE, NOWHERE, FACE, 0.0
    if a - rho <= rho * TIE and (high > half * TIE or high >= a - rho):
        n, d = (0.0, 0.0, top), high
    elif high <= half * TIE:
        n, d, rb = e, a, rho
        u, bend, slip = Z, bend_line(d), LINE
    else:
        y = (rho * e[0], rho * e[1], top * half)
        n, d = direction(x, y, NOWHERE)
        k = bend_point(d)[0]
        u = (-e[1], e[0], 0.0)
        bend, slip = (k, -k, (n[0] * e[0] + n[1] * e[1]) / a - k), (0.0, 0.0, rho / a)
    vertex_a(x, n, u, d, (radius, rb), bend, slip, out)


@inner_kernel
def string(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = length - |r|, between the origins of the two frames; n points from a to b: a taut string pulls."""
    x = (r[0], r[1], r[2])
    m, d = direction(x, NOWHERE, NOWHERE)
    vertex_a(x, m, NOWHERE, d, (0.0, 0.0), bend_point(d), NOWHERE, out)
    out[0] = sizes[0] - d
    for i in range(1, 4):
        out[i] = -out[i]
    for i in range(7, 25):
        out[i] = -out[i]
