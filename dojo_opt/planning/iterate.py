"""Iterate: a trajectory with its cost; Iteration: the end of a stage of iterations."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from solvers.status import Status
from solvers.types import Matrix, Stack

__all__ = ["Iterate", "Iteration"]


class Iterate(NamedTuple):
    """A trajectory and its cost."""

    x: Matrix  # (T + 1, nx) states
    u: Matrix  # (T, nu) inputs
    gaps: Matrix | None = None  # (T + 1, ndx) f(x_t, u_t) (-) x_{t+1}; None when consistent
    cost: float = np.inf  # without the terms of the constraints
    merit: float = np.inf  # cost + augmented Lagrangian
    kappa: float | None = None  # smoothing [N s m] of the motion to which the gaps belong; None: gaps not known yet
    steps: Any = None  # cone variables of the steps, the starting points of a rollout nearby (sim/simulator/horizon.py)

    @property
    def gap(self) -> float:
        """Largest entry of the gaps, infinite as long as they are not known."""
        if self.kappa is None:
            return np.inf
        return 0.0 if self.gaps is None else float(np.abs(self.gaps).max())


class Iteration(NamedTuple):
    """Result of `Solver.iterate`."""

    status: Status  # SOLVED: the stage converged; MAX_ITERATIONS: it used all its iterations; LINE_SEARCH: stuck
    message: str
    now: Iterate  # the trajectory that was reached
    K: Stack  # (T, nu, ndx) gains of the last backward pass
    k: Matrix  # (T, nu) step that it proposes
    history: list[dict[str, Any]]  # one record per iteration, as in `Plan.history`

    @property
    def success(self) -> bool:
        """Whether the stage was not cut short: it converged, or used all its iterations."""
        return self.status in (Status.SOLVED, Status.MAX_ITERATIONS)

    @property
    def alpha(self) -> float:
        """Last step size; 0 after a rejected step, 1 when no iteration was needed."""
        return float(self.history[-1]["alpha"]) if self.history else 1.0

    @property
    def consistent(self) -> bool:
        """Whether a step was accepted, or the trajectory has no gaps: not a guess handed back."""
        return self.now.gaps is None or any(record["alpha"] > 0.0 for record in self.history)
