"""Measurement: the last measured states, and the corresponding state of the model."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from sim.simulator.simulator import Simulator
from solvers.types import Vector

_OFF = 0.5  # of the interval: a sample further from its beginning says little about its mean velocity

__all__ = ["Measurement"]


class Measurement:
    """The measurements over the last step of the model.

    The velocity of a state is the mean one over the interval before it. A plant with a step of 1 ms therefore reports
    another velocity than the model with its step of 50 ms means: after half a second of free fall they differ by
    0.24 m/s, and a plan made from the wrong one lands a quarter of a metre off. With mean=True the velocity is taken
    from the coordinates one model step ago, as soon as they are known. Models with velocities at nodes, of order 4 to 8
    or with an accuracy, take the measured one.
    """

    def __init__(self, sim: Simulator, mean: bool = True) -> None:
        self._sim = sim
        self._mean = mean
        self._samples: deque[tuple[float, Vector]] = deque()
        self._now: Vector | None = None  # of `state()`, which is asked several times per sample

    def add(self, time: float, x: Vector) -> None:
        """Take a sample; those that no later one can need are dropped."""
        samples, h = self._samples, self._sim.time_step
        self._now = None
        if samples and time <= samples[-1][0]:
            while samples and samples[-1][0] >= time:
                samples.pop()
        samples.append((time, x))
        while len(samples) > 2 and samples[1][0] <= time - h:
            samples.popleft()

    @property
    def first(self) -> tuple[float, Vector]:
        """The oldest sample that is kept, about one step of the model old."""
        return self._samples[0]

    @property
    def last(self) -> tuple[float, Vector]:
        """The last sample."""
        return self._samples[-1]

    def state(self) -> Vector:
        """The last sample as a state of the model."""
        if self._now is None:
            self._now = self._mean_over(list(self._samples), self._sim.mean_over)
        return self._now

    def of(self, sim: Simulator) -> Vector:
        """The last sample as a state of another simulator of the model."""
        return self._mean_over(list(self._samples), sim.mean_over)

    def after(self, ahead: Iterable[tuple[float, Vector]]) -> Vector:
        """The last of the states that are predicted to come, as a state of the model."""
        return self._mean_over([*self._samples, *ahead], self._sim.mean_over)

    def _mean_over(self, samples: list[tuple[float, Vector]], h: float) -> Vector:
        now, x = samples[-1]
        if not self._mean or not h or len(samples) < 2:
            return x
        then, x0 = min(samples[:-1], key=lambda sample: abs(now - h - sample[0]))
        if abs(now - then - h) > _OFF * h:
            return x
        nq, nv = self._sim.nq, self._sim.nv
        out = x.copy()
        out[nq:] = self._sim.difference(x, x0)[:nv] / (now - then)
        return out
