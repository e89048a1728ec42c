"""Intervals: the states of a simulator that divides steps, and those of the parts of a step, by their momenta.

p(q, v'; h') = p(q, v; tau),      tau: interval of the state (start_velocity.py),  h': time step of the parts
"""

from __future__ import annotations

import numpy as np

from sim.derivatives.momentum_gradient import momentum_jacobian
from sim.model.pace import rows
from sim.simulator.engine import Engine, Floats
from sim.simulator.link import link_gradient, link_step
from sim.solve.start_velocity import SHORTEST, intervals, momenta_of_velocities, momentum_at, state_of_momentum
from solvers.status import Status
from solvers.types import Vector

_FINEST = 1e-3  # how well the share of a momentum is found


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

    def momentum(self, h: float, x: Vector) -> Vector:
        """p(q, v; h), (nv,)."""
        out = np.zeros(self._engine.sizes.nv)
        momentum_at(self._engine.linked(link_step), self._engine.table(), h, x, out)
        return out

    def state(self, h: float, p: Vector, near: Vector) -> Vector | None:
        """The state with p(q, v; h) = p (nv,), sought from the velocity of `near` (nx,); None where there is none."""
        out = near.copy()
        status = state_of_momentum(self._engine.linked(link_step), self._engine.table(), h, p, out)
        return out if status == Status.SOLVED and np.isfinite(out).all() else None

    def changed(self, h: float, other: float, x: Vector) -> Vector | None:
        """x (nx,) with the mean velocity over another interval that has the same momentum; None where there is none."""
        return self.state(other, self.momentum(h, x), x)

    def to_part(self, x: Vector, part: float) -> Vector | None:
        """A state as one of the parts of a step, which last `part` [s]."""
        return self.changed(self.of_one(x), part, x)

    def from_part(self, x: Vector, part: float) -> Vector | None:
        """The state with the momentum of x, a state of parts; None where there is none."""
        p = self.momentum(part, x)
        node = self.state(SHORTEST * self._h, p, x)
        if node is not None and self.of_one(node) < self._h:
            return node
        found = self.state(self._h, p, x)
        return None if found is None or self.of_one(found) < self._h else found

    def slowed(self, x: Vector, part: float) -> tuple[Vector, float]:
        """(state, share s) nearest to x, a state of parts, where no state has its momentum p:

            p_s = p_0 + M v_r + s (p - p_0 - M v_r)

        p_0: of the forces at rest, v_r: the motion of the floating bodies with all other joints locked that has their
        momentum. So the momentum of everything is that of x, and the energy of the bodies against each other is
        s^2 of theirs: as in an impact that is not elastic.
        """
        q = x.copy()
        q[-self._engine.sizes.nv :] = 0.0
        rest, p = self.momentum(self._h, q), self.momentum(part, x)
        locked = self._locked(x, p - rest)
        state = self.state(self._h, rest + locked[0], np.concatenate([x[: -len(p)], locked[1]]))
        share, step = 0.0, 0.25
        found = q if state is None else state
        while step > _FINEST:
            ahead = self.state(self._h, rest + locked[0] + (share + step) * (p - rest - locked[0]), found)
            if ahead is None or self.of_one(ahead) < self._h or share + step > 1.0:
                step *= 0.5
            else:
                found, share = ahead, share + step
        return found, share if state is not None else 0.0

    def _locked(self, x: Vector, p: Vector) -> tuple[Vector, Vector]:
        """(M v_r, v_r): the roots that float move with the momentum p, everything else with them."""
        model, nv = self._engine.model, len(p)
        v, out = np.zeros(nv), np.zeros(nv)
        for i in np.flatnonzero((model.body_parent < 0) & (model.joint_ntrans == 3) & (model.joint_nrot == 3)):
            dofs = np.arange(model.body_vadr[i], model.body_vadr[i + 1])
            columns = np.zeros((len(dofs), nv))
            momenta_of_velocities(self._engine.linked(link_step), self._engine.table(), x, np.eye(nv)[dofs], columns)
            v[dofs] = np.linalg.solve(columns[:, dofs].T, p[dofs])
            out += v[dofs] @ columns
        return out, v

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
