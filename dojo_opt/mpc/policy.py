"""Policy: a plan with the time it starts at, as inputs, states and gains over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim.mechanism.short_repr import short_repr
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Stack, Vector

_ROUNDING = 1e-6  # share of a knot: times are sums of floating-point steps

__all__ = ["Policy"]


@dataclass(frozen=True)
class Policy:
    """A plan over time: states, inputs and gains of the knots at time + i knot_time.

    A step of the model applies its input as an impulse at its first node. The input therefore represents the interval
    that begins half a simulation step before the node, and `control` reads u accordingly; otherwise every input would
    be half a step late.

    Attributes:
        sim: simulator of the model.
        time: time of the first knot [s].
        x: (T + 1, nx) states.
        u: (T, nu) inputs [N, N m].
        K: (T, nu, ndx) gains.
        substeps: simulation steps per knot (default 1).
        lead: an earlier time [s] and the state then, from which x[0] was predicted (default None: x[0] was measured).
    """

    sim: Simulator
    time: float
    x: Matrix
    u: Matrix
    K: Stack
    substeps: int = 1
    lead: tuple[float, Vector] | None = None

    __repr__ = short_repr

    @property
    def knot_time(self) -> float:
        """Length of a knot [s]."""
        return self.sim.time_step * self.substeps

    def _place(self, time: float) -> tuple[int, float]:
        """Knot before `time` and the share of the way to the next; not before the first."""
        s = max(0.0, (time - self.time) / self.knot_time)
        n = int(np.floor(s + _ROUNDING))
        return n, s - n if s - n > _ROUNDING else 0.0

    def index(self, time: float) -> int:
        """Row of `u` that acts at a time.

        Args:
            time: the time [s].

        Returns:
            The row; beyond the end, the last one.
        """
        return min(self._place(time + 0.5 * self.sim.time_step)[0], len(self.u) - 1)

    def state(self, time: float) -> Vector:
        """Planned state at a time, between knots along the shortest way.

        Args:
            time: the time [s].

        Returns:
            (nx,) state; beyond the end, the last one.
        """
        if self.lead is not None and time < self.time:
            begin, x = self.lead
            f = min(1.0, max(0.0, (time - begin) / (self.time - begin)))
            return self.sim.integrate(x, f * self.sim.difference(self.x[0], x))
        n, f = self._place(time)
        if n >= len(self.u):
            return self.x[-1]
        if f == 0.0:
            return self.x[n]
        return self.sim.integrate(self.x[n], f * self.sim.difference(self.x[n + 1], self.x[n]))

    def control(self, time: float) -> Vector:
        """Planned input at a time, without feedback.

        Args:
            time: the time [s].

        Returns:
            (nu,) input [N, N m].
        """
        return self.u[self.index(time)].copy()

    def feedback(self, time: float, x: Vector) -> Vector:
        """Feedback K (x (-) planned state) at a time.

        Args:
            time: the time [s].
            x: (nx,) state.

        Returns:
            (nu,) change of the input [N, N m].
        """
        knot = min(self._place(time)[0], len(self.u) - 1)
        return self.K[knot] @ self.sim.difference(x, self.state(time))

    def shifted(self, time: float, tail: Callable[[int], tuple[Matrix, Matrix]]) -> Policy:
        """The same plan with a later first knot.

        Between knots, states are interpolated on the manifold, gains linearly, and inputs so that the impulse over each
        new knot is that of the old ones it overlaps.

        Args:
            time: time of the first knot, not before the present one [s].
            tail: function of n that returns n more states (n, nx) and inputs (n, nu) for the end.

        Returns:
            The new policy, of the same length.
        """
        n, f = self._place(time)
        extra = n + (f > 0.0)
        if extra == 0:
            return self
        xs, us = tail(extra)
        X, U = np.concatenate([self.x, xs]), np.concatenate([self.u, us])
        K = np.concatenate([self.K, np.repeat(self.K[-1:], extra, axis=0)])
        T = len(self.u)
        x, u, gains = X[n : n + T + 1], U[n : n + T], K[n : n + T]
        if f > 0.0:
            x = self.sim.integrate(x, f * self.sim.difference(X[n + 1 : n + T + 2], x))
            u = (1.0 - f) * u + f * U[n + 1 : n + T + 1]
            gains = (1.0 - f) * gains + f * K[n + 1 : n + T + 1]
        return Policy(self.sim, time, np.array(x), np.array(u), np.array(gains), self.substeps)
