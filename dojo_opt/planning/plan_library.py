"""plan_library: the plans of many problems, from one planner, wherever they are computed."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Executor
from typing import Any

from dojo_opt.planning.executors import check_executor, results_in_order
from dojo_opt.planning.ilqr import ilqr
from dojo_opt.planning.multi_start import of_problem, planned
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from sim.mechanism import checks
from sim.simulator.results import Interrupted

__all__ = ["plan_library"]


def plan_library(problems: Iterable[Problem], *, executor: Executor | None = None, **options: Any) -> list[Plan]:
    """A plan of every problem, as many goals or starts of one robot: to imitate, to begin from, or to compare.

        plans = dojo.plan_library([dojo.problems.hop((d, 0.0)) for d in (0.2, 0.4, 0.6)], executor=pool)
        learned = dojo.learn.imitate(task, plans)

    A plan depends on its problem and on the options alone, neither on the executor nor on the number of its workers.

    Args:
        problems: the problems.
        executor: anything with the interface of `concurrent.futures.Executor`, as for `dojo.monte_carlo` (default None:
            one plan after the other).
        **options: of `ilqr`, for all.

    Returns:
        One plan per problem, in their order; `plan.success` says whether it is solved.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for an option out of range.
        Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` has the finished plans of the first problems.
    """
    call = "plan_library"
    check_executor(call, executor)
    if isinstance(problems, str) or not isinstance(problems, Iterable):
        raise TypeError(f"{call}(problems): expected problems, got {checks.shown(problems)}")
    given = list(problems)
    for problem in given:
        if not isinstance(problem, Problem):
            raise TypeError(f"{call}(problems): expected problems, got {checks.shown(problem)}")
    plans: list[Plan] = []
    try:
        calls = [(ilqr, problem, (None, None, None), options) for problem in given]
        for problem, plan in zip(given, results_in_order(planned, calls, executor), strict=True):
            plans.append(of_problem(plan, problem))
    except KeyboardInterrupt:
        raise Interrupted(plans) from None
    return plans
