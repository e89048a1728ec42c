"""Small dense linear algebra in loops, without allocation.

All matrices are C-ordered. The inner loop always runs along a row, so that it vectorises without reordering a sum.
Products keep blocks of the sum in registers and take four terms at a time: the backward pass of a quadruped with 36
states and 12 inputs takes three quarters of the time that it takes with loops over whole rows.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from solvers.compiler import kernel
from solvers.lanes import LANES, keep, load, store
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
    """out += A^T B by blocks of 4 rows and LANES columns; of a symmetric sum the upper triangle is computed and
    mirrored.
    """
    p, m = A.shape
    rows, n = m - m % 4, out.shape[1]
    for i in range(0, rows, 4):
        if n < LANES:
            add_narrow_block(A, B, out, i)
        else:
            for j in range(i if symmetric else 0, n, LANES):
                add_block(A, B, out, i, j)
    for i in range(rows, m):
        first = i if symmetric else 0
        for k in range(p):
            axpy(A[k, i], B[k, first:], out[i, first:])
    if symmetric:
        for i in range(m):
            for j in range(i):
                out[i, j] = out[j, i]


@kernel
def add_block(A: Matrix, B: Matrix, out: Matrix, i: int, j: int) -> None:
    """`add_mul_tn` for the rows i to i + 3 and the columns from j on, LANES of them or as many as there are."""
    p, first = A.shape[0], min(j, out.shape[1] - LANES)
    before = (1 << (j - first)) - 1  # lanes that are columns before j
    y0, y1, y2, y3 = load(out, i, first), load(out, i + 1, first), load(out, i + 2, first), load(out, i + 3, first)
    kept = keep(before, y0), keep(before, y1), keep(before, y2), keep(before, y3)
    for k in range(0, p - p % 4, 4):
        x0, x1, x2, x3 = load(B, k, first), load(B, k + 1, first), load(B, k + 2, first), load(B, k + 3, first)
        a, b, c, d = A[k, i:], A[k + 1, i:], A[k + 2, i:], A[k + 3, i:]
        y0 = y0 + (a[0] * x0 + b[0] * x1 + c[0] * x2 + d[0] * x3)
        y1 = y1 + (a[1] * x0 + b[1] * x1 + c[1] * x2 + d[1] * x3)
        y2 = y2 + (a[2] * x0 + b[2] * x1 + c[2] * x2 + d[2] * x3)
        y3 = y3 + (a[3] * x0 + b[3] * x1 + c[3] * x2 + d[3] * x3)
    for k in range(p - p % 4, p):
        x0, a = load(B, k, first), A[k, i:]
        y0, y1, y2, y3 = y0 + a[0] * x0, y1 + a[1] * x0, y2 + a[2] * x0, y3 + a[3] * x0
    store(out, i, first, kept[0] + keep(~before, y0))
    store(out, i + 1, first, kept[1] + keep(~before, y1))
    store(out, i + 2, first, kept[2] + keep(~before, y2))
    store(out, i + 3, first, kept[3] + keep(~before, y3))


@kernel
def add_narrow_block(A: Matrix, B: Matrix, out: Matrix, i: int) -> None:
    """`add_mul_tn` for the rows i to i + 3, of fewer columns than LANES, in the same order."""
    whole = A.shape[0] - A.shape[0] % 4
    for r in range(i, i + 4):
        y = out[r]
        for k in range(0, whole, 4):
            a, b, c, d = A[k, r], A[k + 1, r], A[k + 2, r], A[k + 3, r]
            for j in range(y.shape[0]):
                y[j] += a * B[k, j] + b * B[k + 1, j] + c * B[k + 2, j] + d * B[k + 3, j]
        for k in range(whole, A.shape[0]):
            axpy(A[k, r], B[k], y)


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
