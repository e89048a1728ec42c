"""Settings of a time step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.model import Vector


class Settings(NamedTuple):
    """Settings of a time step."""

    time_step: float  # [s]
    kappa: float  # central-path parameter [N s m]
    tolerance: float
    max_iterations: int
    order: int = 2  # of a step

    def array(self, kappa: float | None = None) -> Vector:
        """As kernels read it, at another kappa when given; without the order, which chooses the kernels."""
        return np.array((self if kappa is None else self._replace(kappa=kappa))[:4], dtype=np.float64)
