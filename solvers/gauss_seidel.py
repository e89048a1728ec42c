"""Block Gauss-Seidel for contacts with friction: Jourdan, Alart, Jean, Comput. Methods Appl. Mech. Eng. 155, 1998.

    w = w0 + G l,    w_n l_n = kappa,   w_n, l_n > 0,    |l_t| <= mu l_n, against the slip w_t where it is mu l_n

Rows 3 i, 3 i + 1, 3 i + 2 are normal and tangents of contact i; rows behind the contacts are normals alone.
"""

from __future__ import annotations

from math import sqrt

from solvers.compiler import kernel
from solvers.cones import onto_path
from solvers.types import Matrix, Vector

_SWEEPS, _SMALL = 20, 1e-2
_STILL = 0.1  # of the tolerance of the sweeps: a row that would move less stays, and moves no others


@kernel
def relax_normal(columns: Matrix, j: int, kappa: float, still: float, size: int, w: Vector, l: Vector) -> float:
    """l_j such that w_j l_j = kappa, unless that moves w_j by less than `still`; returns how much it moves it."""
    g = columns[j]
    _, new = onto_path(w[j], l[j], g[j], kappa)
    d = new - l[j]
    moved = abs(g[j] * d)
    if moved > still:
        l[j] = new
        for k in range(size):
            w[k] += g[k] * d
    return moved


@kernel
def relax_friction(columns: Matrix, j: int, bound: float, still: float, size: int, w: Vector, l: Vector) -> float:
    """(l_j, l_j+1) such that the slip vanishes, or at the bound against it; as relax_normal with the slip."""
    g, f = columns[j], columns[j + 1]
    a, b, c, d = g[j], f[j], g[j + 1], f[j + 1]
    i = 1.0 / (a * d - b * c)
    x = l[j] - i * (d * w[j] - b * w[j + 1])
    y = l[j + 1] - i * (a * w[j + 1] - c * w[j])
    if x * x + y * y > bound * bound:
        e = 1.0 / max(a, d)
        x, y = l[j] - e * w[j], l[j + 1] - e * w[j + 1]
        n = x * x + y * y
        if n > bound * bound:
            i = bound / sqrt(n)
            x, y = i * x, i * y
    x, y = x - l[j], y - l[j + 1]
    moved = max(a * abs(x), d * abs(y))
    if moved > still:
        l[j], l[j + 1] = l[j] + x, l[j + 1] + y
        for k in range(size):
            w[k] += g[k] * x + f[k] * y
    return moved


@kernel
def gauss_seidel(
    columns: Matrix, friction: Vector, h: float, kappa: float, points: int, size: int, w: Vector, l: Vector
) -> bool:
    """Improve l, and w with it, until a sweep moves w by less than a hundredth of the first sweep; returns whether
    it converged.

    columns: (n, n) G transposed, of which size x size are used;  friction: (n,), of contact i in 3 i;
    h: the time in which a slip becomes a gap, for w_n are lengths and w_t speeds;  points: contacts;  w: (n,) of l.
    """
    enough = 0.0
    for sweep in range(_SWEEPS):
        moved = 0.0
        still = _STILL * enough
        for j in range(0, 3 * points, 3):
            moved = max(moved, relax_normal(columns, j, kappa, still, size, w, l))
            moved = max(moved, h * relax_friction(columns, j + 1, friction[j] * l[j], still / h, size, w, l))
        for j in range(3 * points, size):
            moved = max(moved, relax_normal(columns, j, kappa, still, size, w, l))
        if sweep == 0:
            enough = _SMALL * moved
        if moved <= enough:
            return True
    return False
