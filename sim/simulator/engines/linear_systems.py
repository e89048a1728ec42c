"""Linear systems of an engine: one that numbers too large have made singular gives NaN, which ends in a status."""

from __future__ import annotations

import numpy as np

from solvers.types import Floats

__all__ = ["solved"]


def solved(matrix: Floats, right: Floats) -> Floats:
    """The solution of A y = b.

    Args:
        matrix: A (n, n).
        right: b (n,) or (n, k).

    Returns:
        y, of the shape of b; NaN where A is singular.
    """
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)
