"""The cost of a grasp: fingertips close to an object, on all sides of it."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np

from dojo_opt.cost import ResidualCost
from dojo_opt.planning.residual import jit

__all__ = ["grasp", "place_of_ball"]

_SMALL = 1e-9  # [m^2] a tip at the centre of the object has no direction


def grasp(tips: int, joints: int, place: Callable[..., Any], near: float, around: float, horizon: int) -> ResidualCost:
    """near sum_k |p - p_k|^2 + around |sum_k (p_k - p) / |p_k - p||^2, over all knots but the last.

    The coordinates of a state are the pose of the object at p, and then those of the fingers, whose tips are at p_k.

    Args:
        tips: number of fingers.
        joints: number n of coordinates of a finger.
        place: kernel of a state and the number k of a finger that returns a tuple of 3 + 3 n numbers, p_k [m] and its
            derivatives by the coordinates of the finger, by rows.
        near: weight of the distances [1/m^2].
        around: weight of the sum of the directions, which is zero for tips on all sides.
        horizon: number of knots.

    Returns:
        The cost.
    """
    weight = np.concatenate([np.full(3 * tips, near), np.full(3, around)])
    residual, slope = _residual(tips, place), _slope(tips, joints, place)
    return ResidualCost(residual, 3 * tips + 3, weight, slope, knots=range(horizon))


def _residual(tips: int, place: Callable[..., Any]) -> Callable[..., Any]:
    @jit
    def residual(x, u, out):  # type: ignore[no-untyped-def]
        out[3 * tips :] = 0.0
        for k in range(tips):
            at, length = place(x, k), _SMALL
            for c in range(3):
                out[3 * k + c] = x[c] - at[c]
                length += out[3 * k + c] ** 2
            for c in range(3):
                out[3 * tips + c] -= out[3 * k + c] / sqrt(length)

    return residual


def _slope(tips: int, joints: int, place: Callable[..., Any]) -> Callable[..., Any]:
    @jit
    def slope(x, u, out):  # type: ignore[no-untyped-def]
        out[:, :] = 0.0
        for k in range(tips):
            at, first, length = place(x, k), 6 + joints * k, _SMALL
            for c in range(3):
                length += (x[c] - at[c]) ** 2
                out[3 * k + c, c] = 1.0
                for j in range(joints):
                    out[3 * k + c, first + j] = -at[3 + joints * c + j]
            for c in range(3):
                for d in range(3):
                    along = (x[c] - at[c]) * (x[d] - at[d]) / length
                    across = ((1.0 if c == d else 0.0) - along) / sqrt(length)
                    out[3 * tips + c, d] -= across
                    for j in range(joints):
                        out[3 * tips + c, first + j] += across * at[3 + joints * d + j]

    return slope


@jit
def place_of_ball(x: Any, k: int) -> Any:
    """Place and its derivatives of a tip whose coordinates are its place.

    Args:
        x: (nx,) state.
        k: number of the tip.

    Returns:
        (12,) tuple.
    """
    a = 7 + 3 * k
    return x[a], x[a + 1], x[a + 2], 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
