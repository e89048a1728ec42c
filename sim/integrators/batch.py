"""Steps of independent rows, each with its own model, settings and guess, spread over the threads.

Nothing is carried from one row to the next, so a row does not depend on its neighbours, nor on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.integrators.rollout import BatchBuffers, Linearized, MotionBuffers, linearize, roll
from sim.model.pace import DEADLINE
from solvers.compiler import Table, kernel, parallel_kernel, prange, seconds
from solvers.status import Status
from solvers.types import Integers, Matrix

_SOLVED = int(Status.SOLVED)


class RowTables(NamedTuple):
    """Models, scratch and settings of the rows of a batch."""

    models: Table  # (n, ...) tables of their Models
    scratch: Table  # (n, ...) tables of their Data; rows of one chunk may share one
    settings: Matrix  # (n, 7), with one deadline


@kernel
def _linearize_some(rows: RowTables, part: tuple[int, int], substeps: int, line: Linearized, done: Integers) -> None:
    """Derivatives of the rows part[0] up to part[1], as far as they are not done, until the deadline."""
    for i in range(part[0], part[1]):
        if done[i] < substeps:
            if seconds() > rows.settings[i, DEADLINE]:
                return
            knots = (i, i * substeps + done[i], i + 1)
            end = linearize(rows.models[i], rows.scratch[i], rows.settings[i], knots, substeps, line)
            done[i] = end - i * substeps
            if done[i] < substeps:
                return


@parallel_kernel
def linearize_rows(rows: RowTables, substeps: int, line: Linearized, done: Integers, chunks: int) -> None:
    """Derivatives of every row: done[i] is the step at which row i resumes, `substeps` where it is done."""
    n = line.us.shape[0]
    for c in prange(chunks):
        part = (c * n // chunks, (c + 1) * n // chunks)
        _linearize_some(rows, part, substeps, line, done)


@kernel
def _roll_some(rows: RowTables, part: tuple[int, int], motions: BatchBuffers) -> None:
    """Motions of the rows part[0] up to part[1], as far as they are not done, until the deadline."""
    steps = motions.us.shape[1]
    for i in range(part[0], part[1]):
        report = motions.reports[i]
        if report[0, 0] == _SOLVED and motions.knots[i] < steps:
            if seconds() > rows.settings[i, DEADLINE]:
                return
            x, u = motions.xs[i], motions.us[i]
            one = MotionBuffers(x, u, motions.wrenches, report, motions.contacts, motions.A, motions.B)
            knot = motions.knots[i]
            motions.knots[i] = roll(rows.models[i], rows.scratch[i], rows.settings[i], one, knot, None, None)
            if report[0, 0] == _SOLVED and motions.knots[i] < steps:
                return


@parallel_kernel
def roll_rows(rows: RowTables, motions: BatchBuffers, chunks: int) -> None:
    """Motions of every row, as far as they are not done."""
    n = motions.us.shape[0]
    for c in prange(chunks):
        part = (c * n // chunks, (c + 1) * n // chunks)
        _roll_some(rows, part, motions)
