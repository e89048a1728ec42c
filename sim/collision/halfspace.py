"""Sphere, capsule, box and cylinder against the half-space z <= 0 of b."""

from __future__ import annotations

from sim.collision.witness import vertex_a
from sim.model import Vector
from sim.rotation import Vec3
from solvers.jit import kernel

_ZERO = (0.0, 0.0, 0.0)
_Z = (0.0, 0.0, 1.0)
_FACE = (1.0, -1.0, 0.0)


@kernel
def point_plane(x: Vec3, radius: float, out: Vector) -> None:
    """phi = x_z - radius"""
    vertex_a(x, _Z, _ZERO, x[2], (radius, 0.0), _ZERO, _FACE, out)


@kernel
def sphere_halfspace(sizes: Vector, r: Vector, out: Vector) -> None:
    """phi = r_z - radius"""
    point_plane((r[0], r[1], r[2]), sizes[0], out)
