"""Refinement: a plan that is solved again with shorter time steps, once or until its replay agrees with it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dojo_opt.planning.objective import Objective
from dojo_opt.planning.options import Options
from dojo_opt.planning.overload import overload
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import REPLAY_ACCURACY, Problem
from sim.model.interruptible_loops import TimeUp, ends_at
from sim.simulator.results import FeedbackRollout, Interrupted
from solvers.status import MESSAGES, Status

__all__ = ["FAILED", "coordinate_error", "refine", "replay_error"]

# ends of an attempt after which another first stage may lead further; all others end the solve
FAILED = (Status.SIMULATION_FAILED, Status.INFEASIBLE, Status.LINE_SEARCH, Status.MAX_REGULARIZATION, Status.NOT_FINITE)

_MOST = 32  # parts of a time step
_HARD = 2  # last stages, of the second try

Solve = Callable[[Problem, Plan, Options], Plan]  # of a problem, from a plan


def refine(problem: Problem, plan: Plan, options: Options, solve: Solve) -> Plan:
    """The plan solved again with shorter time steps, as the problem asks.

    First every time step is divided into `refinement` parts. With a `refined_accuracy` the number of parts is doubled
    until plan and replay are no further apart than that; more than 32 parts make
    problems that are hard to solve.

    Smooth stages may find a cheaper motion, or lose that of the plan. If they end in a failure, the plan is solved
    again from where it was, by the last two stages alone.

    A plan that is no nearer to the `refined_constraints` than the start, such as a jump that stays on the ground, is
    not refined: shorter steps have never lifted one.

    Args:
        problem: the problem, with its own time steps.
        plan: its solved plan.
        options: of `ilqr`; their limits are those of all solves and replays together.
        solve: solves a problem with shorter steps, from a plan.

    Returns:
        The last plan, with the iterations and the time of all; ACCURACY_NOT_REACHED if the replay is still too far off,
        INFEASIBLE if the first plan is not refined, MAX_ITERATIONS or TIME_LIMIT if nothing is left for a solve.

    Raises:
        Interrupted: after Ctrl-C during a replay; its `result` is the plan so far.
    """
    began = time.perf_counter() - plan.seconds
    plans, count, asked = [plan], problem.refinement, problem.refined_accuracy
    if count == 1 and asked is not None and problem.refined_constraints:
        count = 2  # these are constraints of a refined problem
    while True:
        if count > 1:
            if len(plans) == 1 and (missed := _missed(problem, plan, options)) is not None:
                return missed
            left = _left(options, plans, began)
            if isinstance(left, Status):
                return _ended(_joined(plans, began, options), left)
            options.say(f"Refinement: every time step divided by {count}:")
            plans += _solved(problem.refined(count), plans, options, left, solve, began)
        if asked is None or not plans[-1].success:
            return plans[0] if len(plans) == 1 else _joined(plans, began, options)  # as its own last line has it
        try:
            with ends_at(began + options.time_limit):
                apart = replay_error(plans[-1])
        except TimeUp:
            return _ended(_joined(plans, began, options), Status.TIME_LIMIT)
        except KeyboardInterrupt:
            raise Interrupted(_ended(_joined(plans, began, options), Status.INTERRUPTED)) from None
        options.say(f"Replay with an accuracy of {REPLAY_ACCURACY:g}: {apart:.1e} from the plan, asked {asked:g}")
        if apart <= asked:
            return _joined(plans, began, options)
        if 2 * count > _MOST:
            detail = f" {apart:.1e} apart, asked {asked:g}."
            return _ended(_joined(plans, began, options), Status.ACCURACY_NOT_REACHED, detail)
        count *= 2


def _solved(
    finer: Problem, plans: list[Plan], options: Options, left: Options, solve: Solve, began: float
) -> list[Plan]:
    """Plans of the finer problem, from the last one, in the order of the tries but for a second one that fails, too."""
    first = solve(finer, plans[-1], left)
    again = _left(options, [*plans, first], began)
    if first.status not in FAILED or len(options.stages) <= _HARD or isinstance(again, Status):
        return [first]
    options.say(f"{first.status.name}; again from the plan before, by the last {_HARD} stages")
    second = solve(finer, plans[-1], replace(again, stages=again.stages[-_HARD:]))
    return [first, second] if second.success else [second, first]


def _left(options: Options, plans: list[Plan], began: float) -> Options | Status:
    """The options with what is left of their limits; the status of the limit that is reached, if one is."""
    iterations = options.max_iterations - sum(plan.nit for plan in plans)
    seconds = options.time_limit - (time.perf_counter() - began)
    if iterations < 1:
        return Status.MAX_ITERATIONS
    return replace(options, max_iterations=iterations, time_limit=seconds) if seconds > 0.0 else Status.TIME_LIMIT


def _missed(problem: Problem, plan: Plan, options: Options) -> Plan | None:
    """The plan as one that fails, if it is no nearer to the `refined_constraints` than the start; else None."""
    if not problem.refined_constraints:
        return None
    still = np.tile(problem.start, (problem.horizon + 1, 1)), np.zeros_like(plan.u)
    objective = Objective(problem.only_refined_constraints(), options)
    (off, culprit), at_first = objective.worst(plan.x, plan.u), objective.worst(*still)[0]
    if at_first <= options.violation_tolerance or off < at_first:
        return None
    message = MESSAGES[Status.INFEASIBLE] + (
        " With its own time steps the plan violates the constraints of the refined problem no less than the start, "
        f"by {off:.2g}, {culprit}.{overload(problem, plan.u)} {problem.advice}"
    )
    options.say(f"INFEASIBLE: {message.rstrip()}")
    return replace(plan, success=False, status=Status.INFEASIBLE, message=message.rstrip(), violation=off)


def replay_error(plan: Plan) -> float:
    """`coordinate_error` of the replay of a plan."""
    return coordinate_error(plan, plan.replay(accuracy=REPLAY_ACCURACY))


def coordinate_error(plan: Plan, replay: FeedbackRollout) -> float:
    """Largest difference of a coordinate between a plan and its replay, at any knot [m, rad]; infinite if it ends."""
    if replay.status != Status.SOLVED:
        return np.inf
    sim = plan.simulator
    return float(np.abs(sim.difference(plan.x, replay.x)[:, : sim.nv]).max())


def _ended(plan: Plan, status: Status, detail: str = "") -> Plan:
    """The plan with another end."""
    message = MESSAGES[status] if status != Status.ACCURACY_NOT_REACHED else "The replay does not agree with the plan:"
    return replace(plan, success=False, status=status, message=message + detail)


def _joined(plans: list[Plan], began: float, options: Options) -> Plan:
    """The last plan, with the iterations and records of all, and the time since the first began, replays included."""
    seconds = time.perf_counter() - began
    if len(plans) == 1:
        return replace(plans[0], seconds=seconds)
    history = [record for plan in plans for record in plan.history]
    counts = " + ".join(str(plan.nit) for plan in plans)
    options.say(f"{counts} iterations, {1e3 * seconds:.1f} ms in all")
    return replace(plans[-1], nit=sum(plan.nit for plan in plans), history=history, seconds=seconds)
