"""Multi-start: a problem planned from several guesses, one after the other or in workers, and the best plan."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.executors import results_in_order
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from sim.mechanism.memory_limit import room_for
from sim.simulator.results import Interrupted
from solvers.types import Matrix, Vector

Planner = Callable[..., Plan]

__all__ = ["multi_start", "of_problem", "planned"]

_POINTS = 6  # of the splines that are added to a guess
_SHARE = 0.25  # of the range of a limited input: standard deviation of a point
_EARTH = 9.81  # [m/s^2] also where there is no gravity: the weight stands for the size of forces
_INPUT_SHARE = 0.3  # times the largest input of a guess: it solves 10 of 12 hops, the whole of it 4 of 8

# controls, states and warm start
Guess = tuple[ArrayLike | None, ArrayLike | None, Plan | None]


def multi_start(
    planner: Planner,
    problem: Problem,
    guess: Guess,
    settings: dict[str, Any],
    starts: int,
    seed: int,
    executor: Executor | None,
) -> Plan:
    """The best of the plans from a guess and from starts - 1 random changes of its inputs.

    A change is linear between random points, so that it moves the robot rather than shakes it. Start i depends on the
    seed and on i alone.

    Args:
        planner: `ilqr`; workers import it.
        problem: the problem; each start has a copy of it, with buffers of its own.
        guess: controls, states and warm start, as `ilqr` takes them.
        settings: its options.
        starts: number of plans.
        seed: seed of the random changes.
        executor: whose workers plan (default None: one plan after the other).

    Returns:
        The cheapest of the solved plans, else that with the least violation.

    Raises:
        Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the best of the finished plans, None without
            any.
    """
    numbers = problem.horizon * (problem.sim.nx + problem.sim.nu * (2 + problem.sim.ndx))  # x, u, k, K of a plan
    room_for("ilqr(starts=...)", starts, 8.0 * numbers, noun="starts")
    controls, _, warm_start = guess
    center = problem.controls0 if warm_start is None else warm_start.u
    center = center if controls is None else problem.check_controls("ilqr(controls=...)", controls)
    spread = _spread(problem, center)
    children = np.random.SeedSequence(seed).spawn(starts - 1)
    guesses = [guess, *((_changed(problem, center, spread, child), None, None) for child in children)]
    tasks = [(planner, problem, one, settings) for one in guesses]
    plans: list[Plan] = []
    try:
        plans.extend(results_in_order(planned, tasks, executor))  # those before Ctrl-C stay
    except KeyboardInterrupt as stop:
        begun = getattr(stop, "result", None)
        raise Interrupted(_best(problem, plans, starts) if plans else begun) from None
    return _best(problem, plans, starts)


def _spread(problem: Problem, center: Matrix) -> Vector:
    """(nu,) standard deviation of the points: a share of the limits, else of the largest input of the guess.

    For guesses that are zero it is a share of the robot's weight [N, N m].
    """
    limits, largest = problem.control_limits, float(np.abs(center).max(initial=0.0))
    free = _INPUT_SHARE * (largest or _EARTH * sum(float(body.mass) for body in problem.sim.mechanism.bodies))
    if limits is None:
        return np.full(problem.sim.nu, free)
    wide = limits[1] - limits[0]
    return np.where(np.isfinite(wide), _SHARE * wide, free)


def _changed(problem: Problem, center: Matrix, spread: Vector, seed: np.random.SeedSequence) -> Matrix:
    """(T, nu) inputs of a start."""
    points = spread * np.random.default_rng(seed).standard_normal((_POINTS, problem.sim.nu))
    at = np.linspace(0.0, _POINTS - 1.0, problem.horizon)
    out = center + np.stack([np.interp(at, np.arange(float(_POINTS)), column) for column in points.T], axis=1)
    return out if problem.control_limits is None else np.clip(out, *problem.control_limits)


def planned(planner: Planner, problem: Problem, guess: Guess, settings: dict[str, Any]) -> Plan:
    """One plan, without its problem, which the caller has; at module level, so that other processes can import it."""
    own = problem.with_own_terms(fixed_start=False)
    controls, states, warm_start = guess
    plan = planner(own, controls, states, warm_start=warm_start, **settings)
    return replace(plan, problem=None, simulator=None)


def _best(problem: Problem, plans: list[Plan], starts: int) -> Plan:
    """The best plan; its message says how many are solved, its `seconds` are those of all."""
    solved = [plan for plan in plans if plan.success]
    best = min(solved, key=lambda plan: plan.fun) if solved else min(plans, key=lambda p: (p.violation, p.gap, p.fun))
    message = f"{best.message} The best of {starts} starts, {len(solved)} of them solved."
    seconds = sum(plan.seconds for plan in plans)
    return replace(of_problem(best, problem), message=message, seconds=seconds)


def of_problem(plan: Plan, problem: Problem) -> Plan:
    """The plan with its problem: the caller's, or that with shorter time steps where the refinement was reached.

    Args:
        plan: a plan without its problem, from a worker.
        problem: the caller's.

    Returns:
        The plan.
    """
    of = problem if plan.substeps == problem.substeps else problem.refined(plan.substeps // problem.substeps)
    return replace(plan, problem=of, simulator=of.sim)
