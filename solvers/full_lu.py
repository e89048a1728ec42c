"""LU factors with full pivoting: linear systems of any size whose rank is part of the answer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solvers.compiler import kernel

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@kernel
def full_lu_factor(A: Matrix, pivots: Matrix, least: float) -> int:
    """A := the LU factors of P A Q; returns the rank, or -1 if an entry is not finite.

    pivots: (n, 2) row and column exchanged at each elimination; least: a smaller pivot counts as zero, so rows should
    be scaled to one.
    """
    n = A.shape[0]
    for r in range(n):
        for c in range(n):
            if not abs(A[r, c]) < 1e300:
                return -1
    for k in range(n):
        best = 0.0
        row = k
        col = k
        for r in range(k, n):
            a = A[r]
            for c in range(k, n):
                if abs(a[c]) > best:
                    best = abs(a[c])
                    row = r
                    col = c
        if best < least:
            return k
        pivots[k, 0] = row
        pivots[k, 1] = col
        if row != k:
            for c in range(n):
                A[k, c], A[row, c] = A[row, c], A[k, c]
        if col != k:
            for r in range(n):
                A[r, k], A[r, col] = A[r, col], A[r, k]
        for r in range(k + 1, n):
            f = A[r, k] / A[k, k]
            A[r, k] = f
            for c in range(k + 1, n):
                A[r, c] -= f * A[k, c]
    return n


@kernel
def full_lu_solve(A: Matrix, pivots: Matrix, rank: int, B: Matrix) -> None:
    """B := a solution of A X = B, (n, m), with the unknowns beyond the rank at zero."""
    n = A.shape[0]
    m = B.shape[1]
    for k in range(rank):
        row = int(pivots[k, 0])
        if row != k:
            for c in range(m):
                B[k, c], B[row, c] = B[row, c], B[k, c]
    for k in range(rank):
        b = B[k]
        for r in range(k + 1, rank):
            f = A[r, k]
            for c in range(m):
                B[r, c] -= f * b[c]
    for r in range(rank, n):
        for c in range(m):
            B[r, c] = 0.0
    for k in range(rank - 1, -1, -1):
        for r in range(k + 1, rank):
            f = A[k, r]
            for c in range(m):
                B[k, c] -= f * B[r, c]
        f = 1.0 / A[k, k]
        for c in range(m):
            B[k, c] *= f
    for k in range(rank - 1, -1, -1):
        col = int(pivots[k, 1])
        if col != k:
            for c in range(m):
                B[k, c], B[col, c] = B[col, c], B[k, c]
