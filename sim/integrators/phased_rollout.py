"""The loop over time of steps of higher order while all contacts and limits are inactive, of order 2 otherwise.

A step of order 2 begins at the mean velocity of the node (start_velocity.py); one that follows another goes on from the
mean velocity that this one has found. A motion goes on here after a pause, and after a step that Python has divided:
what it needs is in its buffers.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from sim.dynamics.energy import node_velocity
from sim.dynamics.external_forces import set_external
from sim.dynamics.state_manifold import normalize_state
from sim.integrators import rollout, runge_kutta
from sim.integrators.phases import NEAR, fly
from sim.integrators.rollout import MotionBuffers, options_of, report_step
from sim.mechanism.checks import UNIT
from sim.model.data import Data
from sim.model.interruptible_loops import is_due, note_deadline
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.options import Guess, StepOptions
from sim.model.record_columns import StepReport
from sim.solve.start_velocity import interval, start_state
from sim.step import step
from solvers.compiler import Table, kernel
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import Integers, Matrix, Vector

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)


class Phases(NamedTuple):
    """A motion; its row t + 1 is written by step t."""

    xs: Matrix  # (T + 1, nx) nodes, of which the first row is given
    motion: MotionBuffers  # its states (T + 1, nx) are those with mean velocities, at steps of order 2 and behind them
    near: Integers  # (T,) 1 for steps of order 2 that have begun
    flies: bool  # otherwise all steps are of order 2
    divides: bool  # whether states have intervals of their own, as those of engines that divide steps


@kernel
def _interval(model: Model, data: Data, h: float, path: Phases, x: Vector) -> float:
    """Interval over which the velocity of a state is the mean [s]."""
    return interval(model, data, h, x) if path.divides else h


@kernel
def _begin_near(model: Model, data: Data, scratch: Data, h: float, path: Phases, t: int) -> int:
    """The state with the mean velocity of the node where step t begins, the first of order 2; the Status."""
    x, mean = path.xs[t], path.motion.xs[t]
    rollout.begin(data)
    copy_vector(x, mean)
    status = _SOLVED
    if _interval(model, scratch, h, path, x) == h:
        status = start_state(model, scratch, h, x[data.theta1.shape[0] :], mean)
    return _NOT_FINITE if status == _SOLVED and normalize_state(model, mean, UNIT) >= 0 else status


@kernel
def _stay(model: Model, data: Data, scratch: Data, options: StepOptions, path: Phases, t: int) -> int:
    """Step t, of order 2; the Status."""
    motion, nq = path.motion, data.theta1.shape[0]
    mean, end, report = motion.xs[t], motion.xs[t + 1], motion.reports[t]
    follows = data.carry.steps[0] > 0
    if not follows:
        rollout.begin(data)
    set_external(data, motion.wrenches, t)
    status = step(model, data, options, mean, motion.us[t], Guess(mean[nq:], follows), end, report)
    if status == _SOLVED and not report_step(model, data, options, motion, t, report):
        status = int(report[StepReport.STATUS])
    if status == _SOLVED:
        copy_vector(end, path.xs[t + 1])
        node_velocity(model, scratch, _interval(model, scratch, options.h, path, end), end)
        copy_vector(scratch.dnu, path.xs[t + 1, nq:])
    return status


@kernel
def roll_phases(models: Table, data_tables: Table, settings: Vector, path: Phases, first: int) -> int:
    """Steps from `first` on: how many are taken at the end, at the deadline, or before the first unsolved one.

    models, data_tables: of the higher order, then of order 2. The report of a step that is not solved has the Status.
    """
    flight, second, data, near = (
        model_view(models[0]),
        model_view(models[1]),
        data_view(data_tables[0]),
        data_view(data_tables[1]),
    )
    options = options_of(near, settings, False)
    note_deadline(data, settings)
    for t in range(first, path.motion.us.shape[0]):
        report, stays, status = path.motion.reports[t], t > 0 and path.near[t - 1] == 1, NEAR
        if path.flies:
            if t == 0 or stays:
                runge_kutta.begin(flight, data, path.xs[t])
            status = fly(flight, data, settings, path.motion, path.xs[t], path.xs[t + 1], t)
        if status == NEAR:
            status = _SOLVED if stays else _begin_near(second, near, data, options.h, path, t)
            report[StepReport.STATUS], report[StepReport.RESIDUAL], report[StepReport.WORST] = status, inf, -1.0
            if status == _SOLVED:
                path.near[t] = 1
                status = _stay(second, near, data, options, path, t)
        if status != _SOLVED:
            return t
        if is_due(data, report[StepReport.ITERATIONS]):
            return t + 1
    return path.motion.us.shape[0]
