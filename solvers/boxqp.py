"""Box-constrained quadratic program by projected Newton: the control step of a knot under control limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solvers.compiler import inlined, kernel
from solvers.dense import cholesky, cholesky_solve, dot
from solvers.status import Status

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Integers = NDArray[np.int64]

_SOLVED, _SINGULAR, _UNFINISHED = int(Status.SOLVED), int(Status.SINGULAR), int(Status.MAX_ITERATIONS)
_MAX_ITERATIONS = 50
_ARMIJO = 0.1
_MIN_STEP = 1e-10
_TOLERANCE = 1e-12  # of the free gradient, relative to the terms it is the sum of


@kernel
def _change(H: Matrix, gradient: Vector, d: Vector) -> float:
    """1/2 d^T H d + gradient^T d: of the value, without the rounding of two values that are nearly the same."""
    total = 0.0
    for i in range(d.shape[0]):
        total += d[i] * (0.5 * dot(H[i], d) + gradient[i])
    return total


@inlined
def _find_free(
    H: Matrix, g: Vector, lo: Vector, hi: Vector, x: Vector, gradient: Vector, free: Integers
) -> tuple[int, bool]:
    """gradient = H x + g; free = indices whose bound does not hold x against the gradient.

    Returns their number, and whether `free` held the same as far as they go.
    """
    count = 0
    same = True
    for i in range(x.shape[0]):
        total = g[i] + dot(H[i], x)
        gradient[i] = total
        if (x[i] > lo[i] or total < 0.0) and (x[i] < hi[i] or total > 0.0):
            same = same and free[count] == i
            free[count] = i
            count += 1
    return count, same


@kernel
def factor_free(H: Matrix, free: Integers, nfree: int, sub: Vector, out: Vector) -> bool:
    """L L^T = H[free, free], L packed as (nfree, nfree) at the start of `out`; False when not positive definite."""
    A = sub[: nfree * nfree].reshape((nfree, nfree))
    for i in range(nfree):
        for j in range(nfree):
            A[i, j] = H[free[i], free[j]]
    return cholesky(A, out[: nfree * nfree].reshape((nfree, nfree))) == nfree


@inlined
def _search(
    H: Matrix, gradient: Vector, lo: Vector, hi: Vector, slope: float, x: Vector, step: Vector, move: Vector
) -> bool:
    """Armijo search along the projected path x <- clip(x + a step); False when no a gives enough decrease."""
    a = 1.0
    while a > _MIN_STEP:
        for i in range(x.shape[0]):
            move[i] = min(max(x[i] + a * step[i], lo[i]), hi[i]) - x[i]
        if _change(H, gradient, move) <= _ARMIJO * a * slope:
            for i in range(x.shape[0]):
                x[i] = min(max(x[i] + a * step[i], lo[i]), hi[i])
            return True
        a *= 0.5
    return False


@inlined
def _newton_step(gradient: Vector, free: Integers, nfree: int, factor: Vector, packed: Vector, out: Vector) -> float:
    """out[free] = -H[free, free]^-1 gradient[free], zero elsewhere; returns its slope gradient . out."""
    for i in range(nfree):
        packed[i] = -gradient[free[i]]
    cholesky_solve(factor[: nfree * nfree].reshape((nfree, nfree)), packed[:nfree].reshape((nfree, 1)))
    slope = 0.0
    for i in range(out.shape[0]):
        out[i] = 0.0
    for i in range(nfree):
        out[free[i]] = packed[i]
        slope += packed[i] * gradient[free[i]]
    return slope


@kernel
def box_qp(H: Matrix, g: Vector, lo: Vector, hi: Vector, x: Vector, free: Integers, work: Vector) -> tuple[int, int]:
    """min 1/2 x^T H x + g^T x  subject to  lo <= x <= hi.

    x: (n,) start, overwritten by the solution; free: (n,) its leading entries become the indices not held by a bound.
    work: (2 n^2 + 3 n,); its start then holds L with L L^T = H[free, free], packed as (nfree, nfree).
    Returns (Status, nfree).   Tassa, Mansard, Todorov 2014, "Control-limited differential dynamic programming".
    """
    n = x.shape[0]
    sub = work[n * n : 2 * n * n]
    gradient = work[2 * n * n : 2 * n * n + n]
    step = work[2 * n * n + n : 2 * n * n + 2 * n]
    trial = work[2 * n * n + 2 * n : 2 * n * n + 3 * n]
    for i in range(n):
        x[i] = min(max(x[i], lo[i]), hi[i])
    nfactored = -1
    for _ in range(_MAX_ITERATIONS):
        nfree, same = _find_free(H, g, lo, hi, x, gradient, free)
        if nfree != nfactored or not same:
            if not factor_free(H, free, nfree, sub, work):
                return _SINGULAR, nfree
            nfactored = nfree
        size, scale = 0.0, 0.0
        for i in range(nfree):
            f = free[i]
            size = max(size, abs(gradient[f]))
            terms = abs(g[f])
            for j in range(n):
                terms += abs(H[f, j] * x[j])
            scale = max(scale, terms)
        if size <= _TOLERANCE * scale:
            return _SOLVED, nfree
        slope = _newton_step(gradient, free, nfree, work, trial, step)
        if not _search(H, gradient, lo, hi, slope, x, step, trial):
            return _SOLVED, nfree  # rounding: no representable decrease is left
    return _UNFINISHED, nfree
