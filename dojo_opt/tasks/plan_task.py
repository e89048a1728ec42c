"""PlanTask: a task of a published suite that is planned once: problem, smoothing, and the criterion of success."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.ilqr import ilqr
from dojo_opt.planning.options import Stage
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.same_robot import check_same_robot
from sim.mechanism.checks import shown
from sim.mechanism.short_repr import short_repr

__all__ = ["PlannedOutcome", "PlanTask", "continuation"]


class PlannedOutcome(NamedTuple):
    """How a plan of a task ended.

    Attributes:
        success: whether the planner converged and the plan achieves the aim of the task.
        measures: numbers that decide it, by name with unit.
        cost: cost of the plan.
        iterations: iterations of the planner.
        gap: largest gap of the trajectory [m, rad, m/s, rad/s].
    """

    success: bool
    measures: dict[str, float]
    cost: float
    iterations: int
    gap: float


@dataclass(frozen=True)
class PlanTask:
    """A task of a published suite that is planned once, from a guess that knows nothing of its contacts.

    Attributes:
        name: name of the task.
        problem: problem, with its guess.
        stages: smoothing of the contacts, from the first to the last stage of `ilqr`.
        judge: function of a plan that returns (whether it achieves the aim, the numbers that decide it by name).
    """

    name: str
    problem: Problem
    stages: tuple[Stage, ...]
    judge: Callable[[Plan], tuple[bool, dict[str, float]]] = field(repr=False)

    __repr__ = short_repr

    def run(self, controls: ArrayLike | None = None, **options: Any) -> Plan:
        """Plan the task.

        Args:
            controls: (T, nu) guess of the inputs [N, N m] (default None: that of the problem, zero).
            **options: options of `dojo.ilqr` (default: the stages of the task).

        Returns:
            The plan.

        Raises:
            TypeError: for an unknown option.
            ValueError: for an argument out of range.
            Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the best plan so far.
        """
        return ilqr(self.problem, controls, **{"stages": self.stages, **options})

    def outcome(self, plan: Plan) -> PlannedOutcome:
        """How a plan ended.

        Args:
            plan: a plan of this task.

        Returns:
            Its outcome.

        Raises:
            TypeError: for anything but a Plan.
            ValueError: for a plan of a robot with other coordinates than those of the task.
        """
        if not isinstance(plan, Plan):
            raise TypeError(f"PlanTask.outcome(plan): expected a Plan, as from run(), got {shown(plan)}")
        expected = f"PlanTask.outcome(plan): expected a plan of {self.name!r}"
        check_same_robot(expected, self.problem.sim, plan.simulator, plan.x)
        done, measures = self.judge(plan)
        return PlannedOutcome(plan.success and done, measures, float(plan.fun), int(plan.nit), float(plan.gap))


def continuation(kappas: Sequence[float]) -> tuple[Stage, ...]:
    """Stages with the same smoothing in rollouts and derivatives.

    Args:
        kappas: central-path parameters [N s m].

    Returns:
        The stages.
    """
    return tuple(Stage(kappa, kappa) for kappa in np.asarray(kappas, dtype=np.float64).tolist())
