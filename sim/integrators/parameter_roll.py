"""A rollout with the derivatives of every step by its state, its input, and parameters."""

from __future__ import annotations

from typing import NamedTuple

from sim.derivatives.parameters.directions import At
from sim.derivatives.parameters.parameter_jacobian import parameter_jacobian
from sim.derivatives.step_gradient import gradient
from sim.dynamics.external_forces import set_external
from sim.integrators.rollout import ACCURACY, MotionBuffers, options_of
from sim.model.layout import data_view, model_view
from sim.model.options import Guess
from sim.model.pace import is_due
from sim.step import step
from solvers.compiler import Table, kernel
from solvers.status import Status
from solvers.types import Cube, IntegerMatrix, Matrix, Vector

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)


class ParameterColumns(NamedTuple):
    """Parameters as the terms of their columns, the columns of every step, and scratch."""

    terms: IntegerMatrix
    weights: Vector
    J: Cube  # (T, ndx, n) d(next state)/d(parameters), out
    twists: Matrix  # (12, 6)
    below: Vector  # (nbody,)


@kernel
def roll_columns(
    model_at: Table, data_at: Table, settings: Vector, motion: MotionBuffers, columns: ParameterColumns, first: int
) -> int:
    """xs[t + 1] = step(xs[t], us[t]) from t = first on, as `rollout.roll` does, with A_t, B_t and J_t.

    Returns the number of solved steps, those before included.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    options = options_of(data, settings, first == 0)
    nq = data.theta1.shape[0]
    steps = motion.us.shape[0]
    for t in range(first, steps):
        x, u, report = motion.xs[t], motion.us[t], motion.reports[t]
        set_external(data, motion.wrenches, t)
        if step(model, data, options, x, u, Guess(x[nq:], t > 0), motion.xs[t + 1], report) != _SOLVED:
            return t
        A = motion.A[t]
        if not gradient(model, data, options.h, options.kappa, x[:nq], x[nq:], A, motion.B[t]):
            report[0] = _SINGULAR
            return t
        report[5] = ACCURACY * data.contact_hard[0]
        if columns.weights.shape[0] > 0:
            at = At(options.h, x[:nq], x[nq:], u, columns.twists, columns.below)
            parameter_jacobian(model_at, data_at, at, A, columns.terms, columns.weights, columns.J[t])
        if is_due(data, report[1] + A.shape[0] + columns.J.shape[2]):
            return t + 1
    return steps
