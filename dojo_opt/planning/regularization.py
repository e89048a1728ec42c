"""The schedule of the regularisation of iLQR."""

from __future__ import annotations

from dojo_opt.planning.options import Options

_FACTOR = 2.0  # of the schedule, growing geometrically with repeated use: Tassa 2012, section II.F
_USEFUL = 1.0  # smallest mu above zero: an increase starts here, and a decrease below it gives zero


class RegularizationSchedule:
    """Schedule of the regularisation, in units of the mean control weight."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self.reset()

    def reset(self, mu: float | None = None) -> None:
        """Back to the first value, or to mu."""
        self.mu = self._options.regularization if mu is None else mu
        self._growth = 1.0

    def increase(self) -> None:
        """After a failure: faster with every failure in a row."""
        self._growth = max(_FACTOR, self._growth * _FACTOR)
        self.mu = min(max(_USEFUL, self.mu * self._growth), self._options.regularization_max)

    def decrease(self) -> None:
        """After a good step: faster with every good step in a row."""
        self._growth = min(1.0 / _FACTOR, self._growth / _FACTOR)
        self.mu = self.mu * self._growth if self.mu * self._growth >= _USEFUL else 0.0
