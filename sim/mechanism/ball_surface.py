"""The offset surface of a height field: the lowest places of the centre of a ball, on a grid.

    F(x) = max over s of  f(s) + sqrt(radius^2 - |s - x|^2)

By the envelope theorem, dF by anything that f depends on is that of f where the maximum is: where the ball touches.
"""

from __future__ import annotations

import numpy as np

from sim.mechanism.spline import spline, spline_values
from solvers.types import Floats


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

    best, arm = np.full(here.shape[:-1], -np.inf), np.zeros_like(here)
    turns = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    for tilt, turn in [(0.0, 0.0), *((tilt, turn) for tilt in np.linspace(0.15, 1.5, 8) for turn in turns)]:
        other = radius * np.sin(tilt) * np.array([np.cos(turn), np.sin(turn)])
        at = (here + other) / spacing
        value = spline_values(coefficients, at[..., 0], at[..., 1]) + radius * np.cos(tilt)
        better = value > best
        best = np.where(better, value, best)
        arm[better] = other
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
