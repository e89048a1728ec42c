"""`ilqr`: iterative LQR with gaps, single and multiple shooting in one code path, through contact that hardens.

Read from top to bottom: a solve makes attempts from a guess; an attempt goes through stages of falling smoothing; a
stage iterates. One iteration differentiates the time steps along the trajectory, solves the linear-quadratic problem
around it, and searches along the result:

    ilqr -> Solver.solve -> _attempts -> _descend -> _stage -> _iterate -> Subproblem.linearize, Subproblem.gains, _step

`Solver.iterate` is the last part of it alone, for MPC. The derivations are in docs/theory/ilqr.md.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.executors import check_executor
from dojo_opt.planning.ilqr_search import Search
from dojo_opt.planning.ilqr_start import FreeStart, at_rest, fitting_stage, only_stops, periodic_gains
from dojo_opt.planning.iterate import Iterate, Iteration
from dojo_opt.planning.multi_start import multi_start, of_problem
from dojo_opt.planning.objective import Objective
from dojo_opt.planning.options import RENAMED, Options, Stage
from dojo_opt.planning.overload import overload
from dojo_opt.planning.plan import History, Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.refinement import FAILED, refine
from dojo_opt.planning.same_robot import check_warm_start
from dojo_opt.planning.subproblem import Subproblem
from sim.mechanism import checks
from sim.mechanism.renamed import renamed_keywords
from sim.model.interruptible_loops import TimeUp, ends_at
from sim.simulator.derivative_results import Linearization
from sim.simulator.results import Interrupted
from solvers.riccati import PredictedChange
from solvers.status import MESSAGES, Status
from solvers.types import Matrix, Stack, Vector

__all__ = ["Solver", "ilqr"]

_PROGRESS = 0.9  # share of the least violation so far that counts as progress
_STALLED = 5  # multiplier updates of the last stage without progress
_SOFTEN = 3  # times that a stuck last stage may go back to the one before it
_GOOD_STEP = 0.5  # a step at least this long lowers the regularisation
_POOR_STEP = 0.1  # one shorter than this raises it
_MU_OF_AN_OPTIMUM = 1.0  # regularisation up to the control weight: a small prediction then means an optimum
_MAX_SLOW_STEPS = 2  # short steps in a row with next to no decrease end a stage
_MAX_SLOW_STEPS_OPEN = 6  # likewise with open gaps if more is predicted, as from a standing guess of a trot
_SHARPER = 0.1  # factor of kappa_grad when its derivatives lead nowhere
_PATIENCE = 3  # times the rejections allowed where only regularisation is left to try
_MAX_SHORT_STEPS = 15  # short or rejected steps in a row: of 116 planned gaits and hops, none takes more than 11
_MAX_MU_WITH_OPEN_GAPS = 10.0  # regularisation above which short steps no longer raise it while gaps are open
_LOST = 3.0  # times the merit: a rollout that closes gaps at this price has lost the trajectory
_LEAST_MERIT = 1e-9  # merit below which changes are judged absolutely


def ilqr(
    problem: Problem,
    controls: ArrayLike | None = None,
    states: ArrayLike | None = None,
    *,
    warm_start: Plan | None = None,
    starts: int = 1,
    seed: int = 0,
    executor: Executor | None = None,
    options: Options | None = None,
    **settings: Any,
) -> Plan:
    """Plan a trajectory.

    A guess of states begins at the stage that it fits best, because smooth contact would move a good guess away;
    without contacts within reach at the last one, because a smooth stop of a joint pushes away one that rests there. A
    guess with a resting joint that has to move begins at the smoothest stage. When an attempt fails, the planner
    restarts at another stage, within `max_iterations`; the table of iterations shows it.

    A problem with a `refinement` or a `refined_accuracy` is planned with its own time steps first, and from there with
    shorter ones. The plan is then one of the finest problem, and its history is that of all.

    Args:
        problem: the problem.
        controls: (T, nu) guess of the inputs [N, N m], clipped to `control_limits`; by default that of the problem.
        states: (T + 1, nx) guess of the states; by default that of the problem, or the rollout of the inputs.
        warm_start: an earlier plan of the same problem, whose trajectory, multipliers and penalties are taken over. A
            plan of an easier variant, for example with more damping, often helps if a direct solve fails.
        starts: number of guesses to plan from: the given one, and others whose inputs are changed at random (default
            1). The best plan is returned: the cheapest of the solved ones, else that with the least violation.
        seed: seed of these changes (default 0). A plan depends on it, neither on the executor nor on its workers.
        executor: whose workers plan from the guesses: anything with the interface of `concurrent.futures.Executor`, as
            for `dojo.monte_carlo`. A ThreadPoolExecutor uses all cores, as the compiled loops of its threads run at
            the same time (default None: one after the other).
        options: settings of the planner.
        **settings: fields of `dojo.Options` by name; they take precedence over `options`.

    Returns:
        The plan; `success`, `status` and `message` describe the end of the solve.

    Raises:
        TypeError: for an unknown setting, or an argument of the wrong kind.
        ValueError: for a guess of the wrong shape or of another robot, or with numbers that are not finite.
        Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the Plan of the last iteration, INTERRUPTED.
    """
    renamed_keywords("ilqr", settings, RENAMED)
    checks.keywords("ilqr(...)", settings, Options.__dataclass_fields__)
    if options is not None and not isinstance(options, Options):
        raise TypeError(f"ilqr(options=...): expected Options, got {options!r}")
    if not isinstance(problem, Problem):
        raise TypeError(f"ilqr(problem): expected a Problem, got {problem!r}")
    check_warm_start(problem.sim, warm_start)
    options = Options(**settings) if options is None else replace(options, **settings)
    check_executor("ilqr", executor)
    checks.whole_number("ilqr(seed=...)", seed, 0)
    if checks.whole_number("ilqr(starts=...)", starts) > 1:
        return multi_start(ilqr, problem, (controls, states, warm_start), {"options": options}, starts, seed, executor)
    if problem.refinement != 1:
        problem.refined(problem.refinement)  # which refuses a wrong one before any work
    with problem.exclusive() as own:
        plan = Solver(own, options).solve(controls, states, warm_start)
        if plan.success:
            plan = refine(own, plan, options, lambda finer, last, left: Solver(finer, left).solve(warm_start=last))
    return plan if own is problem else of_problem(plan, problem)


class _Attempt(NamedTuple):
    """Where an attempt ended, with the gains, multipliers and half penalties that belong to it."""

    status: Status
    detail: str
    mismatch: float  # of the constraints; infinite with open gaps or where the simulation failed
    now: Iterate
    K: Stack
    slopes: list[Matrix]
    weights: list[Matrix]


class Solver:
    """iLQR with its buffers, for problems that are solved again and again from changing starts.

    `solve` plans from a guess to the end. `guess` or `rollout`, and then `iterate`, take single iterations: gains,
    multipliers and regularisation carry over from one call to the next, until `reset`. With a step limit (nv,) these
    are real-time iterations, for `iterate` only.
    """

    now: Iterate  # the present trajectory

    def __init__(self, problem: Problem, options: Options | None = None, step_limit: Vector | None = None) -> None:
        self.problem = problem
        self.options = Options() if options is None else options
        self.objective = Objective(problem, self.options)
        self._horizon = problem.sim.horizon(problem.horizon, problem.substeps, problem.control_limits)
        self._search = Search(problem, self._horizon, self.objective, self.options, step_limit)
        start = None if problem.free_start is None else FreeStart(problem)
        self._subproblem = Subproblem(problem, self._horizon, self.objective, self.options, start)
        self._history = History(self.options)
        self._begun = False  # whether `now` belongs to the present solve
        self._converged = False  # whether the last stage ended by its decrease, not by its number of iterations

    # ---- single iterations ------------------------------------------------------------------------------------------

    def reset(self, multipliers: Sequence[Matrix] = (), penalties: Sequence[Matrix] = ()) -> None:
        """Forget gains and regularisation, and start from these multipliers and penalties, or those of the options.

        Args:
            multipliers: one (m, d) array per constraint, as in `Plan.multipliers`; zero by default.
            penalties: likewise, as in `Plan.penalties`.
        """
        self._subproblem.reset()
        self.objective.reset(multipliers, penalties)

    @property
    def regularization(self) -> float:
        """The present regularisation, in units of the mean control weight."""
        return self._subproblem.schedule.mu

    @property
    def step_iterations(self) -> int:
        """Iterations of the time steps of all rollouts so far."""
        return self._horizon.iterations

    def states(self, call: str, xs: ArrayLike) -> Matrix:
        """A copy of the states xs (..., nx) with unit quaternions; a ValueError names the call."""
        return np.asarray(self._horizon.states(call, xs))

    def guess(self, xs: Matrix, us: Matrix) -> Iterate:
        """States (T + 1, nx) and inputs (T, nu) to begin with; their gaps are not known yet."""
        cost, merit = self.objective.at_kappa(self.options.stages[0].kappa_eval).evaluate(xs, us)
        return Iterate(xs, us, cost=cost, merit=merit)

    def rollout(self, now: Iterate, K: Stack | None = None, max_iterations: int | None = None) -> Iterate | None:
        """The motion from the start of the problem at the first smoothing, under the gains K (T, nu, ndx) around `now`.

        max_iterations: of a time step, where it may fail sooner than the simulator gives up.

        Returns:
            The motion, without gaps; None when the simulator cannot step it to the end.
        """
        kappa = self.options.stages[0].kappa_eval
        shot = self._search.rollout(now, K, kappa, max_iterations=max_iterations)
        return self._search.iterate_of(shot, None, kappa) if shot.status == Status.SOLVED else None

    def iterate(self, now: Iterate, K: Stack | None = None, *, began: float | None = None) -> Iteration:
        """Iterate from a trajectory, as often as the first stage of the options allows.

        Args:
            now: the trajectory, from `guess`, `rollout`, or the iteration before.
            K: (T, nu, ndx) its gains; by default those of the backward pass before.
            began: `time.perf_counter()` from which the time limit counts [s]; by default the present.

        Returns:
            The trajectory that was reached, with its gains. K and k are buffers, overwritten by the next call.
        """
        self._history.reset(began)
        local = self._subproblem
        if K is not None:
            local.K[:] = K
        local.k.fill(0.0)
        local.detail = ""
        self._begin(now)
        status = self._converged_or_used_up(self._iterate(self.options.stages[0]))
        message = MESSAGES[status] + ("" if status == Status.SOLVED else local.detail)
        return Iteration(status, message, self.now, local.K, local.k, self._history.records)

    def update_multipliers(self, now: Iterate) -> None:
        """Update the multipliers and penalties of the constraints by their violation at `now`."""
        self.objective.update_multipliers(now.x, now.u)

    # ---- a solve: attempts from a guess -----------------------------------------------------------------------------

    def solve(
        self, controls: ArrayLike | None = None, states: ArrayLike | None = None, warm_start: Plan | None = None
    ) -> Plan:
        """Plan from a guess; see `ilqr` for the arguments."""
        self._history.reset()
        self._begun = False
        try:
            status, detail = self._solve(controls, states, warm_start)
            return self._plan(status, detail)
        except KeyboardInterrupt:
            raise Interrupted(self._plan(Status.INTERRUPTED, "") if self._begun else None) from None

    def _solve(
        self, controls: ArrayLike | None, states: ArrayLike | None, warm_start: Plan | None
    ) -> tuple[Status, str]:
        """How the solve ended, and where; `now` is the result."""
        duals = () if warm_start is None else (warm_start.multipliers, warm_start.penalties)
        self.reset(*duals)
        if warm_start is not None:
            controls = warm_start.u if controls is None else controls
            states = warm_start.x if states is None else states
        problem = self.problem
        us = problem.controls0 if controls is None else problem.check_controls("ilqr(controls=...)", controls)
        if problem.control_limits is not None:
            us = np.clip(us, *problem.control_limits)
        xs = problem.states0 if states is None and controls is None else states
        if xs is not None:
            xs = self.states("ilqr(states=...)", problem.check_states("ilqr(states=...)", xs))
            self._begin(self.guess(xs, us))
            return self._in_time(duals)
        idle = Iterate(np.tile(problem.start, (problem.horizon + 1, 1)), us)
        kappa = self.options.stages[0].kappa_eval
        shot = self._search.rollout(idle, None, kappa)
        if shot.status != Status.SOLVED:
            self._begin(idle._replace(kappa=kappa))
            reason = Status(int(shot.status))
            return Status.SIMULATION_FAILED, f" Knot {int(shot.solved_knots)}, {reason.name}: {MESSAGES[reason]}"
        self._begin(self._search.iterate_of(shot, None, kappa))
        return self._in_time(duals)

    def _begin(self, now: Iterate) -> None:
        """Start from another trajectory."""
        self._search.forget()
        self._subproblem.forget()
        self.now = now
        self._begun = True  # from here on Ctrl-C leaves a plan

    def _in_time(self, duals: tuple[Sequence[Matrix], ...]) -> tuple[Status, str]:
        """`_attempts`, whose rollouts and derivatives end at the time limit."""
        with ends_at(self._history.began + self.options.time_limit):
            try:
                return self._attempts(duals)
            except TimeUp:
                return Status.TIME_LIMIT, ""

    def _attempts(self, duals: tuple[Sequence[Matrix], ...]) -> tuple[Status, str]:
        """Attempts from the guess, each beginning at a stage, until one is good; else that with the least violation.

        duals: the multipliers and penalties that each begins with, if not those of the options.
        """
        guess = self.now
        ends: list[_Attempt] = []
        for first in self._first_stages():
            if ends:
                kappa = self.options.stages[first].kappa_eval
                self._history.note(f"{ends[-1].status.name}; restart from the guess at k_eval {kappa:.0e}")
                self.reset(*duals)
                self._begin(guess)
            status = self._descend(first)
            ends.append(self._ended(status))
            if status not in FAILED or ends[-1].mismatch <= self.options.violation_tolerance:
                return status, "" if status == Status.SOLVED else self._subproblem.detail
        best = min(ends, key=lambda end: end.mismatch)
        if best is not ends[-1]:
            self._begin(best.now)
            self._subproblem.K[:] = best.K
            for term, slope, weight in zip(self.objective.constraints, best.slopes, best.weights, strict=True):
                term.slope[:], term.weight[:] = slope, weight
        return best.status, best.detail

    def _ended(self, status: Status) -> _Attempt:
        """The present state of the solver."""
        now, constraints = self.now, self.objective.constraints
        lost = now.gaps is not None or status == Status.SIMULATION_FAILED or not np.isfinite(now.merit)
        mismatch = np.inf if lost else self.objective.mismatch(now.x, now.u)
        slopes, weights = [term.slope.copy() for term in constraints], [term.weight.copy() for term in constraints]
        return _Attempt(status, self._subproblem.detail, mismatch, now, self._subproblem.K.copy(), slopes, weights)

    def _first_stages(self) -> list[int]:
        """The stages to begin with: one, and then those for when the ones before fail; see `fitting_stage`."""
        now, stages = self.now, self.options.stages
        if now.kappa is not None or len(stages) == 1:
            return [0]
        if at_rest(self.problem.sim, self.objective, now):
            return list(range(len(stages)))
        stops = only_stops(self.problem.sim, now.x)
        first, linear = fitting_stage(self._horizon, now, stages, len(stages) - 1 if stops else 0)
        if linear is not None:
            self._open_gaps(stages[first], linear)
        if first:
            *skipped, fitting = (f"{stage.kappa_eval:.0e}" for stage in stages[: first + 1])
            why = "is far from any contact" if stops else f"fits {fitting} best"
            self._history.note(f"k_eval {', '.join(skipped)} skipped: the guess of states {why}")
        return [first, *range(first)]

    # ---- an attempt: stages from smooth to hard ---------------------------------------------------------------------

    def _descend(self, first: int) -> Status:
        """Stages from smooth to hard; after each the multipliers are updated; the last is repeated until they fit.

        Where the last is stuck before they do, larger penalties would only make it stiffer: it is softened again, a
        few times; after that the attempt ends. It ends, too, when updates in a row do not bring the violation down.
        """
        options = self.options
        last = len(options.stages) - 1
        index, softened = first, 0
        least, stalled = np.inf, 0
        for _ in range(last + options.max_updates + 1):
            status = self._stage(options.stages[index], options.bisections)
            if status == Status.SIMULATION_FAILED and index < last:
                index += 1  # the next stage is another way down
                continue
            if status not in (Status.SOLVED, Status.LINE_SEARCH):
                return status
            now = self.now
            if index == last:
                mismatch = self.objective.mismatch(now.x, now.u)
                if mismatch <= options.violation_tolerance and now.gap <= options.gap_tolerance:
                    return self._converged_or_used_up(status)
                stalled = 0 if mismatch < _PROGRESS * least else stalled + 1
                least = min(least, mismatch)
                if stalled >= _STALLED:
                    return Status.INFEASIBLE
                if status == Status.LINE_SEARCH and last > 0:
                    if softened >= _SOFTEN:
                        return status
                    index, softened = last - 1, softened + 1
                    continue
            self.update_multipliers(now)
            fresh, (cost, merit) = self._subproblem.is_at(now), self.objective.evaluate(now.x, now.u)
            self.now = now._replace(cost=cost, merit=merit)
            if fresh:
                self._subproblem.expand(self.now, self._subproblem.linear)
            index = min(index + 1, last)
        return Status.INFEASIBLE

    def _stage(self, stage: Stage, bisections: int) -> Status:
        """One stage; when the trajectory does not survive the step of kappa, by way of the geometric mean."""
        kappa = self.now.kappa
        if self.options.on_kappa_change == "feedback" and bisections > 0 and kappa is not None:
            if not self._follow(stage.kappa_eval):
                middle = (kappa * stage.kappa_eval) ** 0.5
                status = self._stage(Stage(middle, max(middle, stage.kappa_grad), stage.decrease), bisections - 1)
                if status not in (Status.SOLVED, Status.LINE_SEARCH, Status.SIMULATION_FAILED):
                    return status
        return self._iterate(stage)

    def _enter(self, stage: Stage) -> Status:
        """Make the trajectory belong to the smoothing of `stage`: roll out, or keep its states and open the gaps."""
        now, kappa = self.now, stage.kappa_eval
        if now.kappa == kappa:
            return Status.SOLVED
        if self.options.on_kappa_change == "feedback" and now.kappa is not None and self._follow(kappa):
            return Status.SOLVED
        linear = self._horizon.linearize(now.x, now.u, kappa)
        if np.any(linear.status):
            return Status.SOLVED if self._roll_out(kappa) else Status.SIMULATION_FAILED
        self._open_gaps(stage, linear)
        return Status.SOLVED

    def _open_gaps(self, stage: Stage, linear: Linearization) -> None:
        """Keep the states at the smoothing of `stage`, where their derivatives are `linear`."""
        gaps = self._horizon.gaps(linear, self.now.x)
        closed = float(np.abs(gaps).max()) <= self.options.gap_tolerance
        self.now = self.now._replace(gaps=None if closed else gaps, kappa=stage.kappa_eval)
        if stage.kappa_grad == stage.kappa_eval:
            self._subproblem.expand(self.now, linear)

    def _roll_out(self, kappa: float) -> bool:
        """Replace the trajectory by its own closed-loop rollout at `kappa`; False when the simulator cannot."""
        shot = self._search.rollout(self.now, self._subproblem.K, kappa)
        if shot.status == Status.SOLVED:
            self.now = self._search.iterate_of(shot, None, kappa)
        return bool(shot.status == Status.SOLVED)

    def _follow(self, kappa: float) -> bool:
        """Roll out with the gains at another smoothing; False, and nothing changed, when that loses the trajectory."""
        before = self.now
        if kappa == before.kappa:
            return True
        if not self._roll_out(kappa):
            return False
        if self.now.merit - before.merit <= self.options.max_merit_increase * abs(before.merit):
            return True
        self.now = before
        return False

    # ---- a stage: iterations at one smoothing -----------------------------------------------------------------------

    def _iterate(self, stage: Stage) -> Status:
        """Iterate until the stage is done (SOLVED), stuck (LINE_SEARCH), or the whole solve has to end."""
        if (status := self._enter(stage)) != Status.SOLVED:
            return status
        local, rejections, kappa_grad = self._subproblem, self.options.rejections, stage.kappa_grad
        last = stage is self.options.stages[-1]  # it must not leave gaps; others leave them to the stages to come
        rejected = slow = short = 0
        self._search.restart()
        self._converged = True
        for _ in range(stage.iterations):
            if (status := self._enter(stage)) != Status.SOLVED:  # after a step that nothing was rolled out for
                return status
            before = self.now
            if not local.is_at(before) and local.linearize(before, kappa_grad, stage.kappa_eval) != Status.SOLVED:
                return Status.SIMULATION_FAILED
            predicted, mu = local.gains(before), local.schedule.mu
            if predicted.status != Status.SOLVED:
                return local.fault(before, predicted)
            small = (stage.decrease or 0.0) * (abs(before.merit) + _LEAST_MERIT)  # Options fills it in
            expected = -(predicted.d0 + 0.5 * predicted.d1)
            if before.gaps is None and mu <= _MU_OF_AN_OPTIMUM and expected <= small:
                return Status.SOLVED
            if (spent := self._history.budget()) is not None:
                return spent
            alpha = self._step(predicted, stage, kappa_grad)
            if self._record(predicted, stage, kappa_grad, mu, alpha):
                return Status.STOPPED
            rejected = 0 if alpha > 0.0 else rejected + 1
            short = 0 if alpha >= _POOR_STEP else short + 1
            patience = _PATIENCE if self.now.gaps is None or last else 1
            if rejected >= rejections and (sharper := self._recover(stage, kappa_grad)) is not None:
                rejected, kappa_grad = 0, sharper
            elif rejected >= patience * rejections or short >= _MAX_SHORT_STEPS:
                return Status.LINE_SEARCH
            if alpha > 0.0:
                slow = slow + 1 if abs(before.merit - self.now.merit) <= small else 0
                if slow >= _slow_steps(alpha, before, expected > small):
                    if self.now.gaps is None or not last:
                        return Status.SOLVED
                    self._close_gaps(stage)
                    slow = 0
        self._converged = False
        return Status.SOLVED

    def _converged_or_used_up(self, status: Status) -> Status:
        """The status of a stage, MAX_ITERATIONS in place of SOLVED if it used all its iterations."""
        return Status.MAX_ITERATIONS if status == Status.SOLVED and not self._converged else status

    def _step(self, predicted: PredictedChange, stage: Stage, kappa_grad: float) -> float:
        """Search along the gains, and adapt the regularisation to the step size, which is 0 if none is accepted."""
        before, schedule, kappa = self.now, self._subproblem.schedule, stage.kappa_eval
        direction = self._subproblem.direction(predicted)
        alpha, self.now, linear = self._search.step(before, direction, kappa)
        if alpha >= _GOOD_STEP:
            schedule.decrease()
        elif (
            alpha < _POOR_STEP
            # while contacts are discovered, gaps close only if the gains keep the robot upright: at 1e6 none are left
            and (self.now.gaps is None or schedule.mu < _MAX_MU_WITH_OPEN_GAPS or stage is self.options.stages[-1])
        ):
            schedule.increase()
        if linear is not None and kappa == kappa_grad:
            self._subproblem.expand(self.now, linear)
        return alpha

    def _record(self, predicted: PredictedChange, stage: Stage, kappa_grad: float, mu: float, alpha: float) -> bool:
        """Put the iteration into the history; True when the callback wants to stop."""
        now, change = self.now, alpha * (predicted.d0 + 0.5 * alpha * predicted.d1)
        kappas = {"kappa_eval": stage.kappa_eval, "kappa_grad": kappa_grad}
        merit = {"cost": now.cost, "merit": now.merit, "gradient": predicted.gradient}
        step = {"mu": mu, "alpha": alpha, "predicted": change, "gap": now.gap}
        return self._history.add(**merit, **kappas, **step, violation=self.objective.violation(now.x, now.u))

    def _recover(self, stage: Stage, kappa_grad: float) -> float | None:
        """After several failed searches: close open gaps, else bring the derivatives nearer to the rollouts. The
        smoothing of the derivatives from now on, None when there is nothing to change.
        """
        if self.now.gaps is not None:
            return kappa_grad if self._close_gaps(stage) else None
        if kappa_grad <= 1.01 * stage.kappa_eval:  # rounding of the factors is not a level of its own
            return None
        self._subproblem.schedule.reset()
        self._subproblem.forget()
        return max(_SHARPER * kappa_grad, stage.kappa_eval)

    def _close_gaps(self, stage: Stage) -> bool:
        """Close the gaps by a rollout; False where that falls over, but the last stage must not leave gaps."""
        # gains without the regularisation of the failures, which leads to open-loop rollouts
        self._subproblem.schedule.reset()
        before = self.now
        if self._subproblem.gains(before).status != Status.SOLVED or not self._roll_out(stage.kappa_eval):
            return False
        if stage is self.options.stages[-1] or self.now.merit <= _LOST * before.merit:
            return True
        self.now = before
        return False

    # ---- the plan ---------------------------------------------------------------------------------------------------

    def _finish(self, stage: Stage) -> None:
        """Close the gaps at the last smoothing, and compute the gains of the trajectory that is returned.

        The gains have the regularisation of the problem, or the least one that every Q_uu needs: that of the last
        iterations only shortens their steps, and would leave little feedback.
        """
        if self.now.gaps is not None or self.now.kappa != stage.kappa_eval:
            self._roll_out(stage.kappa_eval)
        local, now = self._subproblem, self.now
        if local.is_at(now) or local.linearize(now, stage.kappa_grad, stage.kappa_eval) == Status.SOLVED:
            local.schedule.reset(self.problem.gain_regularization)
            local.gains(now)

    def _plan(self, status: Status, detail: str) -> Plan:
        """The result, made consistent at the last smoothing, with the gains that belong to it."""
        options, history, constraints = self.options, self._history, self.objective.constraints
        if status not in (Status.SIMULATION_FAILED, Status.INTERRUPTED):
            self._finish(options.stages[-1])
        now, local = self.now, self._subproblem
        stride = None if local.start is None else local.start.stride
        if stride is not None and status == Status.SOLVED:
            repeated = periodic_gains(local.model(now))
            if repeated is None:
                detail = " The infinitely repeated motion has no stabilising gains; these are the gains of one cycle."
            else:
                local.K[:] = repeated
        violation, culprit = self.objective.worst(now.x, now.u)
        if status != Status.SOLVED and violation > options.violation_tolerance:
            detail += "" if status == Status.INFEASIBLE else " Constraints are not met."
            detail += f" Largest violation: {violation:.2g}, {culprit}."
        if status in FAILED or status == Status.MAX_ITERATIONS:
            detail += overload(self.problem, now.u) + f" {self.problem.advice}".rstrip()
        plan = Plan(
            success=status == Status.SOLVED,
            status=status,
            message=MESSAGES[status] + detail,
            nit=len(history.records),
            fun=now.cost,
            x=now.x,
            u=now.u,
            K=local.K.copy(),
            k=local.k.copy(),
            violation=violation,
            gap=now.gap,
            seconds=time.perf_counter() - history.began,
            time_step=float(self.problem.sim.time_step),
            substeps=self.problem.substeps,
            stride=stride,
            history=history.records,
            multipliers=[term.slope.copy() for term in constraints],
            penalties=[2.0 * term.weight for term in constraints],
            problem=self.problem,
        )
        options.say(plan.closing_line())
        return plan


def _slow_steps(alpha: float, before: Iterate, expecting: bool) -> int:
    """How many steps in a row with next to no decrease end the stage."""
    if before.gaps is None:
        return 1 if alpha >= _GOOD_STEP else _MAX_SLOW_STEPS
    return _MAX_SLOW_STEPS_OPEN if expecting else _MAX_SLOW_STEPS
