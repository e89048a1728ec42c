"""DelayedSpace: parameters of a simulator, and the time from an input to the moment when it acts, as one vector."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dojo_opt.identification.parameter_space import ParameterSpace
from dojo_opt.identification.windows import Window
from sim.mechanism import checks
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["DelayedSpace"]

_LABEL = "delay"


class DelayedSpace:
    """The values of a ParameterSpace, followed by a delay [s] where it is fitted.

    Args:
        space: the parameters.
        delay: a known delay, or the range (low, high) of one to fit, which begins in its middle [s].
        time_step: of the measurement [s].

    Raises:
        ValueError: a negative or infinite number, or low >= high.
    """

    def __init__(self, space: ParameterSpace, delay: Any, time_step: float) -> None:
        call = "identify(delay=...)"
        ends = checks.floats(call, delay).ravel()
        if ends.size not in (1, 2) or not np.all(np.isfinite(ends) & (ends >= 0.0)) or np.any(np.diff(ends) <= 0.0):
            raise ValueError(f"{call}: expected a time >= 0, or a range (low, high) of them, got {checks.shown(delay)}")
        self.space, self._step, self.fitted = space, time_step, ends.size == 2
        own = ([_LABEL], [ends.mean()], [ends[0]], [ends[1]]) if self.fitted else ([], [], [], [])
        self._known, self._count = float(ends[0]), len(space.values)
        self.labels: tuple[str, ...] = (*space.labels, *own[0])
        self.values, self.low, self.high = (
            np.r_[old, new] for old, new in zip((space.values, space.low, space.high), own[1:], strict=True)
        )
        last = np.full(int(self.fitted), time_step)
        self.scale = np.r_[space.scale, last]
        self.of_bodies = np.r_[space.of_bodies, last < 0.0]  # (n,) which values are coordinates of bodies
        self.past = int(np.ceil(ends[-1] / time_step)) + 1  # steps whose inputs act within a window

    @property
    def wrt(self) -> tuple[str, ...]:
        """Names of the parameters of the simulator."""
        return self.space.wrt

    def simulator(self, theta: Floats) -> Simulator:
        """The simulator at theta (n,); its inputs act at once."""
        return self.space.simulator(theta[: self._count])

    def slopes(self, theta: Floats) -> Floats:
        """(m, n) derivatives of the parameters `wrt` by theta; those by the delay are zero."""
        own = self.space.slopes(theta[: self._count])
        return np.hstack([own, np.zeros((len(own), 1))]) if self.fitted else own

    def delayed(self, windows: Sequence[Window], theta: Floats) -> list[Window]:
        """Windows with the inputs that act under the delay of theta."""
        delay = float(theta[-1]) if self.fitted else self._known
        if delay == 0.0 and not self.fitted:
            return list(windows)
        return [window.delayed(delay / self._step, self._step if self.fitted else None) for window in windows]
