"""Settings of `ilqr`, and the stages of its continuation."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from sim.mechanism import checks

__all__ = ["CONTINUATION", "PLANNED", "RENAMED", "Options", "Stage"]

# old names of fields as keywords of `ilqr`, until version 0.2
RENAMED = {
    "violation": "violation_tolerance",
    "gap": "gap_tolerance",
    "follow": "max_merit_increase",
    "ascent": "max_increase_ratio",
    "sufficient": "violation_ratio",
    "shooting": "multiple_shooting_below",
    "reopen": "on_kappa_change",
}


class Stage(NamedTuple):
    """One stage of the continuation: its smoothing, and its end.

    Attributes:
        kappa_eval: smoothing of the contacts in rollouts [N s m].
        kappa_grad: smoothing of the contacts in derivatives [N s m].
        decrease: the stage ends when the predicted or actual decrease of an iteration is less than this share of the
            merit (default None: `Options.tolerance` for the last stage, 0.03 for others).
        iterations: the stage ends after this many iterations (default 100).
    """

    kappa_eval: float
    kappa_grad: float
    decrease: float | None = None
    iterations: int = 100


_COARSE = 3e-2  # decrease of a stage that others follow

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
    """Settings of `ilqr`. The last stage is repeated, with multiplier updates, until the constraints hold.

    The merit is the cost plus the augmented Lagrangian of the constraints.

    Attributes:
        stages: the continuation, from smooth to hard contact: `Stage`s, or pairs (kappa_eval, kappa_grad) [N s m]
            (default 3e-2, 3e-3, 1e-4, 1e-6).
        kappa_blocks: number of blocks of knots over which kappa_grad grows along the horizon, in equal ratios from the
            kappa_eval of a stage to its kappa_grad: derivatives are exact for what happens now, and reach across gaps
            for what happens later (default 1: kappa_grad at all knots).
        on_kappa_change: "feedback" rolls out with the gains, "gaps" keeps the states and opens the gaps (default
            "feedback").
        max_merit_increase: share of the merit; a rollout at the next kappa that raises the merit by more counts as lost
            (default 1).
        bisections: number of times that a step of kappa is halved, on a logarithmic scale, if its rollout is lost
            (default 3).
        tolerance: share of the merit; the last stage ends when an iteration lowers the merit by less, unless it has a
            `decrease` of its own (default 1e-3).
        max_iterations: limit of all iterations, rejected ones included (default 300).
        max_updates: multiplier updates before the constraints count as infeasible (default 20).
        violation_tolerance: largest violation of a constraint in a plan that counts as solved [unit of the residual]
            (default 1e-3).
        gap_tolerance: largest gap, an entry of f(x_t, u_t) (-) x_t+1, of a trajectory that counts as consistent [m,
            rad, m/s, rad/s] (default 1e-8).
        penalty: first penalty of the constraints [curvature of the costs] (default 100: a goal is worth its effort).
        penalty_growth: factor of a penalty that grows (default 10).
        penalty_max: limit of the penalties [1 / square of the residual's unit] (default 1e8).
        violation_ratio: the penalty of an entry grows unless its violation fell below this share of the one before
            (default 0.25).
        regularization: first regularisation of the backward pass [mean control weight] (default 0).
        regularization_max: limit of the regularisation [mean control weight] (default 1e6).
        value_regularization: multiple of the regularisation that is added to the Hessian V_xx of the value (default 0).
        armijo: share of the predicted decrease that a step must achieve (default 0.01).
        max_increase_ratio: allowed multiple of a predicted increase, which only open gaps cause (default 2).
        halvings: number of times that the line search may halve the step size (default 6).
        backtracking: factor from one step size of the line search to the next (default 0.5); 0.25 tries half as many.
        rejections: failed line searches in a row before gaps are closed by a rollout, or kappa_grad is reduced (default
            2).
        multiple_shooting_below: with open gaps, a step size below this is compared with a step of multiple shooting; 0
            for single shooting only (default 1).
        time_limit: limit of the wall time [s] (default inf). It ends iterations and replays in their midst, but neither
            the first rollout nor the last: the best trajectory so far is rolled out, and has its gains.
        callback: function of the record of each iteration; it may raise StopIteration to end the solve (default None).
        verbose: whether to print one line per iteration (default False).
        stream: file for these lines (default None: the standard output).
    """

    stages: tuple[Stage, ...] = CONTINUATION
    kappa_blocks: int = 1
    on_kappa_change: str = "feedback"
    max_merit_increase: float = 1.0
    bisections: int = 3
    tolerance: float = 1e-3
    max_iterations: int = 300
    max_updates: int = 20
    violation_tolerance: float = 1e-3
    gap_tolerance: float = 1e-8
    penalty: float = 100.0
    penalty_growth: float = 10.0
    penalty_max: float = 1e8
    violation_ratio: float = 0.25
    regularization: float = 0.0
    regularization_max: float = 1e6
    value_regularization: float = 0.0
    armijo: float = 1e-2
    max_increase_ratio: float = 2.0
    halvings: int = 6
    backtracking: float = 0.5
    rejections: int = 2
    multiple_shooting_below: float = 1.0
    time_limit: float = float("inf")
    callback: Callable[[dict[str, Any]], None] | None = None
    verbose: bool = False
    stream: Any = None

    def __post_init__(self) -> None:
        checks.flag("ilqr(verbose=...)", self.verbose)
        checks.one_of("ilqr(on_kappa_change=...)", self.on_kappa_change, ("feedback", "gaps"))
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, int | float) and not isinstance(field.default, bool):
                whole = isinstance(field.default, int)
                self._check_number(field.name, value, whole=whole)
                # for a whole number in place of a float, kernels would be compiled again
                object.__setattr__(self, field.name, int(value) if whole else float(value))
        if self.kappa_blocks < 1:
            raise ValueError(f"ilqr(kappa_blocks=...): expected a number >= 1, got {self.kappa_blocks}")
        if not 0.0 < self.backtracking < 1.0:
            raise ValueError(f"ilqr(backtracking=...): expected a number between 0 and 1, got {self.backtracking}")
        if self.callback is not None and not callable(self.callback):
            raise TypeError(f"ilqr(callback=...): expected a function of a record, got {self.callback!r}")
        if self.stream is not None and not hasattr(self.stream, "write"):
            raise TypeError(f"ilqr(stream=...): expected a file, got {checks.shown(self.stream)}")
        stages = self._stages()
        *others, last = stages
        found = [*(_with_decrease(stage, _COARSE) for stage in others), _with_decrease(last, self.tolerance)]
        object.__setattr__(self, "stages", tuple(found))
        for stage in self.stages:
            kappas = [checks.number("ilqr(stages=...): kappa", k) for k in (stage.kappa_eval, stage.kappa_grad)]
            if not min(kappas) > 0.0:
                raise ValueError(f"ilqr(stages=...): expected positive kappa, got {stage}")
            self._check_number("stages", stage.decrease, whole=False)
            self._check_number("stages", stage.iterations, whole=True)

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
        """Refuse anything but numbers >= 0, and fractions for counts; infinity is allowed."""
        kinds = (int, np.integer) if whole else (int, float, np.integer, np.floating)
        if isinstance(value, bool) or not isinstance(value, kinds) or not value >= 0:
            expected = "a whole number" if whole else "a number"
            raise ValueError(f"ilqr({name}=...): expected {expected} >= 0, got {checks.shown(value)}")
        if isinstance(value, int) and value > checks.LARGEST:
            raise ValueError(f"ilqr({name}=...): expected a number <= 2^53, got {checks.shown(value)}")

    def say(self, line: str) -> None:
        """Print a line to the stream of the table of iterations, if `verbose`.

        Args:
            line: the text.
        """
        if self.verbose:
            print(line, file=self.stream or sys.stdout)


def _with_decrease(stage: Stage, decrease: float) -> Stage:
    """The stage, with this decrease unless it has one of its own."""
    return stage if stage.decrease is not None else stage._replace(decrease=decrease)
