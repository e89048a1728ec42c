"""Block Gauss-Seidel for hard contacts with friction: Jourdan, Alart, Jean, Comput. Methods Appl. Mech. Eng. 155, 1998.

    w = w0 + G l,    w_n l_n = kappa,   w_n, l_n > 0,    |l_t| <= mu l_n, against the slip w_t where it is mu l_n

Rows 3 i, 3 i + 1, 3 i + 2 are normal and tangents of contact i; rows behind the contacts are normals alone.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from solvers.cones import onto_path
from solvers.jit import kernel

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_SWEEPS, _SMALL = 20, 1e-3


@kernel
def _push(columns: Matrix, j: int, d: float, size: int, w: Vector) -> None:
    """w += G e_j d"""
    g = columns[j]
    for k in range(size):
        w[k] += g[k] * d


@kernel
def relax_normal(columns: Matrix, j: int, kappa: float, size: int, w: Vector, l: Vector) -> float:
    """l_j such that w_j l_j = kappa; returns how much that moves w_j."""
    g = columns[j, j]
    _, new = onto_path(w[j], l[j], g, kappa)
    d = new - l[j]
    l[j] = new
    _push(columns, j, d, size, w)
    return abs(g * d)


@kernel
def relax_friction(columns: Matrix, j: int, bound: float, size: int, w: Vector, l: Vector) -> float:
    """(l_j, l_j+1) such that the slip vanishes, or at the bound against it; returns how much that moves the slip."""
    a, b, c, d = columns[j, j], columns[j + 1, j], columns[j, j + 1], columns[j + 1, j + 1]
    i = 1.0 / (a * d - b * c)
    x = l[j] - i * (d * w[j] - b * w[j + 1])
    y = l[j + 1] - i * (a * w[j + 1] - c * w[j])
    if x * x + y * y > bound * bound:
        e = 1.0 / max(a, d)
        x, y = l[j] - e * w[j], l[j + 1] - e * w[j + 1]
        n = sqrt(x * x + y * y)
        if n > bound:
            x, y = x * bound / n, y * bound / n
    x, y = x - l[j], y - l[j + 1]
    l[j], l[j + 1] = l[j] + x, l[j + 1] + y
    _push(columns, j, x, size, w)
    _push(columns, j + 1, y, size, w)
    return max(a * abs(x), d * abs(y))


@kernel
def gauss_seidel(
    columns: Matrix, friction: Vector, h: float, kappa: float, points: int, size: int, w: Vector, l: Vector
) -> None:
    """Improve l, and w with it, until a sweep moves w by less than a thousandth of what the first one did.

    columns: (n, n) G transposed, of which size x size are used;  friction: (n,), of contact i in 3 i;
    h: the time in which a slip becomes a gap, for w_n are lengths and w_t speeds;  points: contacts;  w: (n,) of l.
    """
    first = 0.0
    for _ in range(_SWEEPS):
        moved = 0.0
        for j in range(0, 3 * points, 3):
            moved = max(moved, relax_normal(columns, j, kappa, size, w, l))
            moved = max(moved, h * relax_friction(columns, j + 1, friction[j] * l[j], size, w, l))
        for j in range(3 * points, size):
            moved = max(moved, relax_normal(columns, j, kappa, size, w, l))
        first = max(first, moved)
        if moved <= _SMALL * first:
            return
