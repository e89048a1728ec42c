"""ObservationStatistics: running mean and deviation of observations, which policies scale them by."""

from __future__ import annotations

import numpy as np

from solvers.types import Floats

__all__ = ["ObservationStatistics"]


class ObservationStatistics:
    """Running mean and variance of observations (Chan, Golub and LeVeque 1979)."""

    def __init__(self, size: int) -> None:
        self.sums = np.vstack([np.zeros(size), np.ones(size), np.full(size, 1e-4)])

    @classmethod
    def empty(cls, size: int) -> ObservationStatistics:
        """Without the one, all but weightless, row that others begin with."""
        out = cls(size)
        out.sums[2] = 0.0
        return out

    def add(self, rows: Floats) -> None:
        """Take rows (n, no) into account."""
        self._merge(rows.mean(axis=0), rows.var(axis=0), float(len(rows)))

    def join(self, other: ObservationStatistics) -> None:
        """Add the counts of other statistics."""
        self._merge(other.sums[0], other.sums[1], float(other.sums[2, 0]))

    def _merge(self, mean: Floats, variance: Floats, n: float) -> None:
        """Take n rows of a mean (no,) and a variance (no,) into account."""
        here, spread, count = self.sums
        delta, total = mean - here, count + n
        spread[:] = (spread * count + variance * n + delta**2 * count * n / total) / total
        here += delta * n / total
        count[:] = total

    def deviation(self) -> Floats:
        """Standard deviations, at least 0.01."""
        return np.sqrt(np.maximum(self.sums[1], 1e-4))
