"""One plan: its cost, its fidelity, and the history of cost and violation against processor time."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

import dojo_opt as dojo
from benchmarks.engines.mujoco_ilqr import MujocoIlqr, MujocoSettings
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from solvers.types import Matrix

HARD = 1e-8  # kappa of the contact on which a plan is replayed
REFINE = 5  # steps of the plant per step of the plan
OURS, MUJOCO = "dojo-opt", "MuJoCo and NumPy"


class PlanOutcome(NamedTuple):
    """A plan and its replays: with its gains and limits, on hard contact."""

    planner: str
    setting: str
    success: bool
    message: str  # why it did not succeed
    iterations: int
    cost: float
    violation: float
    seconds: float  # processor time
    hard: tuple[float, float]  # (cost, violation) at the time step of the plan
    fine: tuple[float, float]  # (cost, violation) at a fifth of it
    upright: float  # least cosine between the z axis of the base and the vertical
    history: Matrix  # (iterations, 4) processor time [s], cost, violation, gap


def ours(problem: Problem, setting: str = "default", *, rounds: int = 1, **options: Any) -> PlanOutcome:
    """Plan by `ilqr`; the median time of `rounds` after one that is not clocked (none when there is one round)."""
    plan, history, seconds = _clocked(problem, options)
    if rounds > 1:
        runs = [_clocked(problem, options) for _ in range(rounds)]
        plan, history, seconds = sorted(runs, key=lambda run: run[2])[rounds // 2]
    message = "" if plan.success else plan.status.name
    hard, fine = _replay(plan, 1), _replay(plan, REFINE)
    found = plan.fun, plan.violation, seconds
    return PlanOutcome(
        OURS, setting, bool(plan.success), message, plan.nit, *found, hard, fine, upright(plan.x), history
    )


def peer(problem: Problem, settings: MujocoSettings) -> PlanOutcome:
    """Plan by MuJoCo's differences and iLQR in NumPy; the replay at its own time step is the plan itself."""
    solver = MujocoIlqr(problem, settings)
    start = time.process_time()
    solution = solver.solve()
    seconds = time.process_time() - start
    xs, us = solver.replay(solution, REFINE)
    name = f"steps of {1e3 * solver.time_step:g} ms"
    name += ", centred" * settings.centered + ", solimp[0] = 0" * settings.smooth
    message, found = solution.message, (solution.cost, solution.violation)
    history = (
        np.column_stack([np.cumsum(solution.seconds), solution.history]) if solution.iterations else np.zeros((0, 4))
    )
    return PlanOutcome(
        MUJOCO,
        name,
        not message,
        message,
        solution.iterations,
        *found,
        seconds,
        found,
        _judged(problem, xs, us),
        upright(solution.x),
        history,
    )


def upright(x: Matrix) -> float:
    """Least cosine between the base's z axis and the vertical, over states that begin with a floating base."""
    return float((1.0 - 2.0 * (x[:, 4] ** 2 + x[:, 5] ** 2)).min())


def _clocked(problem: Problem, options: dict[str, Any]) -> tuple[Plan, Matrix, float]:
    stamps: list[float] = []
    start = time.process_time()
    plan = dojo.ilqr(problem, callback=lambda record: stamps.append(time.process_time() - start), **options)
    seconds = time.process_time() - start
    columns = [[record[name] for record in plan.history] for name in ("cost", "violation", "gap")]
    return plan, np.array([stamps, *columns]).T, seconds


def _replay(plan: Plan, refine: int) -> tuple[float, float]:
    shot = plan.replay(time_step=plan.time_step / refine, kappa=HARD)
    return _judged(plan.problem, shot.x, shot.u) if shot.success else (np.nan, np.nan)


def _judged(problem: Problem, xs: Matrix, us: Matrix) -> tuple[float, float]:
    if not np.all(np.isfinite(xs)):
        return np.nan, np.nan
    return problem.cost(xs, us), problem.violation(xs, us)
