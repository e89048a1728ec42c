"""Small dense linear algebra in loops, without allocation.

All matrices are C-ordered. The inner loop always runs along a row, so that it vectorises without reordering a sum, and
products take four terms of the sum at a time, so that each result is loaded and stored a quarter as often.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from solvers.jit import kernel

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """a . b"""
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i] * b[i]
    return total


@kernel
def mul(A: Matrix, B: Matrix, out: Matrix) -> None:
    """out = A B"""
    n, p = A.shape
    m = B.shape[1]
    whole = p - p % 4
    for i in range(n):
        for j in range(m):
            out[i, j] = 0.0
        for k in range(0, whole, 4):
            a0, a1, a2, a3 = A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3]
            for j in range(m):
                out[i, j] += a0 * B[k, j] + a1 * B[k + 1, j] + a2 * B[k + 2, j] + a3 * B[k + 3, j]
        for k in range(whole, p):
            a0 = A[i, k]
            for j in range(m):
                out[i, j] += a0 * B[k, j]


@kernel
def add_mul_tn_symmetric(A: Matrix, B: Matrix, out: Matrix) -> None:
    """out += A^T B where the sum is known to be symmetric: the upper triangle is computed and mirrored."""
    p = A.shape[0]
    n = out.shape[0]
    whole = p - p % 4
    for i in range(n):
        for k in range(0, whole, 4):
            a0, a1, a2, a3 = A[k, i], A[k + 1, i], A[k + 2, i], A[k + 3, i]
            for j in range(i, n):
                out[i, j] += a0 * B[k, j] + a1 * B[k + 1, j] + a2 * B[k + 2, j] + a3 * B[k + 3, j]
        for k in range(whole, p):
            a0 = A[k, i]
            for j in range(i, n):
                out[i, j] += a0 * B[k, j]
    for i in range(n):
        for j in range(i):
            out[i, j] = out[j, i]


@kernel
def cholesky(A: Matrix, out: Matrix) -> int:
    """Lower L with L L^T = A, reading the lower triangle of A; the upper triangle of `out` is not touched.

    Returns n on success, otherwise the first row whose pivot is not a positive finite number.
    """
    n = A.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            if i > j:
                out[i, j] = total / out[j, j]
            elif total > 0.0 and total < np.inf:
                out[i, i] = sqrt(total)
            else:
                return i
    return n


@kernel
def cholesky_solve(L: Matrix, X: Matrix) -> None:
    """X <- (L L^T)^-1 X, one column per right-hand side; row operations only."""
    n, m = X.shape
    for step in range(2 * n):
        i = step if step < n else 2 * n - 1 - step
        first, last = (0, i) if step < n else (i + 1, n)
        for k in range(first, last):
            a = L[i, k] if step < n else L[k, i]
            for j in range(m):
                X[i, j] -= a * X[k, j]
        a = 1.0 / L[i, i]
        for j in range(m):
            X[i, j] *= a
