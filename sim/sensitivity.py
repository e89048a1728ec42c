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

Floats = NDArray[np.float64]
_TWISTS = 12  # rows of scratch for twists at three configurations


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
