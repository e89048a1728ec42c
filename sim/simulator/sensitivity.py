"""Entries from Python to the derivatives by parameters, which are compiled on first use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.derivatives.parameters.directions import At
from sim.derivatives.parameters.height_columns import height_jacobian
from sim.derivatives.parameters.parameter_jacobian import parameter_jacobian
from sim.derivatives.parameters.parameters import ParameterPlan
from sim.derivatives.parameters.terrain_parameters import height_gradients
from sim.integrators.adjoint import Sweep, sweep
from sim.mechanism.mechanism import Mechanism
from sim.model.pace import pieces
from sim.simulator.engine import CONTACT, REPORT, Engine, Rolled
from sim.simulator.link import link_heights, link_parameters
from solvers.status import Status
from solvers.types import Vector

Floats = NDArray[np.float64]
_TWISTS = 12  # rows of scratch for twists at three configurations
_PIECE = 64  # steps whose (A, B) are kept at once


def parameter_columns(
    engine: Engine, mech: Mechanism, step: tuple[Vector, Vector], A: Floats, plan: ParameterPlan
) -> Floats:
    """d(next state)/d(parameters), (ndx, n), right after `linearize_one` of the step (x, u) with the result A."""
    x, u = step
    out = np.zeros((engine.ndx, plan.size))
    nq = engine.sizes.nq
    at = At(engine.settings.time_step, x[:nq], x[nq:], u, np.zeros((_TWISTS, 6)), np.zeros(engine.sizes.nbody))
    model, data = engine.tables(link_parameters)
    if len(plan.weights):
        parameter_jacobian(model, data, at, A, plan.terms, plan.weights, out)
    if len(plan.heights):
        places = np.zeros((engine.ndx, 3 * (engine.sizes.ncontact - engine.sizes.npair)))
        coefficients = np.zeros((engine.ndx, engine.sizes.nheight))
        height_jacobian(model, data, at, places, coefficients)
        _add_heights(mech, plan, coefficients, out)
    return out


def adjoint_products(engine: Engine, line: Sweep, kappa: float | None) -> int:
    """The sweep by state and input from the (A, B) of a piece of the trajectory at a time, for orders above 2:

    l_T = dL/dx_T,    l_t = A_t^T l_t+1 + dL/dx_t,    dL/du_t = B_t^T l_t+1;  the step that was not solved, or -1.
    """
    costate = line.loss[-1]
    for last in range(len(line.us), 0, -_PIECE):
        first = max(last - _PIECE, 0)
        A, B, _, reports = engine.linearize(
            line.xs[first : last + 1], line.us[first:last], 1, kappa, None, line.wrenches[first:last]
        )
        for t in range(last - 1, first - 1, -1):
            line.report[0] = reports[t - first]
            if reports[t - first, 0] != Status.SOLVED:
                return t
            line.inputs[t] = B[t - first].T @ costate
            costate = A[t - first].T @ costate + line.loss[t]
    line.costate[0] = costate
    return -1


def roll_parameters(
    engine: Engine,
    mech: Mechanism,
    path: tuple[Vector, Floats, Floats | None],
    plan: ParameterPlan,
    kappa: float | None,
) -> tuple[Rolled, Floats]:
    """A rollout with its derivatives, and d(next state)/d(parameters) (T, ndx, n); path: state, inputs, wrenches."""
    x, us, wrenches = path
    n = len(us)
    xs, reports = np.zeros((n + 1, engine.nx)), np.zeros((n, REPORT))
    A, B = np.zeros((n, engine.ndx, engine.ndx)), np.zeros((n, engine.ndx, engine.nu))
    J = np.zeros((n, engine.ndx, plan.size))
    xs[0], knot = x, n
    for t, u in enumerate(us):
        external = None if wrenches is None else wrenches[t : t + 1]
        A[t], B[t], xs[t + 1], reports[t] = engine.linearize_one(xs[t], u, kappa, external)
        if reports[t, 0] == Status.SOLVED:
            J[t] = parameter_columns(engine, mech, (xs[t], u), A[t], plan)
            if not np.isfinite(J[t]).all():
                reports[t, 0] = Status.NOT_FINITE
        if reports[t, 0] != Status.SOLVED:
            knot = t
            break
    return Rolled(knot, xs, reports, np.zeros((0, engine.sizes.ncontact, CONTACT)), A, B), J


def _add_heights(mech: Mechanism, plan: ParameterPlan, coefficients: Floats, out: Floats) -> None:
    """out (n, nparameter) += derivatives by heights of terrains, from those by coefficients."""
    heights, columns = plan.heights.T
    found = height_gradients(mech, coefficients)[:, heights] * plan.height_weights
    np.add.at(out.T, columns, found.T)


def adjoint_sweep(
    engine: Engine,
    mech: Mechanism,
    path: tuple[Floats, Floats, Floats | None],
    loss: Floats,
    plan: ParameterPlan,
    kappa: float | None,
) -> tuple[int, Sweep]:
    """(the step that was not solved or -1, gradients) of a loss with the gradient `loss` by the states of the path.

    path: states, inputs, external wrenches.
    """
    xs, us, wrenches = path
    sizes = engine.sizes
    line = Sweep(
        xs=xs,
        us=us,
        wrenches=engine.external(wrenches),
        loss=loss,
        A=np.empty((1, engine.ndx, engine.ndx)),
        B=np.empty((1, engine.ndx, engine.nu)),
        x_next=np.empty((1, engine.nx)),
        report=np.zeros((1, REPORT)),
        costate=np.zeros((2, engine.ndx)),
        inputs=np.zeros((len(us), engine.nu)),
        parameters=np.zeros(plan.size),
        w=np.zeros(sizes.nv),
        y=np.zeros(sizes.nv + sizes.nrow),
        twists=np.zeros((_TWISTS, 6)),
        below=np.zeros(sizes.nbody),
        places=np.zeros((1, 3 * (sizes.ncontact - sizes.npair))),
        heights=np.zeros((1, sizes.nheight if len(plan.heights) else 0)),
    )
    if engine.settings.order > 2:
        return adjoint_products(engine, line, kappa), line
    needs = (link_parameters, link_heights) if len(plan.heights) else (link_parameters,)
    model, data = engine.tables(*needs[: 2 if plan.size else 0])
    settings, left = engine.settings.array(kappa), len(us)
    line.costate[0] = loss[-1]
    for _ in pieces(settings, left):
        left = int(sweep(model, data, settings, line, plan.terms, plan.weights, left))
        if left == 0 or line.report[0, 0] != Status.SOLVED:
            break
    if len(plan.heights):
        _add_heights(mech, plan, line.heights, line.parameters[None])
    return left - 1, line
