"""Derivatives of the next state by parameters, by the implicit function theorem: dv25 = -H^-1 dR/d(parameter).

The minimal state x = (q2, v15) and the input are held fixed; dependent quantities move with the parameter: poses at all
three configurations, and so the momentum that enters the step. The factors of H are those that the derivatives by
state and input have left in `data`.

By the time step h: R depends on it by h v15, h v25, and directly, so with A_vv = dv25/dv15

    dv25/dh = -v25/h + A_vv v15/h - H^-1 dR/dh,      dq3/dh = v25 + h dv25/dh
"""

from __future__ import annotations

from sim.derivatives.parameters.directions import At, Effect, ParameterTerm
from sim.derivatives.parameters.residual_columns import fill_columns
from sim.dynamics.elimination_panel import column_count, solve_panel
from sim.dynamics.loops.coupling_system import solve_coupling_panel
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.rotation import left_jacobian
from solvers.types import IntegerMatrix, Matrix, Vector


@kernel
def add_time_rates(data: Data, at: At, A: Matrix, w: float, m: int) -> None:
    """columns[:, m] += w (A_vv v15 - v25)/h"""
    nv = at.v.shape[0]
    for d in range(nv):
        t = -data.nu[d]
        for k in range(nv):
            t += A[nv + d, nv + k] * at.v[k]
        data.columns[d, m] += w * t / at.h


@kernel
def coordinate_rows(model: Model, data: Data, h: float, first: int, count: int, out: Matrix) -> None:
    """out[:nv] = h dv25, h J(h w)^T dw of quaternions; out[nv:] = dv25; columns from `first` on."""
    nv = data.columns.shape[0]
    X = data.columns
    for d in range(nv):
        for m in range(count):
            out[nv + d, first + m] = X[d, m]
            out[d, first + m] = h * X[d, m]
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] != 3:
            continue
        d = model.body_vadr[i + 1] - 3
        J = left_jacobian(h * data.nu[d], h * data.nu[d + 1], h * data.nu[d + 2])
        for r in range(3):
            for m in range(count):
                out[d + r, first + m] = h * (J[r] * X[d, m] + J[3 + r] * X[d + 1, m] + J[6 + r] * X[d + 2, m])


@kernel
def parameter_jacobian(
    model_at: Table, data_at: Table, at: At, A: Matrix, terms: IntegerMatrix, weights: Vector, out: Matrix
) -> None:
    """out = d(next state)/d(parameters), (2 nv, nparameter), of the step that `linearize` left in the Data.

    A: (2 nv, 2 nv) of that step.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    nv = at.v.shape[0]
    width = column_count(model, data)
    first = 0
    start = 0
    while first < out.shape[1]:
        end = fill_columns(model, data, at, terms, weights, first, start)
        solve_panel(model, data)
        solve_coupling_panel(model, data)
        for t in range(start, end):
            if terms[t, ParameterTerm.EFFECT] == Effect.TIME_STEP:
                add_time_rates(data, at, A, weights[t], terms[t, ParameterTerm.COLUMN] - first)
        coordinate_rows(model, data, at.h, first, min(width, out.shape[1] - first), out)
        for t in range(start, end):
            if terms[t, ParameterTerm.EFFECT] == Effect.TIME_STEP:
                for d in range(nv):
                    out[d, terms[t, ParameterTerm.COLUMN]] += weights[t] * data.nu[d]
        first += width
        start = end
