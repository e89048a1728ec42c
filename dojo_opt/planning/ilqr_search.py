"""Search: the step size along the gains of a backward pass, by rollouts or by a step of all states at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dojo_opt.planning.iterate import Iterate
from dojo_opt.planning.objective import Objective
from dojo_opt.planning.options import Options
from dojo_opt.planning.problem import Problem
from sim.simulator.horizon import Horizon, Known
from solvers.riccati import PredictedChange
from solvers.status import Status
from solvers.types import Matrix, Stack, Vector

__all__ = ["Direction", "Search"]

_LENGTHEN = 4.0  # first trial relative to the last accepted step: a rollout costs as much as a linearisation
# iterations of a time step in the first trials of a search, which may fail: a wild motion is refused after 500, at the
# price of ten trials; those of less than _FIRST_TRIALS of the first step size have as many as the simulator
_FEW_ITERATIONS, _FIRST_TRIALS = 60, 0.5


class Direction(NamedTuple):
    """The result of a backward pass: du = k + K dx and, for a free start, dx_0."""

    k: Matrix  # (T, nu)
    K: Stack  # (T, nu, ndx)
    start: Any  # (ndx,) step of a free start, None when the start is given
    linear: Any  # derivatives of the dynamics that the gains belong to
    change: PredictedChange

    def predicted(self, alpha: float) -> float:
        """Change of merit that the model predicts for step size alpha."""
        return alpha * (self.change.d0 + 0.5 * alpha * self.change.d1)


class Search:
    """Step sizes 1, 1/2, 1/4, ... along a direction, or powers of another `backtracking`.

    Trials that the simulator cannot step do not count.
    `single_shooting` is the usual line search of iLQR. `multiple_shooting` is for unstable robots
    whose rollouts fall before the horizon ends. `small_step` is for controllers that have no time to search; it comes
    before the others where there is a step limit (nv,). The derivation is in docs/theory/ilqr.md.
    """

    def __init__(
        self,
        problem: Problem,
        horizon: Horizon,
        objective: Objective,
        options: Options,
        step_limit: Vector | None = None,
    ) -> None:
        self._problem, self._horizon, self._objective, self._options = problem, horizon, objective, options
        self._step_limit = step_limit
        self.forget()

    def forget(self) -> None:
        """Forget step sizes and prices of an earlier trajectory."""
        self.restart()
        self._price = np.zeros(self._problem.sim.ndx)  # of gaps: the largest costates so far

    def restart(self) -> None:
        """Try the full step first again."""
        self._first = 1.0

    def rollout(
        self,
        now: Iterate,
        K: Stack | None,
        kappa: float,
        direction: Direction | None = None,
        alpha: float = 1.0,
        max_iterations: int | None = None,
    ) -> Any:
        """One rollout around `now` under the gains K; it stops at the first step that the simulator cannot solve.

        u_t = us_t + a k_t + K_t (x_t (-) xs_t),  with the share 1 - a of every gap left open; k = 0 without a direction

        max_iterations: of a time step, where the trial may fail sooner than the simulator gives up.
        """
        start = self._problem.start
        k = linear = None
        if self._problem.free_start is not None:
            start = now.x[0]
        if direction is not None:
            k, linear = direction.k, direction.linear
            if self._problem.free_start is not None:
                start = self._problem.sim.integrate(start, alpha * direction.start)
        return self._horizon.roll(
            start,
            now.x,
            now.u,
            kappa,
            k=k,
            K=K,
            gaps=now.gaps,
            alpha=alpha,
            known=Known(linear, now.steps),
            max_iterations=max_iterations,
        )

    def iterate_of(self, shot: Any, gaps: Matrix | None, kappa: float) -> Iterate:
        """A rollout with its cost."""
        self._objective.at_kappa(kappa)
        return Iterate(shot.x, shot.u, gaps, *self._objective.evaluate(shot.x, shot.u), kappa, shot.steps)

    def step(self, now: Iterate, direction: Direction, kappa: float) -> tuple[float, Iterate, Any]:
        """(step size, new iterate, derivatives there if they are known); (0, now, None) without a step."""
        if self._step_limit is not None and (small := self.small_step(now, direction, kappa)) is not None:
            return 1.0, small, None
        alpha, there = self.single_shooting(now, direction, kappa)
        if alpha < self._options.multiple_shooting_below and now.gaps is not None:
            other = self.multiple_shooting(now, direction, kappa)
            if other[0] > alpha:
                return other
        return alpha, there, None

    def small_step(self, now: Iterate, direction: Direction, kappa: float) -> Iterate | None:
        """The full step of all states along the linear model, if no coordinate changes by more than the limit.

        It is the real-time iteration of Diehl, Bock and Schloeder (2005): nothing is rolled out, and the merit may
        rise. The gaps there are found by the next derivatives.
        """
        dx, du = _full_step(now, direction)
        if not np.all(np.abs(dx[:, : self._problem.sim.nv]) <= self._step_limit):
            return None
        x, u = self._moved(now, 1.0, dx, du)
        self._objective.at_kappa(kappa)
        return Iterate(x, u, None, *self._objective.evaluate(x, u))

    def _moved(self, now: Iterate, alpha: float, dx: Matrix, du: Matrix) -> tuple[Matrix, Matrix]:
        """States and inputs, within their limits, after a share of a step."""
        x, u = self._problem.sim.integrate(now.x, alpha * dx), now.u + alpha * du
        if self._problem.control_limits is not None:
            np.clip(u, *self._problem.control_limits, out=u)
        return x, u

    def single_shooting(self, now: Iterate, direction: Direction, kappa: float) -> tuple[float, Iterate]:
        """(step size, new iterate) of the first rollout that is good enough; (0, now) without one.

        With d the predicted change of merit, a step is taken when merit - merit_old <= armijo d for d < 0. With open
        gaps, closing them may cost: d > 0 allows an increase up to max_increase_ratio d
        (Mastalli et al. 2020, "Crocoddyl").
        """
        options, alpha = self._options, self._first
        while alpha >= 0.5**options.halvings:
            few = _FEW_ITERATIONS if alpha >= _FIRST_TRIALS * self._first else None
            shot = self.rollout(now, direction.K, kappa, direction, alpha, few)
            if shot.status == Status.SOLVED:
                gaps = None if now.gaps is None or alpha == 1.0 else (1.0 - alpha) * now.gaps
                there, predicted = self.iterate_of(shot, gaps, kappa), direction.predicted(alpha)
                if predicted < 0.0:
                    good = there.merit - now.merit <= options.armijo * predicted
                else:
                    good = now.gaps is not None and there.merit - now.merit <= options.max_increase_ratio * predicted
                if good:
                    self._first = min(1.0, _LENGTHEN * alpha)
                    return alpha, there
            alpha *= options.backtracking
        self.restart()
        return 0.0, now

    def multiple_shooting(self, now: Iterate, direction: Direction, kappa: float) -> tuple[float, Iterate, Any]:
        """(step size, new iterate, derivatives there); (0, now, None) when no step size is good enough.

        All states move along the linear model, and its errors become gaps:

            x_t <- x_t (+) a dx_t,   u_t <- u_t + a du_t,   dx_t+1 = A dx_t + B du_t + gap_t+1,   du_t = k_t + K_t dx_t

        judged by merit + sum of price |gap|, an exact penalty with the largest costates so far as prices.
        """
        options, predicted = self._options, direction.change
        self._objective.at_kappa(kappa)
        dx, du = _full_step(now, direction)
        gaps = 0.0 if now.gaps is None else np.abs(now.gaps).sum(axis=0)
        self._price = np.maximum(self._price, self._costates(direction.linear, dx, du))
        owed = float(np.sum(gaps * self._price))
        alpha = 1.0
        while alpha >= 0.5**options.halvings:
            x, u = self._moved(now, alpha, dx, du)
            linear = self._horizon.linearize(x, u, kappa)
            if not np.any(linear.status):
                left = self._horizon.gaps(linear, x)
                there = Iterate(x, u, left, *self._objective.evaluate(x, u), kappa)
                change = there.merit - now.merit + float(np.abs(left).sum(axis=0) @ self._price) - owed
                if change <= options.armijo * alpha * (predicted.d0 + 0.5 * alpha * predicted.d1 - owed):
                    return alpha, there, linear
            alpha *= options.backtracking
        return 0.0, now, None

    def _costates(self, linear: Any, dx: Matrix, du: Matrix) -> Matrix:
        """(ndx,) largest costate of each component, the price of a gap there."""
        g, H, n = self._objective.g, self._objective.H, dx.shape[1]
        costate = g[-1, :n] + H[-1, :n, :n] @ dx[-1]
        largest = np.abs(costate)
        for t in range(len(du) - 1, 0, -1):
            costate = g[t, :n] + H[t, :n, :n] @ dx[t] + H[t, :n, n:] @ du[t] + linear.A[t].T @ costate
            np.maximum(largest, np.abs(costate), out=largest)
        return np.asarray(largest)


def _full_step(now: Iterate, direction: Direction) -> tuple[Matrix, Matrix]:
    """dx (T + 1, ndx) and du (T, nu) of the full step along the linear model."""
    k, K, start, linear, _ = direction
    T, m, n = K.shape
    dx, du = np.zeros((T + 1, n)), np.zeros((T, m))
    if start is not None:
        dx[0] = start
    for t in range(T):
        du[t] = k[t] + K[t] @ dx[t]
        dx[t + 1] = linear.A[t] @ dx[t] + linear.B[t] @ du[t]
        if now.gaps is not None:
            dx[t + 1] += now.gaps[t + 1]
    return dx, du
