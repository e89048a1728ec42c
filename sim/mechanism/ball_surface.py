"""The offset surface of a height field: the lowest places of the centre of a ball, on a grid.

    F(x) = max over s of  f(s) + sqrt(radius^2 - |s - x|^2)

By the envelope theorem, dF by anything that f depends on is that of f where the maximum is: where the ball touches.
"""

from __future__ import annotations

import numpy as np

from sim.mechanism.spline import spline, spline_values
from solvers.types import Floats

_AT_ONCE = 100  # places, whose values fit into the cache of a processor


def raised(coefficients: Floats, spacing: Floats, here: Floats, radius: float) -> tuple[Floats, Floats]:
    """Heights of the surface over the places here (..., 2), and how far from them the ball touches (..., 2) [m].

    The best of 97 directions from the centre to the ground, then steps to where that direction is the normal.
    """

    def reach(arm: Floats) -> tuple[Floats, Floats]:
        """Height of a ball that touches the ground `arm` away from below its centre, and gradient there."""
        at = (here + arm) / spacing
        f, fs, ft = spline(coefficients, at[..., 0], at[..., 1])
        rise = np.sqrt(np.maximum(radius**2 - np.sum(arm**2, axis=-1), 0.0))
        return f + rise, np.stack([fs, ft], axis=-1) / spacing

    arm = _best_arms(coefficients, spacing, here.reshape(-1, 2), radius).reshape(here.shape)
    best, slope = reach(arm)
    step_size = np.ones(best.shape)
    for _ in range(100):
        goal = radius * slope / np.sqrt(1.0 + np.sum(slope**2, axis=-1, keepdims=True))
        other = arm + step_size[..., None] * (goal - arm)
        value, gradient = reach(other)
        better = value >= best
        gain = float(np.max(value - best))
        best, arm = np.where(better, value, best), np.where(better[..., None], other, arm)
        slope = np.where(better[..., None], gradient, slope)
        step_size = np.where(better, np.minimum(1.0, 1.5 * step_size), 0.5 * step_size)
        if gain < 1e-14:
            break
    return best, arm


def _best_arms(coefficients: Floats, spacing: Floats, here: Floats, radius: float) -> Floats:
    """Of 97 directions the one in which a ball over each of the places (n, 2) touches at the greatest height (n, 2)."""
    tilts, turns = np.linspace(0.15, 1.5, 8), np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    tilt = np.concatenate([[0.0], np.repeat(tilts, len(turns))])
    turn = np.concatenate([[0.0], np.tile(turns, len(tilts))])
    arms = radius * np.sin(tilt)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    best = np.empty_like(here)
    for start in range(0, len(here), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        at = (here[some, None] + arms) / spacing
        heights = spline_values(coefficients, at[..., 0], at[..., 1]) + radius * np.cos(tilt)
        best[some] = arms[np.argmax(heights, axis=1)]
    return best
