"""Adjoint sweep: gradient of a scalar of a rollout, one step at a time from its end.

    l_T = dL/dx_T,    l_t = A_t^T l_t+1 + dL/dx_t,    dL/du_t = B_t^T l_t+1,    dL/dp = sum_t -y_t^T dR_t/dp

A step's unknown v25 feels a parameter by -H^-1 dR/dp, so y = H^-T w with w the gradient by v25, and a parameter costs
a column of dR and a scalar product. Each step is solved anew from its state (its solution is known: one iteration), so
the sweep keeps nothing but one step: its memory is that of the trajectory and of the gradient. A step with several
solutions may end in another one than that of the trajectory, whose derivatives are not those of the loss.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.derivatives.parameters.directions import At, Effect, ParameterTerm
from sim.derivatives.parameters.height_columns import add_height_gradient
from sim.derivatives.parameters.residual_columns import fill_columns
from sim.dynamics.elimination_panel import clear_columns, column_count, solve_panel
from sim.dynamics.loops.coupling_system import solve_coupling_panel
from sim.integrators.rollout import Linearized, linearize
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.record_columns import StepReport, StepSetting
from solvers.compiler import Table, kernel, seconds
from solvers.rotation import left_jacobian
from solvers.status import Status
from solvers.types import Cube, IntegerMatrix, Matrix, Vector

_SOLVED, _OTHER = int(Status.SOLVED), int(Status.OTHER_SOLUTION)
_TIME_STEP = int(Effect.TIME_STEP)


class Sweep(NamedTuple):
    """A trajectory, the loss, and its gradients."""

    xs: Matrix  # (T + 1, nx)
    us: Matrix  # (T, nu)
    wrenches: Cube  # (T, nbody, 6) external ones, or (0, nbody, 6)
    loss: Matrix  # (T + 1, ndx) dL/dx_t
    A: Cube  # (1, ndx, ndx) of one step
    B: Cube  # (1, ndx, nu)
    x_next: Matrix  # (1, nx)
    report: Matrix  # (1, 9) of the last step that was tried; zeros at first
    costate: Matrix  # (2, ndx) in and out, the first row: dL/dx_T at first, dL/dx_0 in the end
    inputs: Matrix  # (T, nu) out
    parameters: Vector  # (nparameter,) out
    w: Vector  # (nv,) gradient by v25
    y: Vector  # (nv + nrow,) gradient by the residual of a step and by the gaps of its loops
    twists: Matrix  # (12, 6)
    below: Vector  # (nbody,)
    places: Matrix  # (1, 3 nground) scratch
    heights: Matrix  # (1, ncoefficient of the terrains) out; (1, 0) if not requested


@kernel
def sweep(
    model_at: Table,
    data_at: Table,
    settings: Vector,
    line: Sweep,
    terms: IntegerMatrix,
    weights: Vector,
    left: int,
    near: float,
) -> int:
    """Gradients of the loss by the first `left` steps; returns how many are still left.

    Without the report of an unsolved step, which is the last of those left, that is none, or the deadline is over.

    near: distance from the next state, over its largest entry or 1, beyond which a step is another one.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    n = line.costate.shape[1]
    nq = line.xs.shape[1] - n // 2
    costate, before = line.costate[0], line.costate[1]
    for t in range(left - 1, -1, -1):
        for k in range(line.xs.shape[1]):
            line.x_next[0, k] = line.xs[t + 1, k]
        wrenches = line.wrenches[t : t + 1]
        one = Linearized(line.xs[t : t + 1], line.us[t : t + 1], wrenches, line.A, line.B, line.x_next, line.report)
        linearize(model_at, data_at, settings, (0, 0, 1), 1, one)
        if line.report[0, StepReport.STATUS] == _SOLVED and not _is_near(line.x_next[0], line.xs[t + 1], near):
            line.report[0, StepReport.STATUS] = _OTHER
        if line.report[0, StepReport.STATUS] != _SOLVED:
            return t + 1
        if line.parameters.shape[0] > 0 or line.heights.shape[1] > 0:
            h = settings[StepSetting.TIME_STEP]
            at = At(h, line.xs[t, :nq], line.xs[t, nq:], line.us[t], line.twists, line.below)
            _add_parameters(model, data, at, line, terms, weights)
        for j in range(line.us.shape[1]):
            s = 0.0
            for i in range(n):
                s += line.B[0, i, j] * costate[i]
            line.inputs[t, j] = s
        for j in range(n):
            before[j] = line.loss[t, j]
        for i in range(n):
            for j in range(n):
                before[j] += line.A[0, i, j] * costate[i]
        for j in range(n):
            costate[j] = before[j]
        if seconds() > settings[StepSetting.DEADLINE]:
            return t
    return 0


@kernel
def _is_near(x: Vector, goal: Vector, near: float) -> bool:
    """Whether a state is no further from another one than `near`, over its largest entry or 1."""
    size = 1.0
    for k in range(goal.shape[0]):
        size = max(size, abs(goal[k]))
    for k in range(goal.shape[0]):
        if abs(x[k] - goal[k]) > near * size:
            return False
    return True


@kernel
def _velocity_gradient(model: Model, data: Data, h: float, costate: Vector, w: Vector) -> None:
    """w = l_v + h l_q, h J(h w) l_q of quaternions: gradient by v25."""
    nv = w.shape[0]
    for d in range(nv):
        w[d] = costate[nv + d] + h * costate[d]
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] != 3:
            continue
        d = model.body_vadr[i + 1] - 3
        J = left_jacobian(h * data.nu[d], h * data.nu[d + 1], h * data.nu[d + 2])
        for r in range(3):
            w[d + r] = costate[nv + d + r] + h * (
                J[3 * r] * costate[d] + J[3 * r + 1] * costate[d + 1] + J[3 * r + 2] * costate[d + 2]
            )


@kernel
def _residual_gradient(model: Model, data: Data, w: Vector, y: Vector) -> None:
    """y = H^-T w: scalar products of w with the columns of H^-1, as many at once as fit."""
    nv = w.shape[0]
    width = column_count(model, data)
    first = 0
    while first < y.shape[0]:
        clear_columns(data)
        count = min(width, y.shape[0] - first)
        for m in range(count):
            if first + m < nv:
                data.columns[first + m, m] = 1.0
            else:
                data.couple_panel[first + m - nv, m] = 1.0
        solve_panel(model, data)
        solve_coupling_panel(model, data)
        for m in range(count):
            s = 0.0
            for d in range(nv):
                s += w[d] * data.columns[d, m]
            y[first + m] = s
        first += width


@kernel
def _add_parameters(model: Model, data: Data, at: At, line: Sweep, terms: IntegerMatrix, weights: Vector) -> None:
    """parameters += the contribution of this step."""
    costate, w, y = line.costate[0], line.w, line.y
    nv = w.shape[0]
    _velocity_gradient(model, data, at.h, costate, w)
    _residual_gradient(model, data, w, y)
    if line.heights.shape[1] > 0:
        add_height_gradient(model, data, at.h, y, line.places, line.heights)
    width = column_count(model, data)
    count = line.parameters.shape[0]
    first = 0
    start = 0
    while first < count:
        end = fill_columns(model, data, at, terms, weights, first, start)
        for m in range(min(width, count - first)):
            s = 0.0
            for d in range(nv):
                s += y[d] * data.columns[d, m]
            for row in range(data.couple_panel.shape[0]):
                s += y[nv + row] * data.couple_panel[row, m]
            line.parameters[first + m] += s
        for t in range(start, end):
            if terms[t, ParameterTerm.EFFECT] == _TIME_STEP:
                column = terms[t, ParameterTerm.COLUMN]
                line.parameters[column] += weights[t] * _time_gradient(data, at, line.A[0], costate, w)
        first += width
        start = end


@kernel
def _time_gradient(data: Data, at: At, A: Matrix, costate: Vector, w: Vector) -> float:
    """w.(A_vv v15 - v25)/h + l_q.v25, the part of dL/dh that does not go through dR/dh; see parameter_jacobian.py."""
    nv = w.shape[0]
    s = 0.0
    for d in range(nv):
        z = -data.nu[d]
        for k in range(nv):
            z += A[nv + d, nv + k] * at.v[k]
        s += w[d] * z / at.h + costate[d] * data.nu[d]
    return s
