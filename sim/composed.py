"""Calls of a simulator of higher order: its states have the velocity of the node, and its steps are compositions."""

from __future__ import annotations

import numpy as np

from sim import composition
from sim.calls import REPORT, Calls, Floats
from sim.model import Integers, Vector

_DEPTH = 4  # steps that a guess is extrapolated from

# order -> the intervals of one step, in steps; symmetric, with sum 1
COMPOSITIONS: dict[int, tuple[float, ...]] = {}


def _symmetric(*half: float) -> tuple[float, ...]:
    """The first intervals, the middle one that makes the sum 1, and the first ones again backwards."""
    return (*half, 1.0 - 2.0 * sum(half), *reversed(half))


class Composed(Calls):
    """The kernels of one packed mechanism without contacts and limits, with steps of the order of its settings."""

    def _composition(self) -> composition.Composition:
        parts = np.array(COMPOSITIONS[self.settings.order])
        return composition.Composition(parts, np.zeros(self.sizes.nv), np.zeros((_DEPTH, len(parts), self.sizes.nv)))

    def roll(self, x: Vector, us: Floats) -> tuple[int, Floats, Floats, Floats]:
        """As Calls.roll; without contacts."""
        steps = len(us)
        xs, reports = np.zeros((steps + 1, self.nx)), np.zeros((steps, REPORT))
        xs[0] = x
        settings = self.settings.array()
        knot = composition.roll(self._model, self._work(), settings, self._composition(), us, xs, reports)
        if knot < steps:
            np.nan_to_num(reports[knot], copy=False, nan=np.inf, posinf=np.inf)
        return int(knot), xs, reports, np.zeros((steps, 0, 8))
