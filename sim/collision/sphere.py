"""Sphere against sphere, capsule, box and cylinder; a string between two points."""

from __future__ import annotations

from sim.collision.witness import bend_line, bend_point, direction, vertex_a
from sim.model import Vector
from sim.rotation import Vec3
from solvers.jit import kernel

_ZERO = (0.0, 0.0, 0.0)
_X = (1.0, 0.0, 0.0)
_Y = (0.0, 1.0, 0.0)
_Z = (0.0, 0.0, 1.0)
_FACE = (1.0, -1.0, 0.0)  # a plane: dy = (I - n n^T) delta
_LINE = (0.0, 0.0, 1.0)  # a line: dy = u u^T delta
_TIE = 1e-9  # a point this far beyond the end of an element still belongs to it (relative)


@kernel
def sphere_sphere(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = |r| - ra - rb; of concentric spheres the normal is z."""
    x = (r[0], r[1], r[2])
    n, d = direction(x, _ZERO, _ZERO)
    vertex_a(x, n, _ZERO, d, (sizes[0], sizes[4]), bend_point(d), _ZERO, out)


@kernel
def sphere_capsule(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = |r - y| - ra - rb, y the nearest point of the segment of b; a centre on the segment has the normal x."""
    x = (r[0], r[1], r[2])
    point_segment(x, sizes[5], (sizes[0], sizes[4]), out)


@kernel
def point_segment(x: Vec3, half: float, radii: tuple[float, float], out: Vector) -> None:
    """Vertex x of a against the segment |z| <= half of b."""
    if abs(x[2]) <= half * (1.0 + _TIE):
        n, d = direction(x, (0.0, 0.0, x[2]), _Z)
        vertex_a(x, n, _Z, d, radii, bend_line(d), _LINE, out)
    else:
        n, d = direction(x, (0.0, 0.0, half if x[2] > 0.0 else -half), _ZERO)
        vertex_a(x, n, _ZERO, d, radii, bend_point(d), _ZERO, out)


@kernel
def string(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = length - |r|, between the origins of the two frames; n points from a to b: a taut string pulls."""
    x = (r[0], r[1], r[2])
    m, d = direction(x, _ZERO, _ZERO)
    k = bend_point(d)
    vertex_a(x, m, _ZERO, d, (0.0, 0.0), k, _ZERO, out)
    out[0] = sizes[0] - d
    for i in range(3):
        out[1 + i] = -out[1 + i]
    for i in range(7, 25):
        out[i] = -out[i]
