"""ActionDelay: actions that are applied some control steps after they are decided."""

from __future__ import annotations

from typing import Any

import numpy as np

from solvers.types import Floats, Integers

__all__ = ["ActionDelay"]

_BEFORE = -1  # number of a step before the rollout


class ActionDelay:
    """The last actions of every row; an episode begins with actions of 0, in the middle of their range.

    Args:
        longest: longest possible delay [control steps].
        rows: number of rows.
        nu: size of an action.
    """

    def __init__(self, longest: int, rows: int, nu: int) -> None:
        self.actions = np.zeros((longest + 1, rows, nu))  # the newest last
        self._steps = np.full((longest + 1, rows), _BEFORE, dtype=np.int64)

    def begin(self) -> None:
        """Begin a new rollout: actions decided before it have no derivative in it."""
        self._steps[:] = _BEFORE

    def forget(self, rows: Any) -> None:
        """Episodes begin in these rows."""
        self.actions[:, rows], self._steps[:, rows] = 0.0, _BEFORE

    def apply(self, t: int, decided: Floats, delay: int, rows: Any = slice(None)) -> tuple[Floats, Integers]:
        """The actions applied in step t, in which some rows decide.

        Args:
            t: number of the step in the rollout.
            decided: (n, nu) actions of these rows.
            delay: control steps, up to the longest.
            rows: of the n actions (default: all).

        Returns:
            (n, nu) actions, and (n,) the steps in which they were decided, -1 before the rollout.
        """
        for kept, new in ((self.actions, decided), (self._steps, t)):
            last = kept[:, rows]
            last[:-1], last[-1] = last[1:].copy(), new
            kept[:, rows] = last
        return self.actions[-1 - delay, rows].copy(), self._steps[-1 - delay, rows].copy()
