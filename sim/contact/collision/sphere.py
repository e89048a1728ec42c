"""Sphere against sphere, capsule, box and cylinder; a string between two points."""

from __future__ import annotations

from sim.contact.collision.box import vertex_on_box
from sim.contact.collision.cylinder import nearest, vertex_on_cylinder
from sim.contact.collision.witness import LINE, NOWHERE, TIE, Z, bend_line, bend_point, direction, vertex_a
from sim.model.record_columns import PairSize, Witness
from solvers.compiler import inner_kernel
from solvers.rotation import three
from solvers.types import Vector


@inner_kernel
def sphere_sphere(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = |r| - ra - rb; of concentric spheres the normal is z."""
    x = (r[0], r[1], r[2])
    n, d = direction(x, NOWHERE, NOWHERE)
    vertex_a(x, n, NOWHERE, d, (sizes[0], sizes[PairSize.B]), bend_point(d), NOWHERE, out)


@inner_kernel
def sphere_capsule(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = |r - y| - ra - rb, y the nearest point of the segment of b; a centre on the segment has the normal x."""
    x, half = (r[0], r[1], r[2]), sizes[PairSize.B + 1]
    if abs(x[2]) <= half * (1.0 + TIE):
        n, d = direction(x, (0.0, 0.0, x[2]), Z)
        u, bend, slip = Z, bend_line(d), LINE
    else:
        n, d = direction(x, (0.0, 0.0, half if x[2] > 0.0 else -half), NOWHERE)
        u, bend, slip = NOWHERE, bend_point(d), NOWHERE
    vertex_a(x, n, u, d, (sizes[0], sizes[PairSize.B]), bend, slip, out)


@inner_kernel
def sphere_box(sizes: Vector, r: Vector, out: Vector) -> None:
    """Distance to the nearest face, edge or corner; a centre inside is pushed out of the nearest face."""
    vertex_on_box((r[0], r[1], r[2]), three(sizes, PairSize.B), sizes[0], out)


@inner_kernel
def sphere_cylinder(sizes: Vector, r: Vector, out: Vector) -> None:
    """Distance to the side, an end face or a rim; a centre inside is pushed out of the nearest of side and ends."""
    x, rho, half = (r[0], r[1], r[2]), sizes[PairSize.B], sizes[PairSize.B + 1]
    vertex_on_cylinder(nearest(x, rho, half), x, sizes[0], rho, half, out)


@inner_kernel
def string(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = length - |r|, between the origins of the two frames; n points from a to b: a taut string pulls."""
    x = (r[0], r[1], r[2])
    m, d = direction(x, NOWHERE, NOWHERE)
    vertex_a(x, m, NOWHERE, d, (0.0, 0.0), bend_point(d), NOWHERE, out)
    out[Witness.GAP] = sizes[0] - d
    for i in range(1, 4):
        out[i] = -out[i]
    for i in range(7, 25):
        out[i] = -out[i]
