"""Which way to go: linearise, expand, and run the backward pass with as much regularisation as it needs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.cycle import periodic_gains
from dojo_opt.free_start import FreeStart
from dojo_opt.line_search import Iterate
from dojo_opt.objective import Objective
from dojo_opt.options import Options
from dojo_opt.problem import Problem
from sim.simulator.horizon import Horizon
from solvers.riccati import Promise, Quadratic, Regularization, backward, value_hessian, work_size
from solvers.status import MESSAGES, Status

Matrix = NDArray[np.float64]

_FACTOR = 2.0  # of the regularisation schedule, growing geometrically with repeated use: Tassa 2012, section II.F
_USEFUL = 1.0  # a raise starts here and a lowering below it switches off: less changes next to nothing


class Descent:
    """Gains K (T, nu, ndx), k (T, nu) at an iterate, with all buffers of the backward pass."""

    def __init__(self, problem: Problem, horizon: Horizon, objective: Objective, options: Options) -> None:
        sim, T = problem.sim, problem.horizon
        self.K = np.zeros((T, sim.nu, sim.ndx))
        self.k = np.zeros((T, sim.nu))
        self.mu = 0.0
        self.detail = ""  # what failed, and where: more than a status says
        self._growth = 1.0
        self._problem = problem
        self._horizon = horizon
        self._objective = objective
        self._options = options
        self._damping = np.ones(sim.nu)
        self._free = np.zeros(sim.nu, dtype=np.int64)
        self._buffer = np.zeros(work_size(sim.ndx, sim.nu))
        self._no_gaps = np.zeros((T + 1, sim.ndx))
        self._free_limits = (np.full((T, sim.nu), -np.inf), np.full((T, sim.nu), np.inf))
        self.linear: Any = None  # derivatives of the dynamics
        self._apart: tuple[float, Matrix] | None = None
        self._start = None if problem.free_start is None else FreeStart(problem)

    @property
    def start_step(self) -> Any:
        """Step (ndx,) of a free start, None when it is given."""
        return None if self._start is None else self._start.step

    def reset(self) -> None:
        """Forget regularisation and gains of an earlier solve."""
        self.reset_regularization()
        self.detail = ""
        self.K.fill(0.0)
        self.k.fill(0.0)

    def reset_regularization(self) -> None:
        """Back to the first value."""
        self.mu, self._growth = self._options.regularization, 1.0

    def use(self, linear: Any, now: Iterate) -> None:
        """Take a linearisation of the dynamics at `now` and expand the objective there."""
        self.linear = linear
        self.expand(now)

    def expand(self, now: Iterate) -> None:
        """Expand the objective at `now`, and take the mean control weight as the unit of regularisation."""
        self._objective.expand(now.x, now.u)
        n = self._problem.sim.ndx
        weight = self._objective.H[:-1].diagonal(axis1=1, axis2=2)[:, n:].mean(axis=0)
        self._damping = np.where(weight > 0.0, weight, 1.0)

    def linearize(self, now: Iterate, kappa: float, kappa_eval: float) -> Status:
        """Dynamics and objective around `now`, at the first smoothing that solves every knot.

        kappa, ten times that, and at last kappa_eval, where the trajectory itself was solved.
        """
        status, self.detail = Status.SOLVED, ""
        for level in (kappa, 10.0 * kappa, kappa_eval):
            apart = level != kappa_eval
            linear = self._horizon.linearize(now.x, now.u, level, self._guess(now, level) if apart else None)
            failed = np.flatnonzero(linear.status)
            if failed.size == 0:
                if apart:
                    self._apart = level, linear.x_next - now.x[1:]
                self.use(linear, now)
                self.detail = ""
                return Status.SOLVED
            status = Status(int(linear.status[failed[0]]))
            self.detail = f" Derivatives at knot {failed[0]}, {status.name}: {MESSAGES[status]}"
        return status

    def _guess(self, now: Iterate, kappa: float) -> Any:
        """(T, nx) next states at a smoothing that is not that of the trajectory: as far from it as the last time."""
        return None if self._apart is None or self._apart[0] != kappa else now.x[1:] + self._apart[1]

    def gains(self, now: Iterate) -> Promise:
        """K and k at the first regularisation, from now upwards, that leaves every Q_uu positive definite."""
        model = self._model(now)
        while True:
            value = self.mu * self._options.value_regularization
            promise = backward(
                model, Regularization(self.mu, value, self._damping), self.K, self.k, self._free, self._buffer
            )
            if promise.status == Status.SOLVED and self._start is not None:
                promise = self._free_the_start(self._start, model, promise, now)
            if promise.status == Status.SOLVED or self.mu >= self._options.regularization_max:
                return promise
            self.raise_regularization()

    def fault(self, promise: Promise, now: Iterate) -> Status:
        """Why the backward pass at `now` failed with that promise; `detail` says where."""
        model, knot = self._model(now), promise.knot
        if promise.status == Status.MAX_ITERATIONS:
            self.detail = f" That of the quadratic program of the control limits, at knot {knot}."
            return promise.status
        for name, parts in (("dynamics", (model.A, model.B, model.gaps[1:])), ("costs", (model.g, model.H))):
            knots = [k for part in parts for k in np.flatnonzero(~np.isfinite(part).reshape(len(part), -1).all(axis=1))]
            if knots:
                self.detail = f" In the derivatives of the {name}, at knot {min(knots)}."
                return Status.NOT_FINITE
        value = value_hessian(self._buffer, self._problem.sim.ndx)
        if promise.status == Status.NOT_FINITE or not np.all(np.isfinite(value)):
            self.detail = f" The cost to go grows beyond all numbers, at knot {knot}."
            return Status.NOT_FINITE
        self.detail = f" At knot {knot}."
        return Status.MAX_REGULARIZATION

    def final_gains(self, now: Iterate) -> Promise:
        """K and k for use around `now`: with no regularisation, or the least that every Q_uu needs.

        What the last iterations had only shortens their steps; kept, it would leave little feedback.
        """
        self.mu, self._growth = 0.0, 1.0
        return self.gains(now)

    def _model(self, now: Iterate) -> Quadratic:
        """The linear-quadratic problem around `now`."""
        lo, hi = self._free_limits
        if self._problem.control_limits is not None:
            lo, hi = (bound - now.u for bound in self._problem.control_limits)
        gaps = self._no_gaps if now.gaps is None else now.gaps
        return Quadratic(self.linear.A, self.linear.B, self._objective.g, self._objective.H, gaps, lo, hi)

    @property
    def stride(self) -> Any:
        """(ndx,) by what a motion that repeats itself moves on, None for others."""
        return None if self._start is None else self._start.stride

    def repeat(self, now: Iterate) -> bool:
        """Replace K by the gains of the motion repeated for ever; False, and nothing changed, where there are none."""
        K = periodic_gains(self._model(now))
        if K is not None:
            self.K[:] = K
        return K is not None

    def _free_the_start(self, start: FreeStart, model: Quadratic, promise: Promise, now: Iterate) -> Promise:
        """Add the step of a free start, once the gaps are closed: before, both together would lead too far."""
        start.step[:] = 0.0
        if now.gaps is not None:
            return promise
        k, d0, d1 = start.solve(model, self.K, self.k, self.mu, self._damping, now.x, now.u)
        if not d0 + 0.5 * d1 < promise.d0 + 0.5 * promise.d1:  # rounding: a start that is left alone promises more
            start.step[:] = 0.0
            return promise
        self.k[:] = k
        return promise._replace(d0=d0, d1=d1)

    def raise_regularization(self) -> None:
        """After a failure: faster with every failure in a row."""
        self._growth = max(_FACTOR, self._growth * _FACTOR)
        self.mu = min(max(_USEFUL, self.mu * self._growth), self._options.regularization_max)

    def lower_regularization(self) -> None:
        """After a good step: faster with every good step in a row."""
        self._growth = min(1.0 / _FACTOR, self._growth / _FACTOR)
        self.mu = self.mu * self._growth if self.mu * self._growth >= _USEFUL else 0.0
