"""Intervals: the states of a simulator that divides steps, and those of the parts of a step, by their momenta.

p(q, v'; h') = p(q, v; tau),      tau: interval of the state (start_velocity.py),  h': time step of the parts
"""

from __future__ import annotations

import numpy as np

from sim.integrators.legendre import momentum_jacobian
from sim.model.pace import rows
from sim.simulator.engine import Engine, Floats
from sim.simulator.link import link_gradient, link_step
from sim.solve.start_velocity import SHORTEST, change_interval, intervals
from solvers.status import Status
from solvers.types import Vector


class Intervals:
    """Conversions of the velocities of states between intervals, and their derivatives."""

    def __init__(self, engine: Engine) -> None:
        self._engine, self._h = engine, engine.settings.time_step

    def of(self, xs: Floats) -> Vector:
        """(n,) intervals of the states xs (n, nx) [s]."""
        out = np.zeros(len(xs))
        model, data = self._engine.linked(link_step), self._engine.table()
        for part in rows(len(xs)):
            intervals(model, data, self._h, xs[part], out[part])
        return out

    def of_one(self, x: Vector) -> float:
        """Interval of the state x (nx,) [s]."""
        return float(self.of(x[None])[0])

    def changed(self, h: float, other: float, x: Vector) -> Vector | None:
        """x (nx,) with the mean velocity over another interval that has the same momentum; None where there is none."""
        out = x.copy()
        status = change_interval(self._engine.linked(link_step), self._engine.table(), h, other, out)
        return out if status == Status.SOLVED and np.isfinite(out).all() else None

    def to_part(self, x: Vector, part: float) -> Vector | None:
        """A state as one of the parts of a step, which last `part` [s]."""
        return self.changed(self.of_one(x), part, x)

    def from_part(self, x: Vector, part: float) -> Vector | None:
        """The state with the momentum of x, a state of parts; None where there is none."""
        node = self.changed(part, SHORTEST * self._h, x)
        if node is not None and self.of_one(node) < self._h:
            return node
        found = self.changed(part, self._h, x)
        return None if found is None or self.of_one(found) < self._h else found

    def slopes(self, x: Vector, part: float, y: Vector) -> Floats:
        """d(y)/d(x) of y = to_part(x), (ndx, ndx):  p_v' dv' = p_v dv + (p_q - p_q') dq."""
        return self._between((self.of_one(x), x), (part, y))

    def slopes_back(self, y: Vector, part: float, x: Vector) -> Floats:
        """d(x)/d(y) of x = from_part(y), (ndx, ndx)."""
        return self._between((part, y), (self.of_one(x), x))

    def _between(self, one: tuple[float, Vector], other: tuple[float, Vector]) -> Floats:
        """Of states with equal momentum, each with its interval."""
        by_q, by_v = self._momentum_slopes(*one)
        by_q_there, by_v_there = self._momentum_slopes(*other)
        nv = len(by_q)
        out = np.eye(2 * nv)
        out[nv:] = np.linalg.solve(by_v_there, np.hstack([by_q - by_q_there, by_v]))
        return out

    def _momentum_slopes(self, h: float, x: Vector) -> tuple[Floats, Floats]:
        """dp/dq and dp/dv of p(q, v; h), (nv, nv)."""
        nv = self._engine.sizes.nv
        by_q, by_v = np.zeros((nv, nv)), np.zeros((nv, nv))
        model = self._engine.linked(link_step, link_gradient)
        momentum_jacobian(model, self._engine.table(), h, x, by_q, by_v)
        return by_q, by_v
