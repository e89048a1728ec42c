"""Derivatives of several steps in a row under one input: products of those of the steps."""

from __future__ import annotations

from sim.model.data import Data
from solvers.compiler import kernel
from solvers.lanes import LANES, SIDE, load, spread, store
from solvers.types import Matrix


@kernel
def chain_step(data: Data, A: Matrix, B: Matrix) -> None:
    """A := A_step A, B := A_step B + B_step, SIDE columns of (A, B) at a time.

    Lanes behind the last column multiply what is there, and are not read.
    """
    n, m = A.shape[0], B.shape[1]
    S, C, T = data.step_A, data.chain, data.chain_columns
    for i in range(n):
        for k in range(n):
            C[i, k] = A[i, k]
        for k in range(m):
            C[i, n + k] = B[i, k]
    for c in range(0, n + m, SIDE):
        for i in range(n):
            x, y, z = spread(0.0), spread(0.0), spread(0.0)
            for j in range(n):
                s = S[i, j]
                x = x + s * load(C, j, c)
                y = y + s * load(C, j, c + LANES)
                z = z + s * load(C, j, c + 2 * LANES)
            store(T, i, 0, x)
            store(T, i, LANES, y)
            store(T, i, 2 * LANES, z)
        for i in range(n):
            for k in range(c, min(c + SIDE, n)):
                A[i, k] = T[i, k - c]
            for k in range(max(c - n, 0), min(c + SIDE - n, m)):
                B[i, k] = T[i, n + k - c] + data.step_B[i, k]
