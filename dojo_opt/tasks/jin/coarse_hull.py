"""Few corners of a convex hull, spread over it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from solvers.types import Floats

__all__ = ["coarse_hull"]


def coarse_hull(points: ArrayLike, corners: int) -> Floats:
    """Points as far from one another as possible: each is the farthest from those before, the first from the middle.

    Args:
        points: (n, 3) points [m].
        corners: number of points to keep.

    Returns:
        (corners, 3) points, or all of them where they are fewer.
    """
    rows = np.asarray(points, dtype=np.float64)
    found = [int(np.argmax(np.linalg.norm(rows - rows.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(rows - rows[found[0]], axis=1)
    while len(found) < min(corners, len(rows)):
        found.append(int(np.argmax(nearest)))
        np.minimum(nearest, np.linalg.norm(rows - rows[found[-1]], axis=1), out=nearest)
    return rows[found]
