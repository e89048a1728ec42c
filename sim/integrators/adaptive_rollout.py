"""The loop over time of steps with an accuracy: each is a sequence of sub-steps (adaptive.py) under its own input.

A motion that returns to Python within a step continues from there: the step keeps its state (Clock).
"""

from __future__ import annotations

from typing import NamedTuple

from sim.integrators.adaptive import attempt
from sim.integrators.substeps import AccuracyGoal, Clock, Embedded, SubstepState, begin_substeps, end_report
from sim.model.interruptible_loops import is_due, note_deadline
from sim.model.layout import data_view, model_view
from sim.model.record_columns import StepReport
from solvers.compiler import Table, kernel
from solvers.dense import copy, copy_vector
from solvers.status import Status
from solvers.types import Cube, Matrix, Vector

_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)


class SubstepMotion(NamedTuple):
    """A motion, step by step."""

    us: Matrix  # (T, nu) in
    wrenches: Cube  # (T, nbody, 6) in, or (0, nbody, 6)
    xs: Matrix  # (T + 1, nx) nodes, of which xs[0] is given
    reports: Matrix  # (T, 9)
    contacts: Cube  # (T, ncontact, 11)


@kernel
def _begin(line: SubstepState, path: SubstepMotion, end: float, t: int) -> None:
    """The sub-steps of step t."""
    copy_vector(path.xs[t], line.x)
    copy_vector(path.us[t], line.u)
    if t < path.wrenches.shape[0]:
        copy(path.wrenches[t], line.wrench[0])
    begin_substeps(line, end)


@kernel
def _end(line: SubstepState, path: SubstepMotion, end: float, t: int, status: int) -> None:
    """The results of step t."""
    end_report(line, status)
    copy_vector(line.report, path.reports[t])
    if status == _SOLVED:
        copy_vector(line.x, path.xs[t + 1])
        copy(line.contacts, path.contacts[t])
        path.reports[t, StepReport.ERROR] = line.clock[Clock.ERROR] / end
    line.clock[Clock.BEGUN] = 0.0


@kernel
def roll_substeps(
    models: Table,
    data_tables: Table,
    settings: Vector,
    goal: Vector,
    embedded: Embedded,
    line: SubstepState,
    path: SubstepMotion,
    first: int,
) -> int:
    """Steps from `first` on, of which that one may have begun; the number of steps taken at the end, or the deadline.

    Where a step is not solved, its report has the Status.
    """
    flight, data, end = model_view(models[0]), data_view(data_tables[0]), goal[AccuracyGoal.END]
    note_deadline(data, settings)
    for t in range(first, path.us.shape[0]):
        if line.clock[Clock.BEGUN] == 0.0:
            _begin(line, path, end, t)
        due = False
        while line.clock[Clock.TIME] < end:
            effort, line.taken[0] = line.report[StepReport.ITERATIONS], 0
            status = attempt(flight, models, data_tables, settings, goal, embedded, line)
            if line.report[StepReport.PARTS] > goal[AccuracyGoal.MOST]:
                status, line.report[StepReport.STATUS] = _MAX_ITERATIONS, _SOLVED
            if status != _SOLVED:
                _end(line, path, end, t, status)
                return t
            due = is_due(data, line.report[StepReport.ITERATIONS] - effort)
            if due:
                break
        if line.clock[Clock.TIME] < end:
            return t
        _end(line, path, end, t, _SOLVED)
        if due:
            return t + 1
    return path.us.shape[0]
