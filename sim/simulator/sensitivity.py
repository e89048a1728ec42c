"""Where Python enters the compiled derivatives by parameters; they are compiled when first asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.derivatives.parameters.directions import At
from sim.derivatives.parameters.height_columns import height_jacobian
from sim.derivatives.parameters.parameter_jacobian import parameter_jacobian
from sim.derivatives.parameters.parameters import Plan
from sim.derivatives.parameters.terrain_parameters import height_gradients
from sim.integrators.adjoint import Sweep, sweep
from sim.mechanism.mechanism import Mechanism
from sim.model.model import Vector
from sim.model.pace import pieces
from sim.simulator.calls import REPORT, Calls
from sim.simulator.link import link_heights, link_parameters
from solvers.status import Status

Floats = NDArray[np.float64]
_TWISTS = 12  # rows of scratch for twists at three configurations
_PIECE = 64  # steps whose (A, B) are kept at once


def parameter_columns(calls: Calls, mech: Mechanism, step: tuple[Vector, Vector], A: Floats, plan: Plan) -> Floats:
    """d(next state)/d(parameters), (ndx, n), right after `linearize_one` of the step (x, u) with the result A."""
    x, u = step
    out = np.zeros((calls.ndx, plan.size))
    nq = calls.sizes.nq
    at = At(calls.settings.time_step, x[:nq], x[nq:], u, np.zeros((_TWISTS, 6)), np.zeros(calls.sizes.nbody))
    model, work = calls.tables(link_parameters)
    if len(plan.weights):
        parameter_jacobian(model, work, at, A, plan.terms, plan.weights, out)
    if len(plan.heights):
        places = np.zeros((calls.ndx, 3 * (calls.sizes.ncontact - calls.sizes.npair)))
        coefficients = np.zeros((calls.ndx, calls.sizes.nheight))
        height_jacobian(model, work, at, places, coefficients)
        _add_heights(mech, plan, coefficients, out)
    return out


def adjoint_products(calls: Calls, line: Sweep, kappa: float | None) -> int:
    """The sweep by state and input from the (A, B) of a piece of the trajectory at a time, for orders above 2:

    l_T = dL/dx_T,    l_t = A_t^T l_t+1 + dL/dx_t,    dL/du_t = B_t^T l_t+1;  the step that was not solved, or -1.
    """
    costate = line.loss[-1]
    for last in range(len(line.us), 0, -_PIECE):
        first = max(last - _PIECE, 0)
        A, B, _, reports = calls.linearize(line.xs[first : last + 1], line.us[first:last], 1, kappa)
        for t in range(last - 1, first - 1, -1):
            line.report[0] = reports[t - first]
            if reports[t - first, 0] != Status.SOLVED:
                return t
            line.inputs[t] = B[t - first].T @ costate
            costate = A[t - first].T @ costate + line.loss[t]
    line.costate[0] = costate
    return -1


def roll_parameters(
    calls: Calls, mech: Mechanism, x: Vector, us: Floats, plan: Plan, kappa: float | None
) -> tuple[int, Floats, Floats, Floats, Floats, Floats]:
    """(number of solved steps, states, A, B, d(next state)/d(parameters) (T, ndx, n), report of every step)."""
    n = len(us)
    xs, reports = np.zeros((n + 1, calls.nx)), np.zeros((n, REPORT))
    A, B = np.zeros((n, calls.ndx, calls.ndx)), np.zeros((n, calls.ndx, calls.nu))
    J = np.zeros((n, calls.ndx, plan.size))
    xs[0] = x
    for t, u in enumerate(us):
        A[t], B[t], xs[t + 1], reports[t] = calls.linearize_one(xs[t], u, kappa)
        if reports[t, 0] != Status.SOLVED:
            return t, xs, A, B, J, reports
        J[t] = parameter_columns(calls, mech, (xs[t], u), A[t], plan)
    return n, xs, A, B, J, reports


def _add_heights(mech: Mechanism, plan: Plan, coefficients: Floats, out: Floats) -> None:
    """out (n, nparameter) += derivatives by heights of terrains, from those by coefficients."""
    heights, columns = plan.heights.T
    found = height_gradients(mech, coefficients)[:, heights] * plan.height_weights
    np.add.at(out.T, columns, found.T)


def adjoint_sweep(
    calls: Calls, mech: Mechanism, path: tuple[Floats, Floats], loss: Floats, plan: Plan, kappa: float | None
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
        places=np.zeros((1, 3 * (sizes.ncontact - sizes.npair))),
        heights=np.zeros((1, sizes.nheight if len(plan.heights) else 0)),
    )
    if calls.settings.order > 2:
        return adjoint_products(calls, line, kappa), line
    needs = (link_parameters, link_heights) if len(plan.heights) else (link_parameters,)
    model, work = calls.tables(*needs[: 2 if plan.size else 0])
    settings, left = calls.settings.array(kappa), len(us)
    line.costate[0] = loss[-1]
    for _ in pieces(settings, left):
        left = int(sweep(model, work, settings, line, plan.terms, plan.weights, left))
        if left == 0 or line.report[0, 0] != Status.SOLVED:
            break
    if len(plan.heights):
        _add_heights(mech, plan, line.heights, line.parameters[None])
    return left - 1, line
