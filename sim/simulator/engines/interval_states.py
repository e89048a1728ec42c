"""States of an engine that divides steps: the interval of a velocity is shorter where a body turns by half a turn."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sim.model.state_columns import BodyState
from sim.simulator.engines.intervals import Intervals
from sim.simulator.engines.linked_model import LinkedModel
from sim.simulator.engines.mean_states import MeanStates
from sim.solve.start_velocity import SHORTEST
from solvers.status import Status
from solvers.types import Floats, Vector


class IntervalStates(MeanStates):
    """As MeanStates, each state over its own interval."""

    def __init__(self, kernels: LinkedModel, intervals: Intervals) -> None:
        super().__init__(kernels)
        self._intervals = intervals

    def interval(self, x: Vector) -> float:
        """Interval over which the velocity of the state x is the mean [s]."""
        return self._intervals.of_one(x)

    def start(self, q: Vector, v: Vector, h: float | None = None) -> tuple[int, Vector]:
        """As MeanStates.start; where a body turns by half a turn in a step, v is the velocity of the state."""
        x = np.concatenate([q, v])
        if h is None and self._intervals.of_one(x) < self.h:
            return int(Status.SOLVED), x
        return super().start(q, v, h)

    def _at_intervals(self, xs: Floats, call: Callable[..., Floats]) -> Floats:
        """A call for every row at its own interval."""
        out = call(xs)
        taus = self._intervals.of(xs)
        for t in np.flatnonzero(taus < self.h):
            out[t] = call(xs[t : t + 1], taus[t])[0]
        return out

    def node_velocities(self, xs: Floats, h: float | None = None) -> Floats:
        """As MeanStates.node_velocities, rows at their own intervals."""
        call = super().node_velocities
        return call(xs, h) if h else self._at_intervals(xs, call)

    def energies(self, xs: Floats, h: float | None = None) -> Floats:
        """As MeanStates.energies, rows at their own intervals."""
        call = super().energies
        return call(xs, h) if h else self._at_intervals(xs, call)

    def momenta(self, xs: Floats, h: float | None = None) -> Floats:
        """As MeanStates.momenta, rows at their own intervals."""
        call = super().momenta
        return call(xs, h) if h else self._at_intervals(xs, call)

    def maximal(self, xs: Floats, h: float | None = None) -> Floats:
        """As MeanStates.maximal, rows at their own intervals."""
        call = super().maximal
        return call(xs, h) if h else self._at_intervals(xs, call)

    def minimal(self, zs: Floats, h: float | None = None) -> Floats:
        """As MeanStates.minimal, rows at their own intervals."""
        if h:
            return super().minimal(zs, h)
        out, step = super().minimal(zs), self.h
        spins = np.linalg.norm(zs[..., BodyState.SPIN], axis=-1).max(axis=1)
        for t in np.flatnonzero(step * spins >= math.pi):
            out[t] = super().minimal(zs[t : t + 1], SHORTEST * step)[0]
        return out

    def maximal_jacobian(self, x: Vector, h: float | None = None) -> Floats:
        """As MeanStates.maximal_jacobian, at the interval of the state."""
        return super().maximal_jacobian(x, h or self._intervals.of_one(x))

    def minimal_jacobian(self, z: Floats, h: float | None = None) -> Floats:
        """As MeanStates.minimal_jacobian, at the interval of the state."""
        return super().minimal_jacobian(z, h or self._intervals.of_one(self.minimal(z[None])[0]))
