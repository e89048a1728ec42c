"""Placing: whether an object has been at its goal for long enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.suite import held
from solvers.types import Vector

__all__ = ["Placing"]

_TICKS = 20  # periods of the publication's controller for which an object has to stay
_ROUNDING = 1e-9  # [s] times are sums of floating-point steps


class Error(NamedTuple):
    """How far an object is from its goal.

    Attributes:
        distance: distance of its centre [m].
        turn: squared sine of half the angle, 1 - (q . q_goal)^2 of the quaternions.
    """

    distance: Vector
    turn: Vector


class Placing:
    """An object is placed when it stays near its goal for 20 periods; the run ends then.

    Args:
        at: columns of its pose in a state.
        goal: (7,) pose at the goal.
        near: largest distance [m].
        turned: largest squared sine of half the angle.
        period: period of the publication's controller [s].
    """

    def __init__(self, at: slice, goal: Vector, near: float, turned: float, period: float) -> None:
        self._at, self._goal, self._near, self._turned = at, goal, near, turned
        self._needed = _TICKS * period - _ROUNDING
        self._since: float | None = None  # [s] when it came near

    def error(self, x: Vector) -> Error:
        """How far the object is from its goal.

        Args:
            x: (..., nx) states.

        Returns:
            The errors.
        """
        here = x[..., self._at]
        distance = np.linalg.norm(here[..., :3] - self._goal[:3], axis=-1)
        return Error(distance, 1.0 - (here[..., 3:] @ self._goal[3:]) ** 2)

    def near(self, x: Vector) -> NDArray[np.bool_]:
        """Whether the object is near its goal.

        Args:
            x: (..., nx) states.

        Returns:
            (...) whether it is.
        """
        error = self.error(x)
        return (error.distance < self._near) & (error.turn < self._turned)

    def finished(self, time: float, x: Vector) -> bool:
        """Whether the object has stayed near; to be asked after every step of a run.

        Args:
            time: time [s].
            x: (nx,) state.

        Returns:
            Whether it has.
        """
        if not self.near(x):
            self._since = None
        elif self._since is None or time < self._since:  # a new run
            self._since = time
        return self._since is not None and time - self._since >= self._needed

    def __call__(self, loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
        """Judge a run.

        Args:
            loop: the run.

        Returns:
            Whether the object was placed, and how far off it is at the end.
        """
        error = self.error(loop.x[-1])
        angle = 2.0 * np.degrees(np.arcsin(np.sqrt(np.clip(float(error.turn), 0.0, 1.0))))
        sideways = float(np.linalg.norm(loop.x[-1, self._at][:2] - self._goal[:2]))
        measures = {"off [mm]": 1e3 * float(error.distance), "angle off [deg]": float(angle), "time [s]": loop.duration}
        measures["sideways [mm]"] = 1e3 * sideways
        return held(loop, self.near(loop.x)) >= self._needed, measures
