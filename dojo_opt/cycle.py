"""Gains of a motion that repeats itself: the periodic solution of the Riccati recursion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solvers.riccati import Quadratic, Regularization, backward, value_hessian, work_size
from solvers.status import Status

Stack = NDArray[np.float64]

_CYCLES = 200  # a trot takes 20
_TOLERANCE = 1e-8  # change of the value from one cycle to the next, relative to its largest curvature


def periodic_gains(model: Quadratic) -> Stack | None:
    """K (T, nu, ndx) of the cycle around which `model` is expanded, repeated for ever; None where that has no solution.

    Backward passes over the cycle, each from the value at the start of the one before, until that repeats itself, too.
    Those of a single cycle look no further than its end: repeated, they let a robot fall that these hold up.
    Controls at a limit get no feedback.
    """
    T, n, m = model.B.shape
    K, k = np.zeros((T, m, n)), np.zeros((T, m))
    buffer, free = np.zeros(work_size(n, m)), np.zeros(m, dtype=np.int64)
    H = model.H.copy()
    H[T] = 0.0
    H[T, :n, :n] = model.H[0, :n, :n]
    cycle = model._replace(g=np.zeros_like(model.g), H=H, gaps=np.zeros_like(model.gaps))
    V = H[T, :n, :n]
    for _ in range(_CYCLES):
        if backward(cycle, Regularization(0.0, 0.0, np.ones(m)), K, k, free, buffer).status != Status.SOLVED:
            return None
        before = value_hessian(buffer, n)
        change = np.abs(before - V).max()
        V[:] = before
        if change <= _TOLERANCE * np.abs(V).max():
            return K
    return None
