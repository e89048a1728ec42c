"""The cost of a grasp: fingertips close to an object, on all sides of it."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np

from dojo_opt.cost import ResidualCost
from dojo_opt.planning.residual import kernel

__all__ = ["grasp_of_points"]

_SMALL = 1e-9  # [m] a tip at the centre of the object has no direction


def grasp_of_points(tips: int, near: float, around: float, horizon: int) -> ResidualCost:
    """near sum_k |p - p_k|^2 + around |sum_k (p_k - p) / |p_k - p||^2, over all knots but the last.

    The coordinates of a state are the pose of the object at p, and then the places p_k of the tips.

    Args:
        tips: number of tips.
        near: weight of the distances [1/m^2].
        around: weight of the sum of the directions, which is zero for tips on all sides.
        horizon: number of knots.

    Returns:
        The cost.
    """
    residual, slope = _kernels(tips)
    weight = np.concatenate([np.full(3 * tips, near), np.full(3, around)])
    return ResidualCost(residual, 3 * tips + 3, weight, slope, knots=range(horizon))


def _kernels(tips: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """The residual and its derivative."""

    @kernel
    def residual(x, u, out):  # type: ignore[no-untyped-def]
        out[3 * tips :] = 0.0
        for k in range(tips):
            length = _SMALL
            for c in range(3):
                out[3 * k + c] = x[c] - x[7 + 3 * k + c]
                length += out[3 * k + c] ** 2
            for c in range(3):
                out[3 * tips + c] -= out[3 * k + c] / sqrt(length)

    @kernel
    def slope(x, u, out):  # type: ignore[no-untyped-def]
        out[:, :] = 0.0
        for k in range(tips):
            length = _SMALL
            for c in range(3):
                length += (x[c] - x[7 + 3 * k + c]) ** 2
            for c in range(3):
                out[3 * k + c, c] = 1.0
                out[3 * k + c, 6 + 3 * k + c] = -1.0
                for d in range(3):
                    along = (x[c] - x[7 + 3 * k + c]) * (x[d] - x[7 + 3 * k + d]) / length
                    across = ((1.0 if c == d else 0.0) - along) / sqrt(length)
                    out[3 * tips + c, d] -= across
                    out[3 * tips + c, 6 + 3 * k + d] += across

    return residual, slope
