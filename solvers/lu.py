"""LU factors with row pivoting of small matrices: the blocks of one joint, up to 6 x 6.

An explicit inverse would not do: next to a stiff contact its rounding, times the square of the stiffness, swamps the
derivative of the step. Triangular solves keep the residual small, which is what the elimination needs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solvers.jit import kernel
from solvers.lanes import load, store

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@kernel
def lu_factor(A: Vector, n: int) -> int:
    """A := its LU factors, U with the reciprocals of its diagonal; A holds n x n numbers row-major, n <= 15.

    Returns the row exchanges, the pivot row of column k in bits 4k .. 4k+3, or -1 if a pivot vanishes or is not finite.
    """
    swaps = 0
    for k in range(n):
        best = abs(A[k * n + k])
        row = k
        for r in range(k + 1, n):
            if abs(A[r * n + k]) > best:
                best = abs(A[r * n + k])
                row = r
        if not (best > 1e-300 and best < 1e300):
            return -1
        swaps |= row << (4 * k)
        if row != k:
            for c in range(n):
                A[k * n + c], A[row * n + c] = A[row * n + c], A[k * n + c]
        A[k * n + k] = 1.0 / A[k * n + k]
        for r in range(k + 1, n):
            f = A[r * n + k] * A[k * n + k]
            A[r * n + k] = f
            for c in range(k + 1, n):
                A[r * n + c] -= f * A[k * n + c]
    return swaps


@kernel
def lu_sign(A: Vector, n: int, swaps: int) -> int:
    """Sign of the determinant of the matrix whose factors and row exchanges these are."""
    sign = 1
    for k in range(n):
        if A[k * n + k] < 0.0:
            sign = -sign
        if (swaps >> (4 * k)) & 15 != k:
            sign = -sign
    return sign


@kernel
def lu_solve(A: Vector, n: int, swaps: int, b: Vector, first: int) -> None:
    """b[first : first + n] := A^-1 b[first : first + n]."""
    for k in range(n):
        row = (swaps >> (4 * k)) & 15
        if row != k:
            b[first + k], b[first + row] = b[first + row], b[first + k]
    for k in range(n):
        x = b[first + k]
        for r in range(k + 1, n):
            b[first + r] -= A[r * n + k] * x
    for k in range(n - 1, -1, -1):
        x = b[first + k] * A[k * n + k]
        b[first + k] = x
        for r in range(k):
            b[first + r] -= A[r * n + k] * x


@kernel
def lu_solve_rows(A: Vector, n: int, swaps: int, B: Matrix, first: int) -> None:
    """B[first : first + n] := A^-1 B[first : first + n], all columns at once."""
    m = B.shape[1]
    for k in range(n):
        row = (swaps >> (4 * k)) & 15
        if row != k:
            for c in range(m):
                B[first + k, c], B[first + row, c] = B[first + row, c], B[first + k, c]
    for k in range(n):
        b = B[first + k]
        for r in range(k + 1, n):
            f = A[r * n + k]
            x = B[first + r]
            for c in range(m):
                x[c] -= f * b[c]
    for k in range(n - 1, -1, -1):
        x = B[first + k]
        for r in range(k + 1, n):
            f = A[k * n + r]
            b = B[first + r]
            for c in range(m):
                x[c] -= f * b[c]
        f = A[k * n + k]
        for c in range(m):
            x[c] *= f


@kernel
def lu_solve_lanes(A: Vector, n: int, swaps: int, B: Matrix, first: int, c: int) -> None:
    """`lu_solve_rows` for the LANES columns of B from c on; two or three rows stay in registers."""
    if n == 2:
        second = swaps & 15  # 1 where the first pivot is in the second row
        x = load(B, first + second, c)
        y = A[3] * (load(B, first + 1 - second, c) - A[2] * x)
        store(B, first + 1, c, y)
        store(B, first, c, A[0] * (x - A[1] * y))
    elif n == 3:
        a = swaps & 15
        b = (swaps >> 4) & 15  # 1 or 2, in the order that the first exchange leaves
        x = load(B, first + a, c)
        y = load(B, first + (0 if b == a else b), c)
        z = load(B, first + (0 if 3 - b == a else 3 - b), c)
        y = y - A[3] * x
        z = A[8] * (z - A[6] * x - A[7] * y)
        y = A[4] * (y - A[5] * z)
        store(B, first + 2, c, z)
        store(B, first + 1, c, y)
        store(B, first, c, A[0] * (x - A[1] * y - A[2] * z))
    else:
        _solve_rows_of_lanes(A, n, swaps, B, first, c)


@kernel
def _solve_rows_of_lanes(A: Vector, n: int, swaps: int, B: Matrix, first: int, c: int) -> None:
    """`lu_solve_lanes` of any number of rows."""
    for k in range(n):
        row = (swaps >> (4 * k)) & 15
        if row != k:
            x = load(B, first + k, c)
            store(B, first + k, c, load(B, first + row, c))
            store(B, first + row, c, x)
    for k in range(1, n):
        x = load(B, first + k, c)
        for r in range(k):
            x = x - A[k * n + r] * load(B, first + r, c)
        store(B, first + k, c, x)
    for k in range(n - 1, -1, -1):
        x = load(B, first + k, c)
        for r in range(k + 1, n):
            x = x - A[k * n + r] * load(B, first + r, c)
        store(B, first + k, c, A[k * n + k] * x)
