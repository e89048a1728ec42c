"""Intervals: the states of a simulator that divides steps, and those of the parts of a step, by their momenta.

P(q, v'; h') = P(q, v; tau),      tau: interval of the state (start_velocity.py),  h': time step of the parts

P = M (M + C)^-1 p is the momentum at the node: the incoming momentum p less half the impulse of the dampers, whose
matrix is C (dynamics/joints/damper.py). Both states have the same velocity at the node, so the energy
carries over as well.
"""

from __future__ import annotations

import numpy as np

from sim.derivatives.momentum_gradient import momentum_jacobian
from sim.dynamics.joints.damper import node_dampings
from sim.model.interruptible_loops import rows
from sim.simulator.engines.engine import Engine, Floats
from sim.simulator.engines.linear_systems import solved
from sim.simulator.link_kernels import link_gradient, link_momentum, link_step
from sim.solve.start_velocity import SHORTEST, intervals, momenta_of_velocities, momentum_at, state_of_momentum
from solvers.status import Status
from solvers.types import Integers, Vector

_FINEST = 1e-3  # tolerance of the share of a relative momentum
_BRIEF = 3e-4  # of a step: its cube is small, and the rounding of displacements over it too
_ANGLE = 1e-3  # [m, rad] by which no joint moves further in such an interval


class Intervals:
    """Conversions of the velocities of states between intervals, and their derivatives."""

    def __init__(self, engine: Engine) -> None:
        self._engine, self._h = engine, engine.settings.time_step
        self._damped = bool(np.any(engine.model.dof_damper))
        self.closed = len(engine.model.loop_ntrans) + len(engine.model.gear_dof) > 0  # by loops or gears

    @property
    def time_step(self) -> float:
        """Of the undivided steps [s]."""
        return self._h

    def rehearse(self, x: Vector) -> None:
        """Call every kernel of conversions once, at the state x (nx,)."""
        self.state(self._h, self.momentum(self.of_one(x), x), x)
        self.mass(x)
        self._damping(self._h)
        self.momentum_slopes(self._h, x)

    def floating(self) -> Integers:
        """Degrees of freedom of the roots that float."""
        model = self._engine.model
        roots = np.flatnonzero((model.body_parent < 0) & (model.joint_ntrans == 3) & (model.joint_nrot == 3))
        rows = [np.arange(model.body_vadr[i], model.body_vadr[i + 1]) for i in roots]
        return np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)

    def turn(self, x: Vector) -> float:
        """Largest angle by which a joint would turn in a time step with its velocity at the node x (nx,) [rad]."""
        model = self._engine.model
        rates = np.abs(solved(self.mass(x), self.momentum(self.of_one(x), x)))
        ends = model.body_vadr[1:]
        turning = [rates[end - n : end].max() for end, n in zip(ends, model.joint_nrot, strict=True) if n]
        return self._h * float(max(turning, default=0.0))

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
        """P(q, v; h), (nv,)."""
        p = self._arriving(h, x)
        if self._damped:
            C = self._damping(h)
            p -= C @ solved(self.mass(x) + C, p)
        return p

    def state(self, h: float, P: Vector, near: Vector) -> Vector | None:
        """The state with P(q, v; h) = P (nv,), sought from the velocity of `near` (nx,); None where there is none."""
        out = near.copy()
        p = P + self._damping(h) @ solved(self.mass(near), P) if self._damped else P
        status = state_of_momentum(self._engine.linked(link_step, link_momentum), self._engine.table(), h, p, out)
        return out if status == Status.SOLVED and np.isfinite(out).all() else None

    def _arriving(self, h: float, x: Vector) -> Vector:
        """p(q, v; h), (nv,)."""
        out = np.zeros(self._engine.sizes.nv)
        momentum_at(self._engine.linked(link_step), self._engine.table(), h, x, out)
        return out

    def _damping(self, h: float) -> Floats:
        """C of the dampers for an interval, (nv, nv)."""
        out = np.zeros(self._engine.sizes.nv)
        node_dampings(self._engine.linked(link_step), h, out)
        return np.diag(out)

    def mass(self, x: Vector) -> Floats:
        """M(q) of the state x (nx,), (nv, nv)."""
        nv = self._engine.sizes.nv
        out = np.zeros((nv, nv))
        momenta_of_velocities(self._engine.linked(link_step), self._engine.table(), x, np.eye(nv), out)
        return out

    def changed(self, h: float, other: float, x: Vector) -> Vector | None:
        """x (nx,) with the mean velocity over another interval that has the same momentum; None where there is none."""
        return self.state(other, self.momentum(h, x), x)

    def to_part(self, x: Vector, part: float) -> Vector | None:
        """A state as one of the parts of a step, which last `part` [s]."""
        return self.changed(self.of_one(x), part, x)

    def from_part(self, x: Vector, part: float) -> Vector | None:
        """The state with the momentum of x, a state of parts; None where there is none."""
        P = self.momentum(part, x)
        node = self.state(SHORTEST * self._h, P, x)
        if node is not None and self.of_one(node) < self._h:
            return node
        found = self.state(self._h, P, x)
        return None if found is None or self.of_one(found) < self._h else found

    def slowed(self, x: Vector, part: float) -> tuple[Vector, float] | None:
        """(state, share s) nearest to x, a state of parts, where no state has its momentum p:

            P_s = P_0 + M v_r + s (P - P_0 - M v_r)

        P_0: of the forces at rest, v_r: the motion of the floating bodies with all other joints locked that has their
        momentum. So the momentum of everything is that of x, and the energy of the bodies against each other is
        s^2 of theirs: as in an impact that is not elastic. None where even v_r has no state: it turns by half a turn.
        """
        q = x.copy()
        q[-self._engine.sizes.nv :] = 0.0
        rest, P = self.momentum(self._h, q), self.momentum(part, x)
        locked = self.locked(x, P - rest)
        state = self.state(self._h, rest + locked[0], np.concatenate([x[: -len(P)], locked[1]]))
        if state is None:
            return None
        found, share, step = state, 0.0, 0.25
        while step > _FINEST:
            ahead = self.state(self._h, rest + locked[0] + (share + step) * (P - rest - locked[0]), found)
            if ahead is None or self.of_one(ahead) < self._h or share + step > 1.0:
                step *= 0.5
            else:
                found, share = ahead, share + step
        return found, share

    def locked(self, x: Vector, p: Vector) -> tuple[Vector, Vector]:
        """(M v_r, v_r): the roots that float move with the momentum p, everything else with them."""
        model, nv = self._engine.model, len(p)
        v, out = np.zeros(nv), np.zeros(nv)
        for i in np.flatnonzero((model.body_parent < 0) & (model.joint_ntrans == 3) & (model.joint_nrot == 3)):
            dofs = np.arange(model.body_vadr[i], model.body_vadr[i + 1])
            columns = np.zeros((len(dofs), nv))
            momenta_of_velocities(self._engine.linked(link_step), self._engine.table(), x, np.eye(nv)[dofs], columns)
            v[dofs] = solved(columns[:, dofs].T, p[dofs])
            out += v[dofs] @ columns
        return out, v

    def slopes(self, x: Vector, part: float, y: Vector) -> Floats:
        """d(y)/d(x) of y = to_part(x), (ndx, ndx):  P_v' dv' = P_v dv + (P_q - P_q') dq."""
        return self._between((self.of_one(x), x), (part, y))

    def slopes_back(self, y: Vector, part: float, x: Vector) -> Floats:
        """d(x)/d(y) of x = from_part(y), (ndx, ndx)."""
        return self._between((part, y), (self.of_one(x), x))

    def _between(self, one: tuple[float, Vector], other: tuple[float, Vector]) -> Floats:
        """Of states with equal momentum, each with its interval."""
        by_q, by_v = self.momentum_slopes(*one)
        by_q_there, by_v_there = self.momentum_slopes(*other)
        nv = len(by_q)
        out = np.eye(2 * nv)
        out[nv:] = solved(by_v_there, np.hstack([by_q - by_q_there, by_v]))
        return out

    def momentum_slopes(self, h: float, x: Vector) -> tuple[Floats, Floats]:
        """dP/dq and dP/dv of P(q, v; h), (nv, nv).

        With the velocity w of the node, P = M w and (M + C) w = p:

            P_v = M (M + C)^-1 p_v      P_q = (M w)_q + M (M + C)^-1 (p_q - (M w)_q)

        (M w)_q is p_q of the velocity w over an interval of length 0, extrapolated from three short ones.
        """
        by_q, by_v = self._arriving_slopes(h, x)
        if self._damped:
            M = self.mass(x)
            damped = M + self._damping(h)
            node = x.copy()
            node[-len(M) :] = solved(damped, self._arriving(h, x))
            brief = min(_BRIEF * self._h, _ANGLE / max(float(np.abs(node[-len(M) :]).max()), 1e-9))
            one, two, three = (self._arriving_slopes(k * brief, node)[0] for k in (1.0, 2.0, 3.0))
            rest = 3.0 * (one - two) + three
            by_q, by_v = rest + M @ solved(damped, by_q - rest), M @ solved(damped, by_v)
        return by_q, by_v

    def _arriving_slopes(self, h: float, x: Vector) -> tuple[Floats, Floats]:
        """dp/dq and dp/dv of p(q, v; h), (nv, nv)."""
        nv = self._engine.sizes.nv
        by_q, by_v = np.zeros((nv, nv)), np.zeros((nv, nv))
        model = self._engine.linked(link_step, link_gradient)
        momentum_jacobian(model, self._engine.table(), h, x, by_q, by_v)
        return by_q, by_v
