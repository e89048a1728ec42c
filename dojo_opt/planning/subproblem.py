"""Subproblem: the linear-quadratic problem around a trajectory, and the gains that its backward pass leaves."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.planning.ilqr_search import Direction
from dojo_opt.planning.ilqr_start import FreeStart
from dojo_opt.planning.iterate import Iterate
from dojo_opt.planning.objective import Objective
from dojo_opt.planning.options import Options
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.regularization import RegularizationSchedule
from sim.simulator.derivative_results import Linearization
from sim.simulator.horizon import Horizon
from solvers.riccati import PredictedChange, Quadratic, Regularization, backward, value_hessian, work_size
from solvers.status import MESSAGES, Status
from solvers.types import Matrix

__all__ = ["Subproblem"]


class Subproblem:
    """Derivatives of the dynamics and the objective along a trajectory, and the step that they propose.

    K (T, nu, ndx) and k (T, nu) are buffers, overwritten by every backward pass.
    """

    def __init__(
        self, problem: Problem, horizon: Horizon, objective: Objective, options: Options, start: FreeStart | None
    ) -> None:
        sim, T = problem.sim, problem.horizon
        self._problem, self._horizon, self._objective, self._options = problem, horizon, objective, options
        self.start = start
        self.schedule = RegularizationSchedule(options)
        self.detail = ""  # place and cause of a failure, in addition to the status
        self.K, self.k = np.zeros((T, sim.nu, sim.ndx)), np.zeros((T, sim.nu))
        self.linear: Any = None  # derivatives of the dynamics
        self._at: Iterate | None = None  # the trajectory that they belong to
        self._apart: tuple[float, Matrix] | None = None  # another smoothing, and by how much its steps end elsewhere
        self._unit = np.ones(sim.nu)  # of the regularisation
        self._free, self._buffer = np.zeros(sim.nu, dtype=np.int64), np.zeros(work_size(sim.ndx, sim.nu))
        self._no_gaps = np.zeros((T + 1, sim.ndx))
        self._no_limits = np.full((T, sim.nu), -np.inf), np.full((T, sim.nu), np.inf)

    def reset(self) -> None:
        """Forget gains, regularisation, and where steps at another smoothing ended."""
        self.schedule.reset()
        self._apart = None
        self.detail = ""
        self.K.fill(0.0)
        self.k.fill(0.0)

    def forget(self) -> None:
        """Forget the trajectory that the derivatives belong to."""
        self._at = None

    def is_at(self, now: Iterate) -> bool:
        """Whether the derivatives belong to this trajectory."""
        return self._at is now

    def linearize(self, now: Iterate, kappa: float, kappa_eval: float) -> Status:
        """Expand dynamics and objective around `now`, at the first smoothing that solves every knot.

        kappa, ten times that, and at last kappa_eval, where the trajectory itself was solved. Where the smoothing grows
        along the horizon, it is that of the last knots.
        """
        status, self.detail = Status.SOLVED, ""
        for level in (kappa, 10.0 * kappa, kappa_eval):
            apart, guess = level != kappa_eval, None
            if apart and self._apart is not None and self._apart[0] == level:
                guess = now.x[1:] + self._apart[1]  # next states: as far from the trajectory as the last time
            linear = self._linear(now, kappa_eval, level, guess)
            failed = np.flatnonzero(linear.status)
            if failed.size == 0:
                if apart:
                    self._apart = level, linear.x_next - now.x[1:]
                self.expand(now, linear)
                self.detail = ""
                return Status.SOLVED
            status = Status(int(linear.status[failed[0]]))
            self.detail = f" Derivatives at knot {failed[0]}, {status.name}: {MESSAGES[status]}"
        return status

    def _linear(self, now: Iterate, first: float, last: float, guess: Matrix | None) -> Linearization:
        """Derivatives whose smoothing grows from `first` to `last` over the blocks of the options."""
        blocks = min(self._options.kappa_blocks, len(now.u))
        if blocks == 1 or first == last:
            return self._horizon.linearize(now.x, now.u, last, guess)
        ends = np.linspace(0, len(now.u), blocks + 1).astype(np.int64)
        parts = [
            self._horizon.linearize(now.x[i : j + 1], now.u[i:j], kappa, None if guess is None else guess[i:j])
            for i, j, kappa in zip(ends[:-1], ends[1:], np.geomspace(first, last, blocks), strict=True)
        ]
        A, B, x_next, status = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("A", "B", "x_next", "status")
        )
        return Linearization(A, B, x_next, status)

    def expand(self, now: Iterate, linear: Any) -> None:
        """Take derivatives at `now`, expand the objective there, and regularise in units of the mean control weight."""
        n = self._problem.sim.ndx
        self.linear, self._at = linear, now
        self._objective.at_kappa(now.kappa).expand(now.x, now.u)
        weight = np.einsum("tii->i", self._objective.H[:-1, n:, n:]) / len(now.u)
        self._unit = np.where(weight > 0.0, weight, 1.0)

    def model(self, now: Iterate) -> Quadratic:
        """The linear-quadratic problem around `now`."""
        lo, hi = self._no_limits
        if self._problem.control_limits is not None:
            lo, hi = (bound - now.u for bound in self._problem.control_limits)
        gaps = self._no_gaps if now.gaps is None else now.gaps
        return Quadratic(self.linear.A, self.linear.B, self._objective.g, self._objective.H, gaps, lo, hi)

    def gains(self, now: Iterate) -> PredictedChange:
        """K and k at the first regularisation, from the present one upwards, with all Q_uu positive definite."""
        model, schedule, options = self.model(now), self.schedule, self._options
        while True:
            added = Regularization(schedule.mu, schedule.mu * options.value_regularization, self._unit)
            predicted = backward(model, added, self.K, self.k, self._free, self._buffer)
            if predicted.status == Status.SOLVED and self.start is not None:
                predicted = self._free_the_start(self.start, now, model, predicted)
            if predicted.status == Status.SOLVED or schedule.mu >= options.regularization_max:
                return predicted
            schedule.increase()

    def _free_the_start(
        self, start: FreeStart, now: Iterate, model: Quadratic, predicted: PredictedChange
    ) -> PredictedChange:
        """Add the step of a free start, once the gaps are closed: before, both together would lead too far."""
        if now.gaps is None:
            k, d0, d1 = start.solve(model, self.K, self.k, self.schedule.mu, self._unit, now.x, now.u)
            if d0 + 0.5 * d1 < predicted.d0 + 0.5 * predicted.d1:  # rounding: a fixed start may predict more
                self.k[:] = k
                return predicted._replace(d0=d0, d1=d1)
        start.step[:] = 0.0
        return predicted

    def direction(self, predicted: PredictedChange) -> Direction:
        """The step of the last backward pass, which made that prediction."""
        return Direction(self.k, self.K, None if self.start is None else self.start.step, self.linear, predicted)

    def fault(self, now: Iterate, predicted: PredictedChange) -> Status:
        """Why the backward pass at `now` failed with that prediction; `detail` has the knot."""
        model, knot = self.model(now), predicted.knot
        if predicted.status == Status.MAX_ITERATIONS:
            self.detail = f" The quadratic program of the control limits did not converge at knot {knot}."
            return predicted.status
        for name, parts in (("dynamics", (model.A, model.B, model.gaps[1:])), ("costs", (model.g, model.H))):
            knots = [k for part in parts for k in np.flatnonzero(~np.isfinite(part).reshape(len(part), -1).all(axis=1))]
            if knots:
                self.detail = f" In the derivatives of the {name}, at knot {min(knots)}."
                if name == "costs":
                    self.detail += self._objective.term_not_finite(now.x, now.u)
                return Status.NOT_FINITE
        value = value_hessian(self._buffer, self._problem.sim.ndx)
        if predicted.status == Status.NOT_FINITE or not np.all(np.isfinite(value)):
            self.detail = f" The cost-to-go overflows at knot {knot}."
            return Status.NOT_FINITE
        self.detail = f" At knot {knot}."
        return Status.MAX_REGULARIZATION
