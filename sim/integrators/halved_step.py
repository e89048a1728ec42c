"""An attempt of order 2: one step of length h, its two halves, which are kept, and their difference.

Along loops and gears, without contacts and limits, the same step in three parts is extrapolated with both
(extrapolated_step.py); the result is kept if its error is smaller.
"""

from __future__ import annotations

from sim.contact.contact_report import report_contacts
from sim.dynamics.state_manifold import configuration_difference
from sim.integrators.contact_events import landing
from sim.integrators.extrapolated_step import extrapolate
from sim.integrators.node_step import begin_part, mean_of_node, node_of_mean, part_of, step_mean
from sim.integrators.slip_stop import stopping_error
from sim.integrators.substeps import AccuracyGoal, Clock, Embedded, SubstepState
from sim.model.layout import data_view, model_view
from sim.model.options import StepOptions
from solvers.compiler import Table, kernel
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import Vector

LANDS = -2  # in place of a Status: a contact or limit is reached within the step
FAILED = 1e300

_SOLVED = int(Status.SOLVED)
_TOUCHING = 0.125  # gap of a contact that closes, in accuracies
_PRESSED, _HELD = 8.0, 4.0
# [m, rad] invisible error: the gap of a contact on the central path is no more exact, nor that of a loop
_NOISE, _CLOSED = 1e-10, 1e-12
_OVERLAP = 1e-7  # [m, rad] of contacts and limits; a step removes deeper ones, whatever its length
_LITTLE, _WAIT = 0.01, 4.0  # least ratio of a step that is extrapolated; steps without that after one in vain
_AHEAD = 1e-3  # [s] least length of the steps behind an impact whose velocities are compared


@kernel
def shorten_impact(clock: Vector, tried: float, h: float) -> None:
    """Steps with an impact are no longer than h < tried; where it comes later than h/2, a step ends before it."""
    clock[Clock.IMPACT], ahead = h, clock[Clock.AHEAD]
    clock[Clock.CUT] = 0.98 * ahead if 0.5 * h < ahead < tried else h


@kernel
def _two_halves(model_at: Table, data_at: Table, options: StepOptions, line: SubstepState) -> int:
    """line.trial = the node two steps after line.x, line.mean = its mean state, line.parts their contacts; Status."""
    model, data, h = model_view(model_at), data_view(data_at), options.h
    begin_part(data, line.wrench)
    status = mean_of_node(model_at, data_at, h, line.u, line.x, line.mean)
    begin_part(data, line.wrench)
    for part in range(2):
        if status == _SOLVED:
            one, other = (line.mean, line.half) if part == 0 else (line.half, line.mean)
            status = step_mean(model, data, options, line.u, one, other, line.report)
            report_contacts(model, data, h, line.parts[part])
    return node_of_mean(model, data, h, line.u, line.mean, line.trial) if status == _SOLVED else status


@kernel
def _step_ahead(
    model_at: Table, data_at: Table, options: StepOptions, line: SubstepState, x: Vector, out: Vector
) -> int:  # fmt: skip
    """out = the mean state one step after the node x, in which the ground acts on both alike; the Status."""
    model, data = model_view(model_at), data_view(data_at)
    begin_part(data, line.wrench)
    status = mean_of_node(model_at, data_at, options.h, line.u, x, line.half)
    if status != _SOLVED:
        return status
    begin_part(data, line.wrench)
    return step_mean(model, data, options, line.u, line.half, out, line.report)


@kernel
def _difference(
    model_at: Table, data_at: Table, options: StepOptions, goal: Vector, line: SubstepState, embedded: Embedded
) -> float:  # fmt: skip
    """Largest e = |q - q'|/2 + |v - v'| t of the coordinates after a step and after its two halves [m, rad].

    In contact without an impact, _PRESSED times that: errors of the velocity go on there, and grow where a body tips.
    _HELD times by loops and gears alone.

    v, v': after an impact, as means of another step, in which the ground has acted. Without an impact these do not
    count: they are as different as the gap of a contact is, over the length of the step.
    t: the rest of the step, at least half a second: the time over which an error of the velocity counts.
    """
    model, data = model_view(model_at), data_view(data_at)
    nq, hits = data.theta1.shape[0], line.clock[Clock.HIT] > 0.0
    one, other, presses = line.node, line.trial, data.active_count[0] > 0
    if hits and _step_ahead(model_at, data_at, options, line, line.node, line.ahead) == _SOLVED:
        if _step_ahead(model_at, data_at, options, line, line.trial, line.node) == _SOLVED:
            one, other = line.ahead, line.node
    configuration_difference(model, line.whole[:nq], line.mean[:nq], embedded.distance)
    noise = _NOISE if model.contact_body.shape[0] + model.limit_dof.shape[0] > 0 else _CLOSED
    error, time = 0.0, max(goal[AccuracyGoal.END] - line.clock[Clock.TIME], 0.5) if hits else 0.0
    for d in range(embedded.distance.shape[0]):
        moved, turned = 0.5 * abs(embedded.distance[d]), abs(one[nq + d] - other[nq + d])
        error = max(error, max(moved - noise, 0.0) + time * turned)
    if presses:
        return error if hits else _PRESSED * error
    return _HELD * error if model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0 else error


@kernel
def _extrapolated(
    models: Table,
    works: Table,
    step: tuple[Vector, Vector, float],
    line: SubstepState,
    embedded: Embedded,
    ratio: float,
) -> float:
    """Error over allowed of the better of two steps, which is in line.trial: that of order 2 in two halves, whose ratio
    is given, and the extrapolated one, where it is tried.   step: (goal, settings, length).
    """
    model, clock = model_view(models[1]), line.clock
    goal, settings, h = step
    events = model.contact_body.shape[0] + model.limit_dof.shape[0]
    if events > 0 or model.loop_ntrans.shape[0] + model.gear_dof.shape[0] == 0:
        return ratio
    if clock[Clock.BEYOND] + clock[Clock.WAIT] > 0.0 or not ratio > _LITTLE:
        return ratio
    error = max(extrapolate(models[1], works[0], settings, goal, line, embedded, h) - _CLOSED, 0.0)
    better = _HELD * error / (goal[AccuracyGoal.ACCURACY] * h)
    if better > 0.5 * ratio:
        clock[Clock.WAIT] = _WAIT
        return ratio
    copy_vector(line.ahead, line.trial)
    clock[Clock.ORDER] = 6.0
    return better


@kernel
def try_short(
    models: Table, works: Table, settings: Vector, goal: Vector, line: SubstepState, embedded: Embedded, h: float
) -> tuple[int, float]:  # fmt: skip
    """line.trial = the node one step of order 2, in two halves, after line.x; (Status or LANDS, error over allowed)."""
    model, data, options = model_view(models[1]), data_view(works[0]), part_of(goal, settings, h, 2)
    line.clock[Clock.ORDER] = 2.0
    begin_part(data, line.wrench)
    status = mean_of_node(models[1], works[0], h, line.u, line.x, line.mean)
    if status == _SOLVED:
        begin_part(data, line.wrench)
        status = step_mean(model, data, options, line.u, line.mean, line.whole, line.report)
    if status != _SOLVED:
        return status, FAILED
    found = landing(model, data, options, goal[AccuracyGoal.ACCURACY], line.mean, line.slips)
    line.clock[Clock.HIT], line.clock[Clock.AHEAD] = 1.0 if found.hits else 0.0, found.ahead
    status = node_of_mean(model, data, h, line.u, line.whole, line.node)
    if found.longest < h:
        line.clock[Clock.CUT], line.clock[Clock.LEAST] = found.longest, 0.0
        return LANDS, FAILED
    if found.hits and h > line.clock[Clock.IMPACT] and line.clock[Clock.BEYOND] == 0.0:
        shorten_impact(line.clock, h, line.clock[Clock.IMPACT])
        return LANDS, FAILED
    if found.error > 2.0 * _TOUCHING * goal[AccuracyGoal.ACCURACY]:
        line.clock[Clock.CUT] = max(min(0.9 * found.ahead, 0.5 * h), 0.02 * h)
        return LANDS, FAILED
    if status == _SOLVED:
        status = _two_halves(models[1], works[0], part_of(goal, settings, 0.5 * h, 1), line)
    if status != _SOLVED:
        return status, FAILED
    if found.depth > _OVERLAP:
        return _SOLVED, 0.0
    error = stopping_error(model, line.parts, line.slips, h)
    behind = part_of(goal, settings, max(0.5 * h, _AHEAD), 1)
    error = max(error, _difference(models[1], works[0], behind, goal, line, embedded))
    ratio = error / (goal[AccuracyGoal.ACCURACY] * h)
    return _SOLVED, _extrapolated(models, works, (goal, settings, h), line, embedded, ratio)
