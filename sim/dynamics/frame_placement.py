"""Frames fixed to a body, or to the world: those of shapes, and of the joints that close loops."""

from __future__ import annotations

from solvers.compiler import kernel
from solvers.rotation import rotate
from solvers.types import Matrix, Vector


@kernel
def place_frame(c: Vector, C: Vector, i: int, pos: Matrix, rot: Matrix, p: Vector, R: Vector) -> None:
    """p = x_i + R_i c and R = R_i C, world axes, of the frame (c, C) on body i; (c, C) itself on the world, i = -1.

    c, p: (3,); C, R: (9,) rotation matrices, row-major; pos: (nbody, 3), rot: (nbody, 9) poses of the bodies.
    """
    if i < 0:
        for k in range(3):
            p[k] = c[k]
        for k in range(9):
            R[k] = C[k]
        return
    x, y, z = rotate(rot, i, c[0], c[1], c[2])
    p[0] = pos[i, 0] + x
    p[1] = pos[i, 1] + y
    p[2] = pos[i, 2] + z
    for k in range(3):
        x, y, z = rotate(rot, i, C[k], C[3 + k], C[6 + k])
        R[k] = x
        R[3 + k] = y
        R[6 + k] = z
