"""Columns of the derivatives of wrenches by unit twists about O: displacements of points, and their effect on F."""

from __future__ import annotations

from sim.model.data import Data
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross
from solvers.types import Matrix, Vector


@kernel
def unit_vector(k: int) -> Vec3:
    """e_k"""
    return 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0


@kernel
def point_shift(k: int, x: float, y: float, z: float) -> Vec3:
    """Displacement of the point (x, y, z) from O by the unit twist k about O."""
    if k < 3:
        return unit_vector(k)
    e = unit_vector(k - 3)
    return cross(e[0], e[1], e[2], x, y, z)


@kernel
def center_shift(data: Data, pos: Matrix, i: int, k: int) -> Vec3:
    """Displacement of the centre of mass of body i by the unit twist k about O."""
    o = data.origin
    return point_shift(k, pos[i, 0] - o[0], pos[i, 1] - o[1], pos[i, 2] - o[2])


@kernel
def add_wrench_column(K: Vector, k: int, f: Vec3, df: Vec3, P: Vec3, dP: Vec3) -> None:
    """Column k of K (6 x 6) += (df, dP x f + P x df)."""
    a = cross(dP[0], dP[1], dP[2], f[0], f[1], f[2])
    b = cross(P[0], P[1], P[2], df[0], df[1], df[2])
    for r in range(3):
        K[6 * r + k] += df[r]
        K[18 + 6 * r + k] += a[r] + b[r]
