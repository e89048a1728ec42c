"""SettingTrial: one choice of time step and kappa, and its results."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PIECE, PIECES = 0.1, 5  # [s] and how many: the motion is cut, for errors that grow by chaos do not measure a step
DURATION = PIECE * PIECES


@dataclass(frozen=True)
class SettingTrial:
    """One setting and its result."""

    time_step: float
    kappa: float
    tolerance: float
    error: float  # [m] largest distance of a body from the converged motion after a piece, mean over the pieces
    seconds: float  # processor time
    message: str

    @property
    def realtime(self) -> float:
        """How many times faster than the motion itself."""
        return DURATION / self.seconds if self.seconds > 0.0 else 0.0

    def __str__(self) -> str:
        size = f"{1e3 * self.error:.2g} mm" if np.isfinite(self.error) else "lost"
        return (
            f"h = {1e3 * self.time_step:g} ms, kappa {self.kappa:g}, tolerance {self.tolerance:g}: {size} after "
            f"{PIECE:g} s, {self.realtime:.3g} times real time"
        )
