"""ObservationStatistics: running mean and deviation of observations, which policies scale them by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

__all__ = ["ObservationStatistics"]


class ObservationStatistics:
    """Running mean and variance of observations (Chan, Golub and LeVeque 1979)."""

    def __init__(self, size: int) -> None:
        self.sums = np.vstack([np.zeros(size), np.ones(size), np.full(size, 1e-4)])

    def add(self, rows: Floats) -> None:
        """Take rows (n, no) into account."""
        mean, variance, count = self.sums
        n, delta = len(rows), rows.mean(axis=0) - mean
        total = count + n
        variance[:] = (variance * count + rows.var(axis=0) * n + delta**2 * count * n / total) / total
        mean += delta * n / total
        count[:] = total

    def deviation(self) -> Floats:
        """Standard deviations, at least 0.01."""
        return np.sqrt(np.maximum(self.sums[1], 1e-4))
