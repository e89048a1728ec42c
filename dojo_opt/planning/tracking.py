"""Tracking gains of a plan: the linear-quadratic regulator of the problem's own costs around it."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.planning.problem import Problem
from sim.mechanism import checks
from solvers.status import Status
from solvers.types import Floats

__all__ = ["tracking_gains"]


def tracking_gains(problem: Problem, plan: Any, *, kappa: float | None = None) -> Floats:
    """Gains of u_t = plan.u_t + K_t (x_t (-) plan.x_t), by the Riccati recursion along the plan:

        K = -(R + B^T P B)^-1 (S + B^T P A),      P := Q + A^T P A + (S^T + A^T P B) K

    Q, R, S are the Gauss-Newton Hessians of the costs. Unlike a plan's own gains, these ignore constraints and control
    limits; a plan's gains are stiff near constraints and zero at control limits.

    Args:
        problem: the problem, for its simulator and costs.
        plan: a plan or trajectory with x (T + 1, nx) and u (T, nu).
        kappa: smoothing of the contacts in the derivatives [N s m] (default None: that of the simulator).

    Returns:
        The gains, (T, nu, ndx) [N or N m per unit of the state].

    Raises:
        TypeError: an argument is no problem, or no plan.
        ValueError: a step of the plan cannot be linearised.
    """
    if not isinstance(problem, Problem):
        raise TypeError(f"tracking_gains(problem): expected a Problem, got {checks.shown(problem)}")
    sim = problem.sim
    if not (hasattr(plan, "x") and hasattr(plan, "u")):
        raise TypeError(f"tracking_gains(plan): expected a plan or trajectory, got {checks.shown(plan)}")
    line = sim.linearize_trajectory(plan.x, plan.u, substeps=problem.substeps, kappa=kappa)
    if np.any(line.status != Status.SOLVED):
        t = int(np.flatnonzero(line.status != Status.SOLVED)[0])
        raise ValueError(f"tracking_gains: knot {t} of the plan is not solved: {Status(int(line.status[t])).name}")
    n = sim.ndx
    g = np.zeros((problem.horizon + 1, n + sim.nu))
    H = np.zeros((problem.horizon + 1, n + sim.nu, n + sim.nu))
    for term in problem.costs:
        term.expand(plan.x, plan.u, g, H)
    K = np.empty((problem.horizon, sim.nu, n))
    P = H[-1, :n, :n]
    for t in range(problem.horizon - 1, -1, -1):
        PA, PB = P @ line.A[t], P @ line.B[t]
        cross = H[t, n:, :n] + line.B[t].T @ PA
        K[t] = -np.linalg.solve(H[t, n:, n:] + line.B[t].T @ PB, cross)
        P = H[t, :n, :n] + line.A[t].T @ PA + cross.T @ K[t]
        P = 0.5 * (P + P.T)
    return K
