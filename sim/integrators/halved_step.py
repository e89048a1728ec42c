"""An attempt of order 2: one step of length h, its two halves, and their difference.

They are extrapolated to order 4 where the motion is smooth, or along loops and gears, without contacts and limits, to
order 6 with the same step in three parts (extrapolated_step.py). Elsewhere the halves are kept.
"""

from __future__ import annotations

from sim.contact.contact_report import report_contacts
from sim.dynamics.state_manifold import configuration_difference
from sim.integrators.contact_events import NEVER, Landing, landed_error, landing
from sim.integrators.extrapolated_step import CLOSED, NOISE, extrapolate, raise_order
from sim.integrators.impact_error import FEW, MANY, impact_errors, jumps
from sim.integrators.node_step import (
    begin_part,
    hands_on,
    mean_of_node,
    node_of_mean,
    part_of,
    scale_impulses,
    step_mean,
    within,
)
from sim.integrators.opening_push import opening_push
from sim.integrators.slip_stop import stopping_error
from sim.integrators.substep_lengths import before_landing, shorten_impact
from sim.integrators.substeps import AccuracyGoal, Clock, Embedded, SubstepState
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.options import Guess, StepOptions
from solvers.compiler import Table, kernel
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import Vector

LANDS = -2  # in place of a Status, beside NEAR: a contact or limit is reached within the step
FAILED = 1e300

_SOLVED = int(Status.SOLVED)
_PRESSED, _HELD = 8.0, 4.0
_OVERLAP = 1e-7  # [m, rad] of contacts and limits; a step removes deeper ones, whatever its length
_LITTLE, _WAIT = 0.01, 4.0  # least ratio of a step that is extrapolated; steps without that after one in vain
_NEAR_START = 0.01  # share of the tolerance
_SETTLES = 1.5  # times the length in which contacts settle: in shorter steps their gaps oscillate


@kernel
def _share(model: Model) -> float:
    """Of the tolerance: a start near the solution ends just within it, one far away well within it."""
    return _NEAR_START if hands_on(model) else 1.0


@kernel
def _guess_half(line: SubstepState, nq: int, part: int) -> None:
    """line.ahead = guess of the mean velocity of a half of the step from line.mean, or line.half, to line.whole: on the
    parabola of that step, or after its impact.
    """
    v15, v25, one, hits = line.mean, line.whole, line.half, line.clock[Clock.HIT] > 0.0
    for d in range(nq, v25.shape[0]):
        if part == 0:
            line.ahead[d] = v25[d] if hits else 0.75 * v25[d] + 0.25 * v15[d]
        else:
            line.ahead[d] = one[d] if hits else 2.0 * v25[d] - one[d]


@kernel
def _two_halves(model_at: Table, data_at: Table, options: StepOptions, line: SubstepState) -> int:
    """line.trial = the node two steps after line.x, line.mean = its mean state, line.parts their contacts; Status.

    Where hands_on, they start near the undivided step, which is in line.whole and in the Data, with its forces.
    """
    model, data, h = model_view(model_at), data_view(data_at), options.h
    nq, near = data.theta1.shape[0], hands_on(model)
    _guess_half(line, nq, 0)
    begin_part(data, line.wrench)
    status = mean_of_node(model_at, data_at, h, line.u, line.x, line.mean)
    begin_part(data, line.wrench)
    scale_impulses(model, data, 0.5 if line.clock[Clock.HIT] == 0.0 else 1.0)
    for part in range(2):
        if status == _SOLVED:
            one, other = (line.mean, line.half) if part == 0 else (line.half, line.mean)
            guess = Guess(line.ahead[nq:] if near else one[nq:], part == 1 or near)
            status = step_mean(model, data, options, line.u, one, guess, other, line.report)
            report_contacts(model, data, h, line.parts[part])
            _guess_half(line, nq, 1)
    return node_of_mean(model, data, h, line.u, line.mean, line.trial) if status == _SOLVED else status


@kernel
def _difference(
    model_at: Table, data_at: Table, step: tuple[Vector, Vector, float], line: SubstepState, embedded: Embedded
) -> float:  # fmt: skip
    """Largest e = |q - q'|/2 of the coordinates after a step and after its two halves [m, rad]; with an impact, and the
    errors that follow from its velocities (`impact_errors`). Without one these do not count: they are as different as
    the gap of a contact is, over the length of the step.

    In contact without an impact, _PRESSED times that: errors of the velocity go on there, and grow where a body tips.
    _HELD times by loops and gears alone.
    """
    model, data = model_view(model_at), data_view(data_at)
    nq, hits, presses = data.theta1.shape[0], jumps(line.clock), data.active_count[0] > 0
    if hits:
        impact_errors(model_at, data_at, step, line, embedded.rate)
    configuration_difference(model, line.whole[:nq], line.mean[:nq], embedded.distance)
    noise = NOISE if model.contact_body.shape[0] + model.limit_dof.shape[0] > 0 else CLOSED
    error = 0.0
    for d in range(embedded.distance.shape[0]):
        moved, later = 0.5 * abs(embedded.distance[d]) - noise, embedded.rate[d] if hits else 0.0
        error = max(error, max(moved, 0.0) + later)
    if presses:
        return error if hits else _PRESSED * error
    return _HELD * error if model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0 else error


@kernel
def _extrapolated(
    models: Table,
    data_tables: Table,
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
    error = max(extrapolate(models[1], data_tables[0], settings, goal, line, embedded, h) - CLOSED, 0.0)
    better = _HELD * error / (goal[AccuracyGoal.ACCURACY] * h)
    if better > 0.5 * ratio:
        clock[Clock.WAIT] = _WAIT
        return ratio
    copy_vector(line.ahead, line.trial)
    clock[Clock.ORDER] = 6.0
    return better


@kernel
def _patient(model: Model, goal: Vector, settings: Vector, clock: Vector, h: float) -> StepOptions:
    """Options of a step of length h in two parts: with few iterations where another length can be tried instead."""
    options = part_of(goal, settings, h, 2)
    if clock[Clock.ANY] > 0.0:
        return within(options, options.max_iterations, _share(model))
    shortest = h <= goal[AccuracyGoal.IMPACT] or clock[Clock.BEYOND] > 0.0
    return within(options, MANY if shortest else FEW, _share(model))


@kernel
def _whole(model_at: Table, data_at: Table, options: StepOptions, line: SubstepState) -> int:
    """line.whole = the mean state one step after the node line.x, line.mean = that before; the Status.

    It starts with the forces of the step that stands in the Data, where they go on.
    """
    model, data, warm = model_view(model_at), data_view(data_at), line.clock[Clock.WARM]
    line.clock[Clock.WARM] = 0.0
    begin_part(data, line.wrench)
    status = mean_of_node(model_at, data_at, options.h, line.u, line.x, line.mean)
    if status != _SOLVED:
        return status
    begin_part(data, line.wrench)
    if warm > 0.0:
        scale_impulses(model, data, options.h / warm)
    guess = Guess(line.mean[data.theta1.shape[0] :], warm > 0.0)
    return step_mean(model, data, options, line.u, line.mean, guess, line.whole, line.report)


@kernel
def _ends_before(goal: Vector, line: SubstepState, found: Landing, h: float) -> bool:
    """Whether the step, of length h, has to end before a contact or limit that it reaches, and is cut there; not where
    any error is kept.
    """
    clock = line.clock
    clock[Clock.HIT], clock[Clock.AHEAD] = 1.0 if found.hits else 0.0, found.ahead
    if found.longest < NEVER:
        clock[Clock.LEAST] = 0.0
    if found.longest < h:
        clock[Clock.CUT] = found.longest
        return True
    if found.hits and h > clock[Clock.IMPACT] and clock[Clock.BEYOND] == 0.0:
        shorten_impact(clock, h, clock[Clock.IMPACT])
        return True
    if found.error > landed_error(goal[AccuracyGoal.ACCURACY]) and clock[Clock.ANY] == 0.0:
        clock[Clock.CUT] = before_landing(h, found.ahead)
        return True
    return False


@kernel
def _judged(
    models: Table, data_tables: Table, step: tuple[Vector, Vector, float], line: SubstepState, embedded: Embedded
) -> float:  # fmt: skip
    """Error over allowed of the best of the steps of order 2, 4 and 6, which is then in line.trial.

    step: (goal, settings, length)
    """
    model, data, clock = model_view(models[1]), data_view(data_tables[0]), line.clock
    goal, settings, h = step
    stop = stopping_error(model, line.parts, line.slips, h)
    error = max(stop, _difference(models[1], data_tables[0], step, line, embedded))
    allowed = goal[AccuracyGoal.ACCURACY] * h
    settles = data.active_count[0] > 0 and h < _SETTLES * goal[AccuracyGoal.SETTLED]
    if clock[Clock.HIT] + clock[Clock.BEYOND] == 0.0 and not settles:
        raised = raise_order(model, data, line, embedded, goal[AccuracyGoal.ACCURACY])
        if raised < FAILED:
            clock[Clock.ORDER] = 4.0
            return max(raised, stop) / allowed
    return _extrapolated(models, data_tables, step, line, embedded, error / allowed)


@kernel
def try_short(
    models: Table, data_tables: Table, settings: Vector, goal: Vector, line: SubstepState, embedded: Embedded, h: float
) -> tuple[int, float]:  # fmt: skip
    """line.trial = the node one step of length h after line.x; (Status or LANDS, error over allowed)."""
    model, data, clock = model_view(models[1]), data_view(data_tables[0]), line.clock
    options = _patient(model, goal, settings, clock, h)
    clock[Clock.ORDER], clock[Clock.PUSH], clock[Clock.ROUGH] = 2.0, 0.0, 0.0
    status = _whole(models[1], data_tables[0], options, line)
    if status != _SOLVED:
        return status, FAILED
    report_contacts(model, data, h, line.parts[2])
    found = landing(model, data, options, goal[AccuracyGoal.ACCURACY], line.mean, line.slips)
    clock[Clock.WARM] = h if hands_on(model) and not found.hits else 0.0
    status = node_of_mean(model, data, h, line.u, line.whole, line.node)
    if _ends_before(goal, line, found, h):
        return LANDS, FAILED
    if status == _SOLVED:
        parts = within(part_of(goal, settings, 0.5 * h, 1), options.max_iterations, _share(model))
        clock[Clock.WARM] *= 0.5
        status = _two_halves(models[1], data_tables[0], parts, line)
    if status != _SOLVED:
        clock[Clock.WARM] = 0.0
        return status, FAILED
    if found.depth > _OVERLAP:
        return _SOLVED, 0.0
    clock[Clock.PUSH] = opening_push(model, data, line, 0.5 * h, goal[AccuracyGoal.ACCURACY])
    return _SOLVED, _judged(models, data_tables, (goal, settings, h), line, embedded)
