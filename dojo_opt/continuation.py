"""Iterations at one smoothing level, and the passage from one level to the next."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.descent import Descent
from dojo_opt.fit import fit
from dojo_opt.journal import Journal
from dojo_opt.line_search import Iterate, LineSearch
from dojo_opt.objective import Objective
from dojo_opt.options import Options, Stage
from dojo_opt.shooting import Shooting
from sim.simulator.horizon import Horizon
from solvers.riccati import Promise
from solvers.status import Status

Matrix = NDArray[np.float64]

_GOOD_STEP = 0.5  # a step at least this long lowers the regularisation
_POOR_STEP = 0.1  # one shorter than this raises it
_LIGHT = 1.0  # regularisation up to the control weight: a small promise then means an optimum
_SLOW = 2  # short steps in a row that bring next to nothing end a stage
_SLOW_OPEN = 6  # the same with open gaps and a model that promises more: standing still is a poor guess of a trot
_SHARPER = 0.1  # of kappa_grad where its derivatives lead nowhere
_PATIENCE = 3  # times the rejections allowed where only regularisation is left to try
_CREEPING = 15  # short or rejected steps in a row: of 116 gaits and hops that are planned, none takes more than 11
_FIRM = 10.0  # regularisation above which short steps no longer raise it while gaps are open
_FALLEN = 3.0  # times the merit: a rollout that closes gaps at this price has lost the trajectory
_SMALL = 1e-9  # merit below which changes are judged absolutely


class Continuation:
    """The present iterate, the smoothing it belongs to, and the record of all iterations."""

    now: Iterate

    def __init__(
        self,
        horizon: Horizon,
        options: Options,
        objective: Objective,
        descent: Descent,
        line_search: LineSearch,
        shooting: Shooting,
    ) -> None:
        self._horizon = horizon
        self._options = options
        self._objective = objective
        self._descent = descent
        self._line_search = line_search
        self._shooting = shooting
        self.journal = Journal(options)

    def reset(self) -> None:
        """Forget the last solve and start the clock."""
        self.journal.reset()
        self.begun = False  # whether `now` belongs to this solve

    def start(self, now: Iterate, kappa: float | None) -> None:
        """Begin at `now`, a rollout at `kappa`, or states whose gaps are not known yet (None)."""
        self._shooting.reset()
        self.begun = True
        self.now = now
        self.kappa = kappa
        self._kappa_grad = 0.0
        self._fresh = False  # the quadratic model belongs to `now`
        self._known: tuple[float, Any] | None = None  # derivatives at the first iterate, and their smoothing

    def first_stages(self, sim: Any) -> tuple[int, ...]:
        """Which stage the first iterate begins with, and then those for where the ones before fail."""
        if self.kappa is not None:
            return (0,)
        firsts, self._known = fit(self._horizon, self._objective, sim, self.now, self._options.stages)
        return firsts

    def remeasure(self) -> None:
        """The multipliers have changed: the merit and the model of the objective are out of date."""
        now = self.now
        cost, merit = self._objective.evaluate(now.x, now.u)
        self.now = now._replace(cost=cost, merit=merit)
        if self._fresh:
            self._descent.expand(self.now)

    def roll_with_gains(self, kappa: float) -> bool:
        """Replace the trajectory by its own closed-loop rollout at `kappa`; False when the simulator cannot."""
        shot = self._line_search.roll(self.now, None, self._descent.K, 1.0, kappa)
        if shot.status != Status.SOLVED:
            return False
        self.now = self._line_search.accept(shot, None)
        self.kappa, self._fresh = kappa, False
        return True

    def follow(self, kappa: float) -> bool:
        """Roll out with the gains at another smoothing; False, and nothing changed, when that loses the trajectory."""
        if kappa == self.kappa:
            return True
        before, kappa_before, fresh = self.now, self.kappa, self._fresh
        if not self.roll_with_gains(kappa):
            return False
        if self.now.merit - before.merit <= self._options.follow * abs(before.merit):
            return True
        self.now, self.kappa, self._fresh = before, kappa_before, fresh
        return False

    def _enter(self, stage: Stage) -> Status:
        """Make the trajectory belong to the smoothing of `stage`: roll out, or keep its states and open the gaps."""
        started = self.kappa is not None
        if stage.kappa_eval == self.kappa:
            return Status.SOLVED
        if self._options.reopen == "feedback" and started and self.follow(stage.kappa_eval):
            return Status.SOLVED
        now = self.now
        known = self._known is not None and self._known[0] == stage.kappa_eval
        linear = self._known[1] if self._known and known else self._horizon.linearize(now.x, now.u, stage.kappa_eval)
        self._known = None
        if np.any(linear.status):
            return Status.SOLVED if self.roll_with_gains(stage.kappa_eval) else Status.SIMULATION_FAILED
        gaps = self._horizon.gaps(linear, now.x)
        closed = float(np.abs(gaps).max()) <= self._options.gap
        self.now = now._replace(gaps=None if closed else gaps)
        self.kappa = stage.kappa_eval
        self._fresh = stage.kappa_grad == stage.kappa_eval
        if self._fresh:
            self._descent.use(linear, self.now)
        return Status.SOLVED

    def run(self, stage: Stage) -> Status:
        """Iterate until the stage is done (SOLVED), stuck (LINE_SEARCH), or the whole solve has to end."""
        status = self._enter(stage)
        if status != Status.SOLVED:
            return status
        self._line_search.reset()
        rejected = slow = short = 0
        self._kappa_grad = stage.kappa_grad
        for _ in range(stage.iterations):
            if not self._fresh:
                status = self._descent.linearize(self.now, self._kappa_grad, stage.kappa_eval)
                if status != Status.SOLVED:
                    return Status.SIMULATION_FAILED
                self._fresh = True
            promise = self._descent.gains(self.now)
            if promise.status != Status.SOLVED:
                return self._descent.fault(promise, self.now)
            small = stage.decrease * (abs(self.now.merit) + _SMALL)
            promised = -(promise.d0 + 0.5 * promise.d1)
            if self.now.gaps is None and self._descent.mu <= _LIGHT and promised <= small:
                return Status.SOLVED
            status = self.journal.budget()
            if status != Status.SOLVED:
                return status
            before = self.now
            alpha = self._advance(stage, promise)
            if self._report(stage, promise, alpha):
                return Status.STOPPED
            rejected = 0 if alpha > 0.0 else rejected + 1
            short = 0 if alpha >= _POOR_STEP else short + 1
            if rejected >= self._options.rejections and self._unstick(stage):
                rejected = 0
            elif rejected >= self._patience(stage) * self._options.rejections or short >= _CREEPING:
                return Status.LINE_SEARCH
            if alpha > 0.0:
                slow = slow + 1 if abs(before.merit - self.now.merit) <= small else 0
                if slow >= self._allowed(alpha, before, promised > small):
                    if self.now.gaps is None or stage is not self._options.stages[-1]:
                        return Status.SOLVED
                    self._unstick(stage)  # the last stage does not leave gaps
                    slow = 0
        return Status.SOLVED

    def _allowed(self, alpha: float, before: Iterate, promising: bool) -> int:
        """How many steps in a row may bring next to nothing before the stage ends."""
        if before.gaps is None:
            return 1 if alpha >= _GOOD_STEP else _SLOW
        return _SLOW_OPEN if promising else _SLOW

    def _patience(self, stage: Stage) -> int:
        """How many times the allowed rejections end a stage; open gaps may be closed in the stages to come."""
        return 1 if self.now.gaps is not None and stage is not self._options.stages[-1] else _PATIENCE

    def _unstick(self, stage: Stage) -> bool:
        """After several failed line searches: close open gaps, else bring the derivatives nearer to the rollouts."""
        if self.now.gaps is not None:
            return self._close(stage)
        if self._kappa_grad <= 1.01 * stage.kappa_eval:  # rounding of the factors is not a level of its own
            return False
        self._kappa_grad = max(_SHARPER * self._kappa_grad, stage.kappa_eval)
        self._descent.reset_regularization()
        self._fresh = False
        return True

    def _close(self, stage: Stage) -> bool:
        """Close the gaps by a rollout; False where that falls over, but the last stage must not leave gaps."""
        # gains without the regularisation of the failures, which leads to open-loop rollouts
        self._descent.reset_regularization()
        before, fresh = self.now, self._fresh
        if self._descent.gains(before).status != Status.SOLVED or not self.roll_with_gains(stage.kappa_eval):
            return False
        if stage is self._options.stages[-1] or self.now.merit <= _FALLEN * before.merit:
            return True
        self.now, self._fresh = before, fresh
        return False

    def _advance(self, stage: Stage, promise: Promise) -> float:
        """One line search, and the regularisation that follows from its step size."""
        descent, before = self._descent, self.now
        gains = (descent.k, descent.K, descent.start_step)
        alpha, self.now = self._line_search.search(before, promise, descent.linear, gains, stage.kappa_eval)
        linear = None
        if alpha < self._options.shooting and before.gaps is not None:
            shot, there, beside = self._shooting.search(before, promise, descent.linear, gains, stage.kappa_eval)
            if shot > alpha:
                alpha, self.now, linear = shot, there, beside
        self._mu = descent.mu
        if alpha >= _GOOD_STEP:
            descent.lower_regularization()
        elif (
            alpha < _POOR_STEP
            # while contact is discovered, gaps close only under gains that keep the robot up: at 1e6 none are left
            and (self.now.gaps is None or descent.mu < _FIRM or stage is self._options.stages[-1])
        ):
            descent.raise_regularization()
        self._fresh = self._fresh and alpha == 0.0 or (linear is not None and stage.kappa_eval == self._kappa_grad)
        if linear is not None and self._fresh:
            descent.use(linear, self.now)
        return alpha

    def _report(self, stage: Stage, promise: Promise, alpha: float) -> bool:
        """Record the iteration; True when the callback wants to stop."""
        now = self.now
        return self.journal.add(
            cost=now.cost,
            merit=now.merit,
            gradient=promise.gradient,
            kappa_eval=stage.kappa_eval,
            kappa_grad=self._kappa_grad,
            mu=self._mu,
            alpha=alpha,
            promised=alpha * (promise.d0 + 0.5 * alpha * promise.d1),
            gap=now.gap,
            violation=self._objective.violation(now.x, now.u),
        )

    def finish(self, stage: Stage) -> None:
        """Close what is open at the last smoothing, and bring the gains to the trajectory that is returned."""
        if self.now.gaps is not None or self.kappa != stage.kappa_eval:
            self.roll_with_gains(stage.kappa_eval)
        if self._fresh or self._descent.linearize(self.now, stage.kappa_grad, stage.kappa_eval) == Status.SOLVED:
            self._descent.final_gains(self.now)
