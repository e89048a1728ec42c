"""Frames of an animation: how many there are, and which knots have a key."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FRAMES = 60  # per second of the animation


def sparse(time: NDArray[np.float64]) -> int:
    """Every which knot has a key: a plant steps more often than a screen, and more keys only make the file larger."""
    return max(1, int(1.0 / (FRAMES * (time[1] - time[0])) + 1e-9)) if len(time) > 1 else 1
