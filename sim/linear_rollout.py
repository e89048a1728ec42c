"""A rollout with the derivatives of its steps in one pass: a step is solved once, and differentiated where it ends."""

from __future__ import annotations

from sim.late import gradient, step
from sim.layout import model_view, work_view
from sim.model import Vector
from sim.options import Guess
from sim.pace import is_due
from sim.rollout import ACCURACY, Linearized, options_of
from solvers.compiler import Table, kernel
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)


@kernel
def roll_linear(model_at: Table, work_at: Table, settings: Vector, line: Linearized, first: int) -> int:
    """xs[t + 1] = step(xs[t], us[t]) and A[t], B[t], from t = first on; returns the number of solved steps.

    line.xs: (T + 1, nx), of which the first row is given; x_next is not used.
    """
    model = model_view(model_at)
    work = work_view(work_at)
    options = options_of(work, settings, first == 0)
    nq = work.theta1.shape[0]
    for t in range(first, line.us.shape[0]):
        x = line.xs[t]
        report = line.reports[t]
        guess = Guess(x[nq:], t > 0)
        if step(model, work, options, x, line.us[t], guess, line.xs[t + 1], report) != _SOLVED:
            return t
        if not gradient(model, work, options.h, options.kappa, x[:nq], x[nq:], line.A[t], line.B[t]):
            report[0] = _SINGULAR
            return t
        report[5] = ACCURACY * work.contact_hard[0]
        if is_due(work, report[1] + line.A.shape[1]):
            return t + 1
    return line.us.shape[0]
