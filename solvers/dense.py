"""Small dense linear algebra in loops, without allocation.

All matrices are C-ordered. The inner loop always runs along a row, so that it vectorises without reordering a sum, and
products take four terms of the sums of four rows at a time, so that each number is loaded and stored less often.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from solvers.compiler import kernel
from solvers.types import Matrix, Vector


@kernel
def copy(A: Matrix, out: Matrix) -> None:
    """out = A"""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[i, j] = A[i, j]


@kernel
def is_finite(row: Vector) -> bool:
    """Whether all numbers are."""
    total = 0.0
    for k in range(row.shape[0]):
        total += 0.0 * row[k]
    return total == 0.0


@kernel
def clear(A: Matrix) -> None:
    """A = 0"""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            A[i, j] = 0.0


@kernel
def copy_vector(a: Vector, out: Vector) -> None:
    """out = a"""
    for i in range(a.shape[0]):
        out[i] = a[i]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """a . b, as four sums, which vectorise."""
    n = a.shape[0]
    whole = n - n % 4
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    for i in range(0, whole, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(whole, n):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)


@kernel
def axpy(a: float, x: Vector, y: Vector) -> None:
    """y += a x"""
    for i in range(x.shape[0]):
        y[i] += a * x[i]


@kernel
def add_mul_tn(A: Matrix, B: Matrix, out: Matrix, symmetric: bool) -> None:
    """out += A^T B by blocks of 4 x 4; of a symmetric sum the upper triangle is computed and mirrored."""
    p, m = A.shape
    rows, whole = m - m % 4, p - p % 4
    for i in range(0, rows, 4):
        # rows as arrays of their own, counted from 0: an index that might be negative does not vectorise
        first = i if symmetric else 0
        y0, y1, y2, y3 = out[i, first:], out[i + 1, first:], out[i + 2, first:], out[i + 3, first:]
        for k in range(0, whole, 4):
            x0, x1, x2, x3 = B[k, first:], B[k + 1, first:], B[k + 2, first:], B[k + 3, first:]
            a0, a1, a2, a3 = A[k, i], A[k + 1, i], A[k + 2, i], A[k + 3, i]
            b0, b1, b2, b3 = A[k, i + 1], A[k + 1, i + 1], A[k + 2, i + 1], A[k + 3, i + 1]
            c0, c1, c2, c3 = A[k, i + 2], A[k + 1, i + 2], A[k + 2, i + 2], A[k + 3, i + 2]
            d0, d1, d2, d3 = A[k, i + 3], A[k + 1, i + 3], A[k + 2, i + 3], A[k + 3, i + 3]
            for j in range(y0.shape[0]):
                e0, e1, e2, e3 = x0[j], x1[j], x2[j], x3[j]
                y0[j] += a0 * e0 + a1 * e1 + a2 * e2 + a3 * e3
                y1[j] += b0 * e0 + b1 * e1 + b2 * e2 + b3 * e3
                y2[j] += c0 * e0 + c1 * e1 + c2 * e2 + c3 * e3
                y3[j] += d0 * e0 + d1 * e1 + d2 * e2 + d3 * e3
    for i in range(m):
        first = i if symmetric else 0
        for k in range(whole if i < rows else 0, p):
            axpy(A[k, i], B[k, first:], out[i, first:])
    if symmetric:
        for i in range(m):
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
