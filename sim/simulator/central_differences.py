"""Derivatives by central differences of order 8, of smooth functions that have no cheaper one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from solvers.types import Floats

# f'(0) from f(k s) - f(-k s), k = 1, 2, 3, 4, times 1/s
ORDER_8 = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)


def central_differences(function: Callable[[Floats], Floats], n: int, step: float) -> Floats:
    """The Jacobian at zero of a function of n numbers, (m, n).

    Args:
        function: m numbers of n; NaN where it is not defined.
        n: how many it takes.
        step: distance s of the points, of which there are eight for each number; the error is of order s^8.
    """
    columns = []
    for axis in np.eye(n):
        moves = [(weight, k * step * axis) for k, weight in enumerate(ORDER_8, start=1)]
        columns.append(sum(weight * (function(move) - function(-move)) for weight, move in moves) / step)
    return np.stack(columns, axis=1) if n else np.zeros((len(function(np.zeros(0))), 0))
