"""Division of steps: which ones shorter steps may solve, and into how many each step of a motion was divided."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solvers.status import Status
from solvers.types import Floats, Integers

# reasons that shorter steps may remove; they remove neither NaN nor contacts below the ground
DIVISIBLE = frozenset(
    int(status)
    for status in (
        Status.MAX_ITERATIONS,
        Status.NO_PROGRESS,
        Status.SINGULAR,
        Status.TURN_TOO_LARGE,
        Status.LOOP_SINGULAR,
        Status.SHAPES_CROSSED,
        Status.ENERGY_GAIN,
    )
)

_FEW = 1000  # steps: shorter motions copy a template, as np.ones takes ten times as long for a single step
_PARTS, _WHOLE = np.ones(_FEW, dtype=np.int64), np.ones(_FEW)


class Division(NamedTuple):
    """The divided steps of a motion, and the fraction of the relative momentum that each conserved."""

    parts: Integers  # (T,) steps that each was divided into, 1 for whole ones
    momentum_fractions: Floats  # (T,) conserved, of the momentum of bodies relative to each other
    errors: Floats  # (T,) estimated, over those that an accuracy allows; 0 without one

    def rows(self, which: slice) -> Division:
        """The division of some of the steps: a view, which writes to this one."""
        return Division(self.parts[which], self.momentum_fractions[which], self.errors[which])

    @classmethod
    def none(cls, steps: int) -> Division:
        """The division of a given number of undivided steps."""
        if steps <= _FEW:
            return cls(_PARTS[:steps].copy(), _WHOLE[:steps].copy(), np.zeros(steps))
        return cls(np.ones(steps, dtype=np.int64), np.ones(steps), np.zeros(steps))
