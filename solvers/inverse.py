"""In-place inverse of small matrices: the blocks of one joint, up to 6 x 6."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solvers.jit import kernel


@kernel
def invert(A: NDArray[np.float64], n: int) -> bool:
    """A := A^-1 by Gauss-Jordan elimination with row pivoting; A holds n x n numbers row-major, n <= 16.

    False when a pivot vanishes or is not finite; A is then undefined.
    """
    swaps = 0  # the pivot row of column k in bits 4k .. 4k+3, so that no array is needed
    for k in range(n):
        best = abs(A[k * n + k])
        row = k
        for r in range(k + 1, n):
            if abs(A[r * n + k]) > best:
                best = abs(A[r * n + k])
                row = r
        if not (best > 1e-300 and best < 1e300):
            return False
        swaps |= row << (4 * k)
        if row != k:
            for c in range(n):
                A[k * n + c], A[row * n + c] = A[row * n + c], A[k * n + c]
        pivot = 1.0 / A[k * n + k]
        A[k * n + k] = 1.0
        for c in range(n):
            A[k * n + c] *= pivot
        for r in range(n):
            if r != k:
                f = A[r * n + k]
                A[r * n + k] = 0.0
                for c in range(n):
                    A[r * n + c] -= f * A[k * n + c]
    for k in range(n - 1, -1, -1):
        row = (swaps >> (4 * k)) & 15
        if row != k:
            for r in range(n):
                A[r * n + k], A[r * n + row] = A[r * n + row], A[r * n + k]
    return True
