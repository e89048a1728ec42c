"""The way between two points at rest with the least integral of squared jerk (Flash and Hogan 1985)."""

from __future__ import annotations

import numpy as np

from solvers.types import Floats

__all__ = ["minimum_jerk"]


def minimum_jerk(t: Floats) -> Floats:
    """Share of a way, 10 t^3 - 15 t^4 + 6 t^5, with two derivatives zero at both ends.

    Args:
        t: shares of the time; 0 before and 1 after it.

    Returns:
        Shares of the way, of the same shape.
    """
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(t**3 * (10.0 - 15.0 * t + 6.0 * t**2))
