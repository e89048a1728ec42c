"""Parallel loops: knots of a trajectory, motions from several states, and independent rows,
each with its own model, settings and guess.

Nothing is carried from one row to the next, so a row does not depend on its neighbours, nor on the number of threads.
A row of a batch may start from the impulses of its own last step.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.integrators.rollout import Linearized, MotionBuffers, linearize, roll
from sim.model.layout import data_view
from sim.model.record_columns import StepReport, StepSetting
from solvers.compiler import Table, kernel, parallel_kernel, prange, seconds
from solvers.dense import copy
from solvers.status import Status
from solvers.types import Cube, Integers, Matrix, Vector

_SOLVED = int(Status.SOLVED)


@parallel_kernel
def linearize_knots(
    model_at: Table,
    data_ats: Table,
    settings: Vector,
    substeps: int,
    line: Linearized,
    done: Integers,
) -> None:
    """`linearize` of all knots, spread over the threads: chunk c has the scratch data_ats[c], done[c] is its next
    step, the first one of chunk c + 1 in the end.
    """
    n = line.us.shape[0]
    chunks = data_ats.shape[0]
    for c in prange(chunks):
        knots = (c * n // chunks, done[c], (c + 1) * n // chunks)
        done[c] = linearize(model_at, data_ats[c], settings, knots, substeps, line)


class BatchBuffers(NamedTuple):
    """Motions from several states, kept as their states, and in `roll_rows` their contacts, if there are rows."""

    xs: Cube  # (n, T + 1, nx), of which the first rows are given
    us: Cube  # (n, T, nu)
    reports: Cube  # (n, 1, 9) of the last step of each, zeros
    knots: Integers  # (n,) number of solved steps, zeros
    wrenches: Cube  # without rows, as A and B: they are not kept
    contacts: Cube  # (n T, ncontact, 11) of all steps, in `roll_rows` only, or (0, ncontact, 11)
    A: Cube
    B: Cube


@kernel
def _roll_rows(model_at: Table, data_at: Table, settings: Vector, rows: tuple[int, int], motions: BatchBuffers) -> None:
    """Motions rows[0] up to rows[1], as far as they are not done, until the deadline; at least a part of one."""
    steps, begun = motions.us.shape[1], False
    for i in range(rows[0], rows[1]):
        report = motions.reports[i]
        if report[0, StepReport.STATUS] == _SOLVED and motions.knots[i] < steps:
            if begun and seconds() > settings[StepSetting.DEADLINE]:
                return
            begun = True
            x, u = motions.xs[i], motions.us[i]
            one = MotionBuffers(x, u, motions.wrenches, report, motions.contacts, motions.A, motions.B)
            motions.knots[i] = roll(model_at, data_at, settings, one, motions.knots[i], None, None)
            if report[0, StepReport.STATUS] == _SOLVED and motions.knots[i] < steps:
                return


@parallel_kernel
def roll_batch(model_at: Table, data_ats: Table, settings: Vector, motions: BatchBuffers) -> None:
    """All motions, spread over the threads."""
    n = motions.us.shape[0]
    chunks = data_ats.shape[0]
    for c in prange(chunks):
        rows = (c * n // chunks, (c + 1) * n // chunks)
        _roll_rows(model_at, data_ats[c], settings, rows, motions)


class RowTables(NamedTuple):
    """Models, scratch and settings of the rows of a batch."""

    models: Table  # (n, ...) tables of their Models
    scratch: Table  # (n, ...) tables of their Data; rows of one chunk may share one
    settings: Matrix  # (n, 10) of StepSetting, with one deadline
    cones: Cube  # (n, ncontact, 16) cone variables that the last steps ended with, in and out; or empty
    bounds: Cube  # (n, nlimit, 2) of limits
    dry: Cube  # (n, ndry, 4) of dry friction


@kernel
def _take_impulses(rows: RowTables, i: int) -> None:
    """Impulses of row i into its Data: no row reads those that another one has left there."""
    if rows.cones.shape[0] > 0:
        data = data_view(rows.scratch[i])
        copy(rows.cones[i], data.cone)
        copy(rows.bounds[i], data.bound)
        copy(rows.dry[i], data.dry)


@kernel
def _keep_impulses(rows: RowTables, i: int) -> None:
    """Impulses of row i out of its Data."""
    if rows.cones.shape[0] > 0:
        data = data_view(rows.scratch[i])
        copy(data.cone, rows.cones[i])
        copy(data.bound, rows.bounds[i])
        copy(data.dry, rows.dry[i])


@kernel
def _linearize_some(rows: RowTables, part: tuple[int, int], substeps: int, line: Linearized, done: Integers) -> None:
    """Derivatives of the rows part[0] up to part[1] that are not done, until the deadline; at least a part of one."""
    begun = False
    for i in range(part[0], part[1]):
        if done[i] < substeps:
            if begun and seconds() > rows.settings[i, StepSetting.DEADLINE]:
                return
            begun = True
            if done[i] == 0:
                _take_impulses(rows, i)
            knots = (i, i * substeps + done[i], i + 1)
            end = linearize(rows.models[i], rows.scratch[i], rows.settings[i], knots, substeps, line)
            done[i] = end - i * substeps
            if done[i] < substeps:
                return
            _keep_impulses(rows, i)


@parallel_kernel
def linearize_rows(rows: RowTables, substeps: int, line: Linearized, done: Integers, chunks: int) -> None:
    """Derivatives of every row: done[i] is the step at which row i resumes, `substeps` where it is done."""
    n = line.us.shape[0]
    for c in prange(chunks):
        part = (c * n // chunks, (c + 1) * n // chunks)
        _linearize_some(rows, part, substeps, line, done)


@kernel
def _roll_some(rows: RowTables, part: tuple[int, int], motions: BatchBuffers) -> None:
    """Motions of the rows part[0] up to part[1], as far as they are not done, until the deadline; at least a part of
    one.
    """
    steps, begun = motions.us.shape[1], False
    for i in range(part[0], part[1]):
        report = motions.reports[i]
        if report[0, StepReport.STATUS] == _SOLVED and motions.knots[i] < steps:
            if begun and seconds() > rows.settings[i, StepSetting.DEADLINE]:
                return
            begun = True
            x, u = motions.xs[i], motions.us[i]
            contacts = motions.contacts[i * steps : (i + 1) * steps]  # without rows where none are kept
            one = MotionBuffers(x, u, motions.wrenches, report, contacts, motions.A, motions.B)
            knot = motions.knots[i]
            if knot == 0:
                _take_impulses(rows, i)
            motions.knots[i] = roll(rows.models[i], rows.scratch[i], rows.settings[i], one, knot, None, None)
            if report[0, StepReport.STATUS] == _SOLVED and motions.knots[i] < steps:
                return
            _keep_impulses(rows, i)


@parallel_kernel
def roll_rows(rows: RowTables, motions: BatchBuffers, chunks: int) -> None:
    """Motions of every row, as far as they are not done."""
    n = motions.us.shape[0]
    for c in prange(chunks):
        part = (c * n // chunks, (c + 1) * n // chunks)
        _roll_some(rows, part, motions)
