"""Settings of `ilqr`, and the stages of its continuation."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from sim import checks

__all__ = ["CONTINUATION", "PLANNED", "Options", "Stage"]


class Stage(NamedTuple):
    """One stage of the continuation: smoothing of the rollouts and of the derivatives [N s m], and when to go on."""

    kappa_eval: float
    kappa_grad: float
    decrease: float = 3e-2  # ends when an iteration promises or brings less than this share of the merit
    iterations: int = 100  # ends after this many


# Contact is discovered at a large kappa, where it acts at a distance, and made true on the way down to the last stage.
# Derivatives are those of the rollouts throughout: a smoother kappa_grad costs a linearisation more per iteration.
CONTINUATION = (
    Stage(3e-2, 3e-2),
    Stage(3e-3, 3e-3),
    Stage(1e-4, 1e-4),
    Stage(1e-6, 1e-6),
)
PLANNED = CONTINUATION[-1].kappa_eval  # [N s m] of plans: a simulator of it reproduces their motion


@dataclass(frozen=True)
class Options:
    """Settings of `ilqr`. The last stage is repeated, with multiplier updates, until the constraints hold."""

    stages: tuple[Stage, ...] = CONTINUATION
    reopen: str = "feedback"  # at a change of kappa: "feedback" rolls out with the gains, "gaps" keeps the states
    follow: float = 1.0  # a rollout that raises the merit by more than this share of it has lost the trajectory
    bisections: int = 3  # of a step of kappa in which the rollout loses the trajectory
    tolerance: float = 1e-3  # the last stage ends when an iteration brings less than this share of the merit
    max_iterations: int = 300  # all of them, rejected ones included
    max_updates: int = 20  # multiplier updates before the constraints count as infeasible
    violation: float = 1e-3  # largest violation of a plan that counts as solved
    gap: float = 1e-8  # largest gap of a trajectory that counts as consistent
    penalty: float = 100.0  # first, in units of the curvature of the costs: a goal is worth its effort
    penalty_growth: float = 10.0
    penalty_max: float = 1e8
    sufficient: float = 0.25  # the penalty of an entry grows when its violation fell to more than this share
    regularization: float = 0.0  # first; in units of the mean control weight
    regularization_max: float = 1e6
    value_regularization: float = 0.0  # share of the regularisation that goes to V_xx, in units of 1
    armijo: float = 1e-2  # share of the predicted decrease that a step has to bring
    ascent: float = 2.0  # with open gaps: allowed multiple of a predicted increase
    halvings: int = 6  # of the step size
    rejections: int = 2  # failed line searches in a row before gaps are closed by force or derivatives sharpened
    shooting: float = 1.0  # with open gaps, a shorter step is compared with one of multiple shooting
    time_limit: float = float("inf")  # [s]
    callback: Callable[[dict[str, Any]], None] | None = None  # once per iteration; may raise StopIteration
    verbose: bool = False
    stream: Any = None  # where the table goes, standard output by default

    def __post_init__(self) -> None:
        if self.reopen not in ("feedback", "gaps"):
            raise ValueError(f'ilqr(reopen=...): expected "feedback" or "gaps", got {self.reopen!r}')
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, int | float) and not isinstance(field.default, bool):
                self._check_number(field.name, value, whole=isinstance(field.default, int))
        if self.callback is not None and not callable(self.callback):
            raise TypeError(f"ilqr(callback=...): expected a function of a record, got {self.callback!r}")
        stages = self._stages()
        object.__setattr__(self, "stages", (*stages[:-1], stages[-1]._replace(decrease=self.tolerance)))
        for stage in self.stages:
            kappas = [checks.number("ilqr(stages=...): kappa", k) for k in (stage.kappa_eval, stage.kappa_grad)]
            if not min(kappas) > 0.0:
                raise ValueError(f"ilqr(stages=...): expected positive kappa, got {stage}")

    def _stages(self) -> tuple[Stage, ...]:
        """The stages as such; a user may give plain tuples."""
        try:
            stages = tuple(Stage(*stage) for stage in self.stages)
        except TypeError:
            wanted = "pairs (kappa_eval, kappa_grad) or Stages"
            raise TypeError(f"ilqr(stages=...): expected {wanted}, got {self.stages!r}") from None
        if len(stages) == 0:
            raise ValueError("ilqr(stages=...): expected at least one stage")
        return stages

    @staticmethod
    def _check_number(name: str, value: Any, *, whole: bool) -> None:
        """Refuse what is no number >= 0, and fractions where a count is asked for; infinity is allowed."""
        kinds = (int, np.integer) if whole else (int, float, np.integer, np.floating)
        if isinstance(value, bool) or not isinstance(value, kinds) or not value >= 0:
            what = "a whole number" if whole else "a number"
            raise ValueError(f"ilqr({name}=...): expected {what} >= 0, got {value!r}")

    def say(self, line: str) -> None:
        """Print a line where the table goes, if `verbose`."""
        if self.verbose:
            print(line, file=self.stream or sys.stdout)
