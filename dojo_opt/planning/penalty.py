"""Value and Gauss-Newton model of residual terms, for costs and for augmented-Lagrangian constraints alike.

One entry r of a residual contributes

    two-sided   w r^2 + l r
    one-sided   w r^2 + l r        where l + 2 w r > 0,   otherwise  -l^2 / (4 w)

Costs have l = 0; a constraint r = 0 or r <= 0 with multiplier l and penalty rho has w = rho / 2.
"""

from __future__ import annotations

from dojo_opt.planning.manifold import add_rotation_block
from solvers.compiler import kernel
from solvers.types import Integers, Matrix, Stack, Vector


@kernel
def penalty(r: Matrix, weight: Matrix, slope: Matrix, one_sided: bool) -> float:
    """Sum of the contributions of all entries."""
    total = 0.0
    for row in range(r.shape[0]):
        for j in range(r.shape[1]):
            w, s = weight[row, j], slope[row, j]
            if one_sided and s + 2.0 * w * r[row, j] <= 0.0:
                total -= 0.25 * s * s / w if w > 0.0 else 0.0
            else:
                total += (w * r[row, j] + s) * r[row, j]
    return total


@kernel
def penalty_derivatives(
    r: Matrix, weight: Matrix, slope: Matrix, one_sided: bool, first: Matrix, second: Matrix
) -> None:
    """first = d/dr, second = d^2/dr^2 of the contribution of each entry."""
    for row in range(r.shape[0]):
        for j in range(r.shape[1]):
            w, s = weight[row, j], slope[row, j]
            d = 2.0 * w * r[row, j] + s
            active = not one_sided or d > 0.0
            first[row, j] = d if active else 0.0
            second[row, j] = 2.0 * w if active else 0.0


@kernel
def add_expansion(
    r: Matrix, first: Matrix, second: Matrix, knots: Integers, column: Integers, sign: Vector, g: Matrix, H: Stack
) -> None:
    """g[t] += J^T first, H[t] += J^T diag(second) J for residuals that each move with one column of z = (dx, du).

    column[j] is the column of entry j and sign[j] its derivative; -(c + 1) marks the first of the three entries of a
    rotation whose columns start at c (the other two are skipped). Entries without weight cost nothing.
    """
    for row in range(knots.shape[0]):
        t = knots[row]
        j = 0
        while j < column.shape[0]:
            c = column[j]
            if c >= 0:
                g[t, c] += sign[j] * first[row, j]
                H[t, c, c] += second[row, j]
                j += 1
            else:
                if second[row, j] + second[row, j + 1] + second[row, j + 2] > 0.0:
                    add_rotation_block(r[row], first[row], second[row], j, -c - 1, g[t], H[t])
                j += 3


@kernel
def add_dense_expansion(J: Stack, first: Matrix, second: Matrix, knots: Integers, g: Matrix, H: Stack) -> None:
    """g[t] += J^T first, H[t] += J^T diag(second) J with a Jacobian J (d, ndx + nu) per knot; zeros are skipped."""
    for row in range(knots.shape[0]):
        t = knots[row]
        for j in range(first.shape[1]):
            for a in range(J.shape[2]):
                if J[row, j, a] != 0.0:
                    g[t, a] += J[row, j, a] * first[row, j]
                    scaled = J[row, j, a] * second[row, j]
                    for b in range(J.shape[2]):
                        H[t, a, b] += scaled * J[row, j, b]
