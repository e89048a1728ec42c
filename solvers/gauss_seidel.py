"""Block Gauss-Seidel for contacts with friction: Jourdan, Alart, Jean, Comput. Methods Appl. Mech. Eng. 155, 1998.

    w = w0 + G l,    w_n l_n = kappa,   w_n, l_n > 0,    |l_t| <= mu l_n, against the slip w_t where it is mu l_n

Rows 3 i, 3 i + 1, 3 i + 2 are normal and tangents of contact i; rows behind the contacts are normals alone.
"""

from __future__ import annotations

from math import sqrt

from solvers.compiler import kernel
from solvers.cones import onto_path
from solvers.types import Matrix, Vector

_SWEEPS, _SMALL = 40, 1e-2
_EVERY, _SLOW = 5, 0.7  # sweeps between leaps; how much each moves w over the one before it, where they are slow
_ROOM = 0.9  # of the way to where a normal impulse ends
_FLAT = 1e-9  # share of the product of its diagonal below which the determinant of two tangents is rounding
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
    """(l_j, l_j+1) such that the slip vanishes, or at the bound against it; as relax_normal with the slip.

    A contact of a planar robot slips along one line only, and the block of a tangent across it has no inverse: of
    g t t^T, with a slip along t, it is t t^T/g.
    """
    g, f = columns[j], columns[j + 1]
    a, b, c, d = g[j], f[j], g[j + 1], f[j + 1]
    if not a + d > 0.0:
        return 0.0
    if a * d - b * c > _FLAT * a * d:
        i = 1.0 / (a * d - b * c)
        x = l[j] - i * (d * w[j] - b * w[j + 1])
        y = l[j + 1] - i * (a * w[j + 1] - c * w[j])
    else:
        x, y = l[j] - w[j] / (a + d), l[j + 1] - w[j + 1] / (a + d)
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
def sweep(
    columns: Matrix,
    friction: Vector,
    h: float,
    kappa: float,
    sizes: tuple[int, int],
    still: float,
    w: Vector,
    l: Vector,
) -> float:
    """All rows once; returns how much w moved at most, slips over h."""
    points, size = sizes
    moved = 0.0
    for j in range(0, 3 * points, 3):
        moved = max(moved, relax_normal(columns, j, kappa, still, size, w, l))
        moved = max(moved, h * relax_friction(columns, j + 1, friction[j] * l[j], still / h, size, w, l))
    for j in range(3 * points, size):
        moved = max(moved, relax_normal(columns, j, kappa, still, size, w, l))
    return moved


@kernel
def leap(columns: Matrix, ratio: float, sizes: tuple[int, int], change: Vector, w: Vector, l: Vector) -> None:
    """l and w further along the change of l in the last sweep, by the sum of the geometric series of this ratio, unless
    normals end before that: by _ROOM of the way to the first of them.

    Between two corners of one foot, whose columns are nearly the same, sweeps move the load by the same small amount
    hundreds of times.
    """
    points, size = sizes
    t = 1e300 if ratio >= 1.0 else ratio / (1.0 - ratio)
    for j in range(size):
        if (j >= 3 * points or j % 3 == 0) and change[j] < 0.0:
            t = min(t, -_ROOM * l[j] / change[j])
    if t == 1e300:
        return
    for j in range(size):
        d = t * change[j]
        l[j] += d
        for k in range(size):
            w[k] += columns[j, k] * d


@kernel
def gauss_seidel(
    columns: Matrix,
    friction: Vector,
    h: float,
    kappa: float,
    sizes: tuple[int, int],
    w: Vector,
    l: Vector,
    change: Vector,
) -> bool:
    """Improve l, and w with it, until a sweep moves w by less than a hundredth of the first sweep; returns whether
    it converged.

    columns: (n, n) G transposed, of which size x size are used;  friction: (n,), of contact i in 3 i;
    h: the time in which a slip becomes a gap, for w_n are lengths and w_t speeds;  sizes: contacts, rows;
    w: (n,) of l;  change: (n,) scratch.
    """
    enough, before = 0.0, 0.0
    for k in range(_SWEEPS):
        last = k % _EVERY == _EVERY - 1
        if last:
            for j in range(sizes[1]):
                change[j] = -l[j]
        moved = sweep(columns, friction, h, kappa, sizes, _STILL * enough, w, l)
        if k == 0:
            enough = _SMALL * moved
        if moved <= enough:
            return True
        if last and moved > _SLOW * before:
            for j in range(sizes[1]):
                change[j] += l[j]
            leap(columns, moved / before, sizes, change, w, l)
        before = moved
    return False
