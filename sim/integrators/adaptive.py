"""Steps whose lengths follow from an error estimate: long ones of order 8 in flight, short ones of 2 and 4 in contact.

A sub-step of length h from a node is accepted where its estimate e of the error of the joint coordinates has

    e <= accuracy h/(1 s)        [m, rad],  accuracy in m and rad per second of motion

The next one has the length h (e/allowed)^-1/k times a PI controller's share. Where a contact or limit is reached, the
length is cut, so that impacts happen at nodes. Estimates, kinks and the shortest length: docs/theory/error_control.md.

    goal    (8,) columns of AccuracyGoal
"""

from __future__ import annotations

from math import sqrt

from sim.contact.pairs.clearance import pairs_reached
from sim.dynamics.external_forces import set_external
from sim.integrators.contact_events import NEVER
from sim.integrators.halved_step import FAILED, LANDS, try_short
from sim.integrators.hamilton import coordinate_rates
from sim.integrators.impact_error import followed_error, jumps
from sim.integrators.phases import NEAR, leave, omitted_impulses, report_apart
from sim.integrators.runge_kutta import advance
from sim.integrators.runge_kutta import begin as begin_node
from sim.integrators.substep_lengths import (
    before_impact,
    before_stop,
    lengthen,
    lengthen_kink,
    next_length,
    note_miss,
    shorten,
    shorten_impact,
    shorten_unsolved,
    shorter,
    stalls,
)
from sim.integrators.substeps import AccuracyGoal, Clock, Embedded, SubstepState, begin_substeps, keep, rest_contacts
from sim.model.data import Data
from sim.model.interruptible_loops import is_due, note_deadline
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.record_columns import Apart, StepReport
from sim.model.slots import Slot
from solvers.compiler import Table, kernel, optional
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import IntegerMatrix, Vector

_SOLVED = int(Status.SOLVED)
_ACCURACY_NOT_REACHED = int(Status.ACCURACY_NOT_REACHED)
_NOT_FINITE, _CONTACT_SUNK = int(Status.NOT_FINITE), int(Status.CONTACT_SUNK)
_KINK, _KINKS = 0.05, 0.2  # error of a step with a kink, and of all in a step, in accuracies
_LONGER = 3.0  # times a length beyond the shortest that was not kept
_INSTANT = 1e-13  # [s] between a landing and the node before it
_SUDDEN = 8.0  # ratio of the lengths of steps on a kink and before it


@kernel
def _embedded_error(model: Model, data: Data, embedded: Embedded, h: float) -> float:
    """h e5^2/sqrt(e5^2 + e3^2/100) of the coordinate where that is largest, after a step [m, rad]."""
    coordinate_rates(model, data.stage_shift, data.nu, embedded.rate)
    s, fifth, third = model.stage_b.shape[0], 0.0, 0.0
    for d in range(embedded.rate.shape[0]):
        a, b = embedded.fifth[s] * embedded.rate[d], embedded.third[s] * embedded.rate[d]
        for j in range(s):
            a += embedded.fifth[j] * data.stage_dr[j, d]
            b += embedded.third[j] * data.stage_dr[j, d]
        fifth, third = max(fifth, abs(a)), max(third, abs(b))
    return h * fifth * fifth / sqrt(fifth * fifth + 0.01 * third * third) if fifth > 0.0 else 0.0


@kernel
def stand(models: Table, data_tables: Table, line: SubstepState, goal: Vector) -> float:
    """Time for which a flight from the node may go on before something could touch, 0 where it is near [s]."""
    model, data = model_view(models[0]), data_view(data_tables[1])
    nq = data.theta1.shape[0]
    if line.clock[Clock.READY] == 0.0:
        begin_node(model, data, line.x)
        set_external(data, line.wrench, 0)
        line.clock[Clock.READY] = 1.0
    if omitted_impulses(model, data, 1.0, line.x[nq:], -1.0) > 10.0 / goal[AccuracyGoal.ACCURACY]:
        return 0.0
    time = FAILED
    for c in range(model.contact_height.shape[0]):
        if model.cluster_end[c] > 0 and data.inactive[c, Apart.SPEED] > 0.0:
            time = min(time, data.inactive[c, Apart.GAP] / data.inactive[c, Apart.SPEED])
    for k in range(model.limit_dof.shape[0]):
        if data.bound_w[k] > 0.0:
            time = min(time, data.bound_gap[k] / data.bound_w[k])
    return min(time, pairs_reached(model, data))


@kernel
def try_long(
    models: Table, data_tables: Table, goal: Vector, line: SubstepState, embedded: Embedded, h: float
) -> tuple[int, float]:  # fmt: skip
    """line.trial = the node a step of order 8 after line.x, at which `stand` stands; (Status or NEAR, error ratio)."""
    model, data = model_view(models[0]), data_view(data_tables[1])
    nq = data.theta1.shape[0]
    copy_vector(line.x, line.trial)
    line.clock[Clock.READY] = 0.0
    leave(data)
    status = advance(model, data, h, line.u, line.trial, None)
    line.report[StepReport.ITERATIONS] += model.stage_b.shape[0]
    if status != _SOLVED:
        return status, FAILED
    if omitted_impulses(model, data, 1.0, line.trial[nq:], h) > 10.0 / goal[AccuracyGoal.ACCURACY]:
        return NEAR, FAILED
    return _SOLVED, _embedded_error(model, data, embedded, h) / (goal[AccuracyGoal.ACCURACY] * h)


@kernel
def _allows(clock: Vector, h: float, shortest: float, ratio: float) -> bool:
    """Whether a solved step of order 2 is kept. A step on a kink or an impact has a larger allowance, and so has one
    across lengths that have no solution: where none of these meets it, the first that is solved is kept. After a
    rebound there is no kink, for the velocity stays wrong.
    """
    error = ratio * h  # in accuracies
    sudden = _SUDDEN * h < clock[Clock.RECENT] or clock[Clock.HIT] > 0.0
    kink = sudden and clock[Clock.LEAST] > 0.0 and error < _KINK and error + clock[Clock.KINKS] < _KINKS
    beyond = clock[Clock.BEYOND] > 0.0 and (error < 1.0 or clock[Clock.ANY] > 0.0)
    return ratio <= 1.0 or kink or h <= shortest or beyond or stalls(clock, error)


@kernel
def _go_beyond(clock: Vector, h: float, rest: float, shortest: float, status: int) -> int:
    """The next length after one beyond the shortest that was not kept; from the beginning, where none was, with any
    error allowed. The Status.
    """
    clock[Clock.BEYOND] = _LONGER * h
    if h < rest:
        return _SOLVED
    if clock[Clock.ANY] == 0.0:
        clock[Clock.ANY], clock[Clock.BEYOND] = 1.0, _LONGER * shortest
        return _SOLVED
    return _ACCURACY_NOT_REACHED if status == _SOLVED or status == LANDS else status


@kernel
def _tell(
    model_at: Table,
    data_at: Table,
    step: tuple[Vector, Vector, float],
    line: SubstepState,
    ratio: float,
    scratch: Vector,
) -> None:
    """Adds the error of a step of order 2 that is kept; a large one of an impact is followed.   step: (goal, settings,
    length).
    """
    clock, goal, h = line.clock, step[0], step[2]
    accuracy, rest, error = goal[AccuracyGoal.ACCURACY], goal[AccuracyGoal.END] - clock[Clock.TIME], ratio * h
    if jumps(clock) and error > _KINK:
        error = min(error, followed_error(model_at, data_at, step, line, scratch) / accuracy)
    clock[Clock.ERROR] += error + clock[Clock.PUSH] * rest / accuracy


@kernel
def take_short(
    models: Table, data_tables: Table, settings: Vector, goal: Vector, line: SubstepState, embedded: Embedded, h: float
) -> int:  # fmt: skip
    """One attempt of order 2, kept where its error is allowed; the Status.

    Where the shortest step cannot be solved, as its velocities are rounded, ever longer ones are tried, with errors up
    to the accuracy times 1 s, then with any error, which `errors` of results reports.
    """
    clock, rest = line.clock, goal[AccuracyGoal.END] - line.clock[Clock.TIME]
    status, ratio = try_short(models, data_tables, settings, goal, line, embedded, h)
    rebounds = clock[Clock.HIT] > 0.0 or clock[Clock.LEAST] == 0.0
    shortest = min(goal[AccuracyGoal.SETTLED], goal[AccuracyGoal.IMPACT] if rebounds else NEVER)
    if status == _SOLVED and _allows(clock, h, shortest, ratio):
        if ratio > 1.0:
            lengthen_kink(clock, h, ratio, shortest)
            clock[Clock.KINKS] += ratio * h if ratio * h < _KINK else 0.0
        else:
            lengthen(clock, h, ratio, shortest)
        _tell(models[1], data_tables[0], (goal, settings, h), line, ratio, embedded.rate)
        keep(line, h, int(clock[Clock.ORDER]))
        clock[Clock.WAIT] = max(0.0, clock[Clock.WAIT] - 1.0)
        return _SOLVED
    if status == _NOT_FINITE or status == _CONTACT_SUNK:
        return status
    if clock[Clock.BEYOND] > 0.0:
        return _go_beyond(clock, h, rest, goal[AccuracyGoal.IMPACT], status)
    if status == _SOLVED and clock[Clock.HIT] > 0.0:  # its error is h times the rest of the accuracy for it
        left = min(_KINK, _KINKS - clock[Clock.KINKS])
        note_miss(clock, ratio * h)
        shorten_impact(clock, h, max(h * min(0.5, max(0.01, 0.8 * left / (ratio * h))), shortest))
    elif status == _SOLVED:
        shorten(clock, h, ratio, shortest)
    elif status == LANDS:
        return _SOLVED if h > _INSTANT else _ACCURACY_NOT_REACHED
    elif h <= shortest:
        clock[Clock.BEYOND] = _LONGER * h
    else:
        shorten_unsolved(clock, h, shortest)
    return _SOLVED


@kernel
def take_long(
    models: Table, data_tables: Table, goal: Vector, line: SubstepState, embedded: Embedded, h: float
) -> int:  # fmt: skip
    """One attempt of order 8, kept where its error is allowed; the Status."""
    clock = line.clock
    status, ratio = try_long(models, data_tables, goal, line, embedded, h)
    if status == _SOLVED:
        if ratio <= 1.0:
            length = next_length(h, ratio, clock[Clock.LONG_RATIO], 7.0)
            if line.contacts.shape[0] > 0:
                report_apart(model_view(models[0]), data_view(data_tables[1]), h, line.parts[0])
                rest_contacts(line)
            clock[Clock.LONG_RATIO] = max(ratio, 1e-4)
            clock[Clock.LONG] = max(length, clock[Clock.LONG] if h < 0.99 * clock[Clock.LONG] else 0.0)
            keep(line, h, 8)
            clock[Clock.ERROR] += ratio * h
            clock[Clock.READY] = 1.0
            return _SOLVED
        clock[Clock.LONG] = shorter(h, ratio, 7.0)
    elif status == _NOT_FINITE and h <= goal[AccuracyGoal.SETTLED]:
        return status
    else:
        clock[Clock.LONG] = 0.25 * h if status != NEAR else 0.5 * h
    return _SOLVED


@optional(Slot.ATTEMPT, default=_NOT_FINITE)
def attempt(
    model: Model,
    models: IntegerMatrix,
    data_tables: IntegerMatrix,
    settings: Vector,
    goal: Vector,
    embedded: Embedded,
    line: SubstepState,
) -> int:
    """One attempt at the next sub-step, of order 8, or in contact; the Status.   model: the first of the models."""
    clock = line.clock
    line.report[StepReport.STATUS] = _SOLVED  # the steps that it tries write theirs, with their worst contact
    rest = goal[AccuracyGoal.END] - clock[Clock.TIME]
    reach = 0.9 * stand(models, data_tables, line, goal) if goal[AccuracyGoal.TREE] > 0.0 else 0.0
    long = min(clock[Clock.LONG], rest, reach)
    if long < rest < 2.0 * long:
        long = 0.5 * rest
    short = before_stop(clock, min(clock[Clock.SHORT], clock[Clock.CUT], rest, before_impact(clock)))
    if clock[Clock.BEYOND] > 0.0:
        short, long = min(clock[Clock.BEYOND], rest), 0.0
    if short < rest < 2.0 * short and clock[Clock.BEYOND] == 0.0:
        short = 0.5 * rest
    if long >= min(0.5 * short, rest) and long > goal[AccuracyGoal.SETTLED]:
        status = take_long(models, data_tables, goal, line, embedded, long)
    else:
        status = take_short(models, data_tables, settings, goal, line, embedded, short)
    if goal[AccuracyGoal.END] - clock[Clock.TIME] < 1e-12 * goal[AccuracyGoal.END]:
        clock[Clock.TIME] = goal[AccuracyGoal.END]
    return status


@kernel
def go_on(
    models: Table, data_tables: Table, settings: Vector, goal: Vector, embedded: Embedded, line: SubstepState
) -> int:  # fmt: skip
    """Sub-steps until the end of the step, a full list of them or the deadline; the Status.

    models: tables of the Model for order 8 and for order 2; data_tables: of two Data.
    """
    flight, data, clock = model_view(models[0]), data_view(data_tables[0]), line.clock
    note_deadline(data, settings)
    if clock[Clock.BEGUN] == 0.0:
        begin_substeps(line, goal[AccuracyGoal.END])
    line.taken[0] = 0
    while clock[Clock.TIME] < goal[AccuracyGoal.END] and line.taken[0] < line.lengths.shape[0]:
        effort = line.report[StepReport.ITERATIONS]
        status = attempt(flight, models, data_tables, settings, goal, embedded, line)
        if status != _SOLVED:
            return status
        if is_due(data, line.report[StepReport.ITERATIONS] - effort):
            break
    return _SOLVED
