"""Prior: prior knowledge of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dojo_opt.identification.delayed_space import DelayedSpace
from dojo_opt.identification.parameter_space import rows_of
from sim.mechanism import checks
from solvers.types import Floats

__all__ = ["Prior"]


class Prior:
    """Prior knowledge of parameters: independent and normal.

    mean (n,); precision (n,) the inverse of the variance, 0 where nothing is known
    """

    def __init__(self, space: DelayedSpace, given: Mapping[str, Any]) -> None:
        self.mean, self.precision = space.values.copy(), np.zeros(len(space.values))
        for name, value in checks.mapping("identify(prior=...)", given).items():
            call = f"identify(prior=...): {name!r}"
            rows = rows_of("identify(prior=...)", name, space.labels)
            if isinstance(value, tuple) and len(value) != 2:
                raise ValueError(f"{call}: expected a deviation, or (mean, deviation), got {value!r}")
            mean, deviation = value if isinstance(value, tuple) else (self.mean[rows], value)
            self.mean[rows] = np.broadcast_to(checks.floats(call, mean), (len(rows),))
            self.precision[rows] = checks.number(call, deviation, above=0.0) ** -2

    def cost(self, theta: Floats) -> float:
        """Square of the distance from the mean, over the deviations."""
        return float(np.sum(self.precision * (theta - self.mean) ** 2))
