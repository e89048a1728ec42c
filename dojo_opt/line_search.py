"""How far to go along the gains: nonlinear rollouts with decreasing step size, judged by what the model promised."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_opt.objective import Objective
from dojo_opt.options import Options
from dojo_opt.problem import Problem
from sim.simulator.horizon import Horizon
from solvers.riccati import Promise
from solvers.status import Status

Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]


_LENGTHEN = 4.0  # the first trial, relative to the step that was last taken: a rollout costs as much as a linearisation


Gains = tuple[Matrix, Stack, Any]  # k (T, nu), K (T, nu, ndx), and the step (ndx,) of a free start or None


class Iterate(NamedTuple):
    """A trajectory and how good it is."""

    x: Matrix  # (T + 1, nx)
    u: Matrix  # (T, nu)
    gaps: Matrix | None  # (T + 1, ndx) f(x_t, u_t) (-) x_{t+1}, None when consistent
    cost: float
    merit: float
    steps: Any = None  # what the simulator knows about its steps (sim/simulator/horizon.py)

    @property
    def gap(self) -> float:
        """Largest entry of the gaps."""
        return 0.0 if self.gaps is None else float(np.abs(self.gaps).max())


class LineSearch:
    """Rolls out  u_t = us_t + a k_t + K_t (x_t (-) xs_t)  with the share 1 - a of every gap left open.

    A trial counts only when every time step was solved. With d = a d0 + a^2/2 d1 the promised change of merit, it is
    taken when merit - merit_old <= armijo d for d < 0; with open gaps, closing them may cost, and d > 0 allows an
    increase up to ascent d.   Mastalli et al. 2020, "Crocoddyl".
    """

    def __init__(self, problem: Problem, horizon: Horizon, objective: Objective, options: Options) -> None:
        self._problem = problem
        self._horizon = horizon
        self._objective = objective
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Try the full step first again."""
        self._first = 1.0
        self._start_step: Any = None  # of a free start, at full length

    def roll(
        self, now: Iterate, k: Matrix | None, K: Stack | None, alpha: float, kappa: float, linear: Any = None
    ) -> Any:
        """One rollout from the start of the problem; the simulator stops at the first step that it cannot solve.

        linear: the derivatives that k and K belong to, if they are those at `now`.
        """
        problem, start = self._problem, self._problem.start
        if problem.free_start is not None:
            start = now.x[0]
            if k is not None:
                start = problem.sim.integrate(start, alpha * self._start_step)
        return self._horizon.roll(
            start, now.x, now.u, kappa, k=k, K=K, gaps=now.gaps, alpha=alpha, linear=linear, steps=now.steps
        )

    def accept(self, shot: Any, gaps: Matrix | None) -> Iterate:
        """The rollout as the next iterate."""
        cost, merit = self._objective.evaluate(shot.x, shot.u)
        return Iterate(shot.x, shot.u, gaps, cost, merit, shot.steps)

    def search(self, now: Iterate, promise: Promise, linear: Any, gains: Gains, kappa: float) -> tuple[float, Iterate]:
        """(step size, new iterate), or (0, the old one) when no step size is good enough."""
        options = self._options
        k, K, self._start_step = gains
        alpha = self._first
        while alpha >= 0.5**options.halvings:
            shot = self.roll(now, k, K, alpha, kappa, linear)
            if shot.status == Status.SOLVED:
                cost, merit = self._objective.evaluate(shot.x, shot.u)
                predicted = alpha * (promise.d0 + 0.5 * alpha * promise.d1)
                if predicted < 0.0:
                    good = merit - now.merit <= options.armijo * predicted
                else:
                    good = now.gaps is not None and merit - now.merit <= options.ascent * predicted
                if good:
                    self._first = min(1.0, _LENGTHEN * alpha)
                    gaps = None if now.gaps is None or alpha == 1.0 else (1.0 - alpha) * now.gaps
                    return alpha, Iterate(shot.x, shot.u, gaps, cost, merit, shot.steps)
            alpha *= 0.5
        self.reset()
        return 0.0, now
