"""Attempt: how far the planner got from one of the stages that a guess may begin with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_opt.continuation import Continuation
from dojo_opt.descent import Descent
from dojo_opt.line_search import Iterate
from dojo_opt.objective import Objective
from solvers.status import Status

Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]

__all__ = ["FAILED", "Attempt"]

# ends of an attempt after which another first stage may lead further; all others end the solve
FAILED = (
    Status.SIMULATION_FAILED,
    Status.INFEASIBLE,
    Status.LINE_SEARCH,
    Status.MAX_REGULARIZATION,
    Status.NOT_FINITE,
)


class Attempt(NamedTuple):
    """Where it ended, with what belongs to that: gains, multipliers, penalties."""

    status: Status
    detail: str
    mismatch: float  # of the constraints, infinite with open gaps or where the simulation failed
    now: Iterate
    kappa: float | None
    K: Stack
    slopes: list[Matrix]
    weights: list[Matrix]

    @classmethod
    def ended(cls, status: Status, continuation: Continuation, descent: Descent, objective: Objective) -> Attempt:
        """The present state of the planner."""
        now = continuation.now
        lost = now.gaps is not None or status == Status.SIMULATION_FAILED or not np.isfinite(now.merit)
        return cls(
            status=status,
            detail=descent.detail,
            mismatch=float("inf") if lost else objective.mismatch(now.x, now.u),
            now=now,
            kappa=continuation.kappa,
            K=descent.K.copy(),
            slopes=[term.slope.copy() for term in objective.constraints],
            weights=[term.weight.copy() for term in objective.constraints],
        )

    def restore(self, continuation: Continuation, descent: Descent, objective: Objective) -> None:
        """Go back to it."""
        continuation.start(self.now, self.kappa)
        descent.K[:] = self.K
        for term, slope, weight in zip(objective.constraints, self.slopes, self.weights, strict=True):
            term.slope[:], term.weight[:] = slope, weight
