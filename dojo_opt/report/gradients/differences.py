"""Jacobians of a time step by finite differences, and by extrapolating them to a step size of zero."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sim.simulator.simulator import Simulator
from solvers.status import Status
from solvers.types import Matrix

_FIRST, _LEVELS, _ORDERS = 1e-3, 14, 3  # step sizes 1e-3 2^-k; errors of order 2, 4, 6 and 8


class Reference(NamedTuple):
    """A Jacobian to measure others against."""

    value: Matrix
    doubt: float  # relative difference between the best two estimates of it


def extrapolated(central: Callable[[float], Matrix]) -> Reference:
    """Jacobian from central differences `central(eps)` by Richardson's extrapolation:

        D_k,0 = central(e 2^-k),   D_k,j = D_k,j-1 + (D_k,j-1 - D_k-1,j-1) / (4^j - 1)

    of all D the one that differs least from the two it is made of.   Ridders 1982, Advances in Engineering Software 4.
    RuntimeError: not one pair of differences is finite.
    """
    best: Reference | None = None
    above: list[Matrix] = []
    for k in range(_LEVELS):
        row = [central(_FIRST * 0.5**k)]
        for j in range(1, min(k, _ORDERS) + 1):
            row.append(row[j - 1] + (row[j - 1] - above[j - 1]) / (4.0**j - 1.0))
            doubt = max(relative_error(row[j - 1], row[j]), relative_error(above[j - 1], row[j]))
            if best is None or doubt < best.doubt:  # false for NaN, but for the first
                best = Reference(row[j], doubt) if np.isfinite(doubt) else best
        above = row
    if best is None:
        raise RuntimeError("report gradients: no step near the state can be solved")
    return best


def relative_error(jacobian: Matrix, reference: Matrix) -> float:
    """Frobenius norm of the difference over that of the reference."""
    return float(np.linalg.norm(jacobian - reference) / np.linalg.norm(reference))


class Stepper:
    """(A, B) of our step at (x, u) by differences, (ndx, ndx + nu); all its steps in one compiled call."""

    def __init__(self, sim: Simulator, x: Any, u: Any) -> None:
        self._sim, self._x, self._u = sim, np.asarray(x), np.asarray(u)
        self._origin = sim.step(x, u, throw=True).x

    def points(self, eps: float, *, centered: bool) -> tuple[Matrix, Matrix]:
        """States and inputs beside (x, u), a row or two per column; one-sided: and (x, u) itself, last."""
        n, m = self._sim.ndx, self._sim.nu
        d = eps * np.eye(n + m)
        d = np.concatenate([d, -d if centered else np.zeros((1, n + m))])
        xs = np.array([self._sim.integrate(self._x, dx) for dx in d[:, :n]])
        return xs, self._u + d[:, n:]

    def step(self, xs: Matrix, us: Matrix) -> Matrix:
        """Next states (-) the next state of x; NaN where a step fails."""
        batch = self._sim.rollout_batch(xs, us[:, None])
        ends = np.array([self._sim.difference(x, self._origin) for x in batch.x[:, 1]])
        ends[batch.status != Status.SOLVED] = np.nan
        return ends

    def jacobian(self, eps: float, *, centered: bool = True) -> Matrix:
        """Central or one-sided differences."""
        ends = self.step(*self.points(eps, centered=centered))
        columns = self._sim.ndx + self._sim.nu
        if centered:
            return (ends[:columns] - ends[columns:]).T / (2.0 * eps)
        return (ends[:columns] - ends[columns]).T / eps
