"""Where Python enters the compiled derivatives by parameters; they are compiled when first asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.adjoint import Sweep, sweep
from sim.calls import REPORT, Calls
from sim.effects import At
from sim.model import Vector
from sim.parameter_gradients import parameter_jacobian
from sim.parameters import Plan
from solvers.status import Status

Floats = NDArray[np.float64]
_TWISTS = 12  # rows of scratch for twists at three configurations
_PIECE = 64  # steps whose (A, B) are kept at once


def parameter_columns(calls: Calls, step: tuple[Vector, Vector], A: Floats, plan: Plan) -> Floats:
    """d(next state)/d(parameters), (ndx, n), right after `linearize_one` of the step (x, u) with the result A."""
    x, u = step
    out = np.zeros((calls.ndx, plan.size))
    nq = calls.sizes.nq
    at = At(calls.settings.time_step, x[:nq], x[nq:], u, np.zeros((_TWISTS, 6)), np.zeros(calls.sizes.nbody))
    if plan.size:
        model, work = calls.tables()
        parameter_jacobian(model, work, at, A, plan.terms, plan.weights, out)
    return out


def adjoint_products(
    calls: Calls, path: tuple[Floats, Floats], loss: Floats, kappa: float | None
) -> tuple[int, Floats, Floats, Floats]:
    """(the step that was not solved or -1, its report, dL/dx_0 (ndx,), dL/du (T, nu)) from the (A, B) of every step.

    l_T = dL/dx_T,    l_t = A_t^T l_t+1 + dL/dx_t,    dL/du_t = B_t^T l_t+1;  a piece of the trajectory at a time.
    """
    xs, us = path
    costate, inputs = loss[-1].copy(), np.zeros((len(us), calls.nu))
    for last in range(len(us), 0, -_PIECE):
        first = max(last - _PIECE, 0)
        A, B, _, reports = calls.linearize(xs[first : last + 1], us[first:last], 1, kappa)
        for t in range(last - 1, first - 1, -1):
            if reports[t - first, 0] != Status.SOLVED:
                return t, reports[t - first], costate, inputs
            inputs[t] = B[t - first].T @ costate
            costate = A[t - first].T @ costate + loss[t]
    return -1, np.zeros(REPORT), costate, inputs


def adjoint_sweep(
    calls: Calls, path: tuple[Floats, Floats], loss: Floats, plan: Plan, kappa: float | None
) -> tuple[int, Sweep]:
    """(the step that was not solved or -1, gradients) of a loss with the gradient `loss` by the states of the path."""
    xs, us = path
    sizes = calls.sizes
    line = Sweep(
        xs=xs,
        us=us,
        loss=loss,
        A=np.empty((1, calls.ndx, calls.ndx)),
        B=np.empty((1, calls.ndx, calls.nu)),
        x_next=np.empty((1, calls.nx)),
        report=np.zeros((1, REPORT)),
        costate=np.zeros((2, calls.ndx)),
        inputs=np.zeros((len(us), calls.nu)),
        parameters=np.zeros(plan.size),
        w=np.zeros(sizes.nv),
        y=np.zeros(sizes.nv + sizes.nrow),
        twists=np.zeros((_TWISTS, 6)),
        below=np.zeros(sizes.nbody),
    )
    model, work = calls.tables()
    settings = calls.settings.array(kappa)
    return int(sweep(model, work, settings, line, plan.terms, plan.weights)), line
