"""LU factors with row pivoting of small matrices: the blocks of one joint, up to 6 x 6.

An explicit inverse would not do: next to a stiff contact its rounding, times the square of the stiffness, swamps the
derivative of the step. Triangular solves keep the residual small, as the elimination needs.
"""

from __future__ import annotations

from typing import TypeVar

from solvers.compiler import kernel
from solvers.lanes import Lanes, load, put, six, store
from solvers.types import Matrix, Vector

Number = TypeVar("Number", float, Lanes)


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
def pivots_of_two(swaps: int) -> tuple[int, int]:
    """Rows of the first and the second pivot."""
    first = swaps & 15
    return first, 1 - first


@kernel
def pivots_of_three(swaps: int) -> tuple[int, int, int]:
    """Rows of the first, the second and the third pivot."""
    a = swaps & 15
    b = (swaps >> 4) & 15  # 1 or 2, in the order that the first exchange leaves
    return a, 0 if b == a else b, 0 if 3 - b == a else 3 - b


@kernel
def solve_two(A: Vector, x: Number, y: Number) -> tuple[Number, Number]:
    """A^-1 (x, y), of 2 x 2 factors, in the order of the pivots."""
    y = A[3] * (y - A[2] * x)
    return A[0] * (x - A[1] * y), y


@kernel
def solve_three(A: Vector, x: Number, y: Number, z: Number) -> tuple[Number, Number, Number]:
    """A^-1 (x, y, z), of 3 x 3 factors, in the order of the pivots."""
    y = y - A[3] * x
    z = A[8] * (z - A[6] * x - A[7] * y)
    y = A[4] * (y - A[5] * z)
    return A[0] * (x - A[1] * y - A[2] * z), y, z


@kernel
def lu_solve(A: Vector, n: int, swaps: int, b: Vector, first: int) -> None:
    """b[first : first + n] := A^-1 b[first : first + n]."""
    if n == 2:
        i, j = pivots_of_two(swaps)
        b[first], b[first + 1] = solve_two(A, b[first + i], b[first + j])
        return
    if n == 3:
        i, j, k = pivots_of_three(swaps)
        b[first], b[first + 1], b[first + 2] = solve_three(A, b[first + i], b[first + j], b[first + k])
        return
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
def lu_solve_lanes(A: Vector, n: int, swaps: int, B: Matrix, first: int, c: int) -> None:
    """B[first : first + n] := A^-1 B[first : first + n], of the LANES columns from c on."""
    if n == 2:
        i, j = pivots_of_two(swaps)
        x, y = solve_two(A, load(B, first + i, c), load(B, first + j, c))
        store(B, first, c, x)
        store(B, first + 1, c, y)
    elif n == 3:
        i, j, k = pivots_of_three(swaps)
        x, y, z = solve_three(A, load(B, first + i, c), load(B, first + j, c), load(B, first + k, c))
        store(B, first, c, x)
        store(B, first + 1, c, y)
        store(B, first + 2, c, z)
    else:
        _exchange_rows(n, swaps, B, first, c)
        if n == 6:
            _solve_six(A, B, first, c)
        else:
            _solve_rows_of_lanes(A, n, B, first, c)


@kernel
def _exchange_rows(n: int, swaps: int, B: Matrix, first: int, c: int) -> None:
    """The row exchanges, on the LANES columns from c on."""
    for k in range(n):
        row = (swaps >> (4 * k)) & 15
        if row != k:
            x = load(B, first + k, c)
            store(B, first + k, c, load(B, first + row, c))
            store(B, first + row, c, x)


@kernel
def _solve_six(A: Vector, B: Matrix, first: int, c: int) -> None:
    """`lu_solve_lanes` of six rows, a body that can move freely, after the exchanges."""
    x0, x1, x2, x3, x4, x5 = six(B, first, c)
    x1 = x1 - A[6] * x0
    x2 = x2 - A[12] * x0 - A[13] * x1
    x3 = x3 - A[18] * x0 - A[19] * x1 - A[20] * x2
    x4 = x4 - A[24] * x0 - A[25] * x1 - A[26] * x2 - A[27] * x3
    x5 = x5 - A[30] * x0 - A[31] * x1 - A[32] * x2 - A[33] * x3 - A[34] * x4
    x5 = A[35] * x5
    x4 = A[28] * (x4 - A[29] * x5)
    x3 = A[21] * (x3 - A[23] * x5 - A[22] * x4)
    x2 = A[14] * (x2 - A[17] * x5 - A[16] * x4 - A[15] * x3)
    x1 = A[7] * (x1 - A[11] * x5 - A[10] * x4 - A[9] * x3 - A[8] * x2)
    x0 = A[0] * (x0 - A[5] * x5 - A[4] * x4 - A[3] * x3 - A[2] * x2 - A[1] * x1)
    put(B, first, c, (x0, x1, x2, x3, x4, x5))


@kernel
def _solve_rows_of_lanes(A: Vector, n: int, B: Matrix, first: int, c: int) -> None:
    """`lu_solve_lanes` of any number of rows, after the exchanges."""
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
