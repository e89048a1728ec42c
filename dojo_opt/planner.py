"""`ilqr`: iterative LQR with gaps, single and multiple shooting in one code path, through contact that hardens.

One iteration: differentiate the time steps along the trajectory, solve the linear-quadratic problem around it
(`Descent`), and roll the gains out (`LineSearch`). Stages lower the smoothing; from one to the next the trajectory is
rolled out with its gains, or its states are kept and its gaps opened: never open loop, which an unstable robot does not
survive.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.attempt import FAILED, Attempt
from dojo_opt.continuation import Continuation
from dojo_opt.descent import Descent
from dojo_opt.line_search import Iterate, LineSearch
from dojo_opt.objective import Objective
from dojo_opt.options import Options, Stage
from dojo_opt.plan import Plan
from dojo_opt.problem import Problem
from dojo_opt.shooting import Shooting
from sim.mechanism import checks
from sim.simulator.results import Interrupted
from solvers.status import MESSAGES, Status

__all__ = ["Solver", "ilqr"]

_LESS = 0.9  # share of the least violation so far: what counts as progress
_STALLED = 5  # multiplier updates of the last stage without progress
_SOFTEN = 3  # times that a stuck last stage may go back to the one before it


def ilqr(
    problem: Problem,
    controls: ArrayLike | None = None,
    states: ArrayLike | None = None,
    *,
    warm_start: Plan | None = None,
    options: Options | None = None,
    **settings: Any,
) -> Plan:
    """Plan a trajectory.

    controls (T, nu), states (T + 1, nx): the guess, by default the problem's own. warm_start: an earlier plan of the
    same problem, whose trajectory, multipliers and penalties are taken over. It may be a plan of an easier variant,
    with more damping, say: what fails directly is often planned by way of it. settings: fields of
    `dojo.Options` by name.

    A guess of states begins at the stage that it fits best, so that a good one is not led away by smooth contact; one
    in which something rests that has to move begins at the smoothest. Where that fails, the planner begins again at
    another, within `max_iterations`. The table of iterations says so.

    A problem with a `refinement` is planned with its own time steps first, and from there with shorter ones; the plan
    is one of the finer problem then, and its history is that of both.

    Ctrl-C raises `Interrupted`, a KeyboardInterrupt; its `result` is the Plan of the last iteration, INTERRUPTED.
    """
    checks.keywords("ilqr(...)", settings, Options.__dataclass_fields__)
    if options is not None and not isinstance(options, Options):
        raise TypeError(f"ilqr(options=...): expected Options, got {options!r}")
    if warm_start is not None and not isinstance(warm_start, Plan):
        raise TypeError(f"ilqr(warm_start=...): expected a Plan, got {warm_start!r}")
    options = Options(**settings) if options is None else replace(options, **settings)
    solver = Solver(problem, options)
    finer = None if problem.refinement == 1 else problem.refined(problem.refinement)  # refused before any work
    plan = solver.solve(controls, states, warm_start)
    if finer is None or not plan.success:
        return plan
    options.say(f"Once more, every time step cut into {problem.refinement}:")
    last = Solver(finer, options).solve(warm_start=plan)
    history, seconds = plan.history + last.history, plan.seconds + last.seconds
    both = replace(last, nit=plan.nit + last.nit, history=history, seconds=seconds)
    options.say(f"{plan.nit} + {last.nit} iterations, {1e3 * seconds:.1f} ms in all")
    return both


class Solver:
    """iLQR with its buffers, for problems that are solved again and again from changing starts."""

    def __init__(self, problem: Problem, options: Options | None = None) -> None:
        if not isinstance(problem, Problem):
            raise TypeError(f"ilqr(problem): expected a Problem, got {problem!r}")
        self.problem = problem
        self.options = Options() if options is None else options
        self.horizon = problem.sim.horizon(problem.horizon, problem.substeps, problem.control_limits)
        self.objective = Objective(problem, self.options)
        self.descent = Descent(problem, self.horizon, self.objective, self.options)
        self.line_search = LineSearch(problem, self.horizon, self.objective, self.options)
        self.continuation = Continuation(
            self.horizon,
            self.options,
            self.objective,
            self.descent,
            self.line_search,
            Shooting(problem, self.horizon, self.objective, self.options),
        )

    def solve(
        self, controls: ArrayLike | None = None, states: ArrayLike | None = None, warm_start: Plan | None = None
    ) -> Plan:
        """Plan from a guess; see `ilqr`."""
        try:
            return self._solve(controls, states, warm_start)
        except KeyboardInterrupt:
            raise Interrupted(self._plan(Status.INTERRUPTED, "") if self.continuation.begun else None) from None

    def _solve(self, controls: ArrayLike | None, states: ArrayLike | None, warm_start: Plan | None) -> Plan:
        """As `solve`."""
        self.continuation.reset()
        self._forget(warm_start)
        if warm_start is not None:
            controls = warm_start.u if controls is None else controls
            states = warm_start.x if states is None else states
        status, detail = self._guess(controls, states)
        if status == Status.SOLVED:
            status, detail = self._run(warm_start)
        return self._plan(status, detail)

    def _forget(self, warm_start: Plan | None) -> None:
        """Regularisation, gains, multipliers and penalties as before the first iteration."""
        self.descent.reset()
        if warm_start is None:
            self.objective.reset()
        else:
            self.objective.reset(warm_start.multipliers, warm_start.penalties)

    def _guess(self, controls: ArrayLike | None, states: ArrayLike | None) -> tuple[Status, str]:
        """First iterate: the rollout of the controls, or the given states with their gaps still to be opened."""
        problem, search = self.problem, self.line_search
        us = problem.controls0 if controls is None else problem.check_controls("ilqr(controls=...)", controls)
        if problem.control_limits is not None:
            us = np.clip(us, *problem.control_limits)
        xs = problem.states0 if states is None and controls is None else states
        if xs is not None:
            xs = self.horizon.states("ilqr(states=...)", problem.check_states("ilqr(states=...)", xs))
            self.continuation.start(Iterate(xs, us, None, *self.objective.evaluate(xs, us)), None)
            return Status.SOLVED, ""
        idle = Iterate(np.tile(problem.start, (problem.horizon + 1, 1)), us, None, np.inf, np.inf)
        kappa = self.options.stages[0].kappa_eval
        shot = search.roll(idle, None, None, 1.0, kappa)
        if shot.status != Status.SOLVED:
            self.continuation.start(idle, kappa)
            reason = Status(int(shot.status))
            return Status.SIMULATION_FAILED, f" Knot {int(shot.knot)}, {reason.name}: {MESSAGES[reason]}"
        self.continuation.start(search.accept(shot, None), kappa)
        return Status.SOLVED, ""

    def _run(self, warm_start: Plan | None) -> tuple[Status, str]:
        """Attempts from the guess, each beginning at a stage, until one is good; else that with the least violation."""
        continuation, journal, guess = self.continuation, self.continuation.journal, self.continuation.now
        parts = (continuation, self.descent, self.objective)
        kappas = [f"{stage.kappa_eval:.0e}" for stage in self.options.stages]
        ends: list[Attempt] = []
        for first in continuation.first_stages(self.problem.sim):
            if ends:
                journal.note(f"{ends[-1].status.name}; again from the guess, beginning at k_eval {kappas[first]}")
                self._forget(warm_start)
                continuation.start(guess, None)
            elif first:
                skipped = ", ".join(kappas[:first])
                journal.note(f"k_eval {skipped} skipped: the guess of states fits {kappas[first]} best")
            status = self._descend(first)
            ends.append(Attempt.ended(status, *parts))
            if status not in FAILED or ends[-1].mismatch <= self.options.violation:
                return status, "" if status == Status.SOLVED else self.descent.detail
        best = min(ends, key=lambda end: end.mismatch)
        if best is not ends[-1]:
            best.restore(*parts)
        return best.status, best.detail

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
            now = self.continuation.now
            if index == last:
                mismatch = self.objective.mismatch(now.x, now.u)
                if mismatch <= options.violation and now.gap <= options.gap:
                    return status
                stalled = 0 if mismatch < _LESS * least else stalled + 1
                least = min(least, mismatch)
                if stalled >= _STALLED:
                    return Status.INFEASIBLE
                if status == Status.LINE_SEARCH and last > 0:
                    if softened >= _SOFTEN:
                        return status
                    index, softened = last - 1, softened + 1
                    continue
            self.objective.update_multipliers(now.x, now.u)
            self.continuation.remeasure()
            index = min(index + 1, last)
        return Status.INFEASIBLE

    def _stage(self, stage: Stage, bisections: int) -> Status:
        """One stage; when the trajectory does not survive the step of kappa, by way of the geometric mean."""
        continuation = self.continuation
        kappa = continuation.kappa
        if self.options.reopen == "feedback" and bisections > 0 and kappa is not None:
            if not continuation.follow(stage.kappa_eval):
                middle = (kappa * stage.kappa_eval) ** 0.5
                status = self._stage(Stage(middle, max(middle, stage.kappa_grad), stage.decrease), bisections - 1)
                if status not in (Status.SOLVED, Status.LINE_SEARCH, Status.SIMULATION_FAILED):
                    return status
        return continuation.run(stage)

    def _plan(self, status: Status, detail: str) -> Plan:
        """What was reached, made consistent at the last smoothing, with the gains that belong to it."""
        continuation, journal, options = self.continuation, self.continuation.journal, self.options
        if status not in (Status.SIMULATION_FAILED, Status.INTERRUPTED):
            continuation.finish(options.stages[-1])
        now, stride = continuation.now, self.descent.stride
        if stride is not None and status == Status.SOLVED and not self.descent.repeat(now):
            detail = " Its gains are those of a single cycle: the motion repeated for ever has none."
        violation, culprit = self.objective.worst(now.x, now.u)
        if status != Status.SOLVED and violation > options.violation:
            detail += "" if status == Status.INFEASIBLE else " Constraints are not met."
            detail += f" Violated most: {culprit}, by {violation:.2g}."
        plan = Plan(
            success=status == Status.SOLVED,
            status=status,
            message=MESSAGES[status] + detail,
            nit=len(journal.records),
            fun=now.cost,
            x=now.x,
            u=now.u,
            K=self.descent.K.copy(),
            k=self.descent.k.copy(),
            violation=violation,
            gap=now.gap,
            seconds=time.perf_counter() - journal.begin,
            time_step=float(self.problem.sim.time_step),
            substeps=self.problem.substeps,
            stride=stride,
            history=journal.records,
            multipliers=[term.slope.copy() for term in self.objective.constraints],
            penalties=[2.0 * term.weight for term in self.objective.constraints],
            problem=self.problem,
        )
        options.say(plan.closing_line())
        return plan
