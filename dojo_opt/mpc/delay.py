"""Delay: inputs on their way to the robot, and its state when the next one arrives."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from dojo_opt.mpc.measurement import Measurement
from sim.simulator.adjustable_simulator import AdjustableSimulator
from sim.simulator.simulator import Simulator
from sim.simulator.state_space import rehearse
from solvers.types import Vector

_PREDICTION = 5e-3  # longest step of the prediction [s]
_HARD = 1e-6  # [N s m] a robot does not hover: at 1e-3, as in plans, a foot under 20 N would by 10 mm in such steps

__all__ = ["Delay", "Prediction"]


class Prediction:
    """The motion of the model over `length` [s] from a measurement, in short steps.

    The model may change in place: each prediction has the ground and the parameters of its moment.
    """

    def __init__(self, sim: Simulator, length: float) -> None:
        self._sim = sim
        self._steps = int(np.ceil(length / _PREDICTION - 1e-9))
        self._fine: AdjustableSimulator | None = None
        if self._steps:
            h = length / self._steps
            hard = min(_HARD, sim.kappa * h / sim.time_step)
            self._fine = AdjustableSimulator.like(sim.replace(time_step=h, kappa=hard))

    def rehearse(self, x: Vector) -> None:
        """Make the calls of a prediction from x (nx,), so that no later one loads code."""
        if self._fine is not None:
            rehearse(self._fine, x)

    def __call__(self, now: float, measured: Measurement, command: Callable[[float, Vector], Vector]) -> Vector:
        """State (nx,) at the end.

        Args:
            now: time of the measurement [s].
            measured: the measurements.
            command: input (nu,) at a time [s] and a state (nx,).

        Raises:
            SimulationError: a step of the prediction could not be solved.
        """
        if self._fine is None:
            return measured.state()
        self._fine.follow(self._sim)
        ends, h = [], self._fine.time_step
        x = measured.of(self._fine)
        for k in range(self._steps):
            x = self._fine.step(x, command(now + (k + 0.5) * h, x), throw=True).x
            ends.append((now + (k + 1) * h, x))
        return measured.after(ends)


class Delay:
    """The time from a measurement to the input it causes, `length` [s], bridged by the model."""

    def __init__(self, sim: Simulator, length: float) -> None:
        self._length = length
        self._issued: deque[tuple[float, Vector]] = deque()
        self._before = np.zeros(sim.nu)
        self._predict = Prediction(sim, length)

    def forget(self, guess: Vector) -> None:
        """No input is on its way; guess: (nu,) the input that acts until the first one arrives [N, N m]."""
        self._issued.clear()
        self._before = guess

    def rehearse(self, x: Vector) -> None:
        """As Prediction.rehearse."""
        self._predict.rehearse(x)

    def issue(self, now: float, u: Vector) -> None:
        """Send the input u (nu,) off at `now` [s]; the first one is taken to have acted before, too."""
        if not self._length:
            return
        self._before = u if not self._issued else self._before
        self._issued.append((now + self._length, u))
        while len(self._issued) > 1 and self._issued[1][0] <= now:
            self._issued.popleft()

    def ahead(self, now: float, measured: Measurement) -> Vector:
        """State (nx,) of the model when an input sent at `now` arrives: the measured one, advanced by the delay.

        SimulationError: a step of the prediction could not be solved.
        """
        return self._predict(now, measured, self._acting)

    def acting(self, now: float, u: Vector) -> Vector:
        """The input (nu,) that acts from `now` on [s], when u (nu,) has just been issued."""
        return self._acting(now, u) if self._length else u

    def _acting(self, time: float, x: Vector) -> Vector:
        """The input (nu,) that acts at a time [s]."""
        del x
        return next((u for t, u in reversed(self._issued) if t <= time), self._before)
