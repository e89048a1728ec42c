"""Errors that the velocities behind an impact cause: the step just tried and its two halves are both continued.

An impact goes on for some steps, in which bodies hit in turn. It has to end in both alike before they are compared.
"""

from __future__ import annotations

from sim.dynamics.state_manifold import configuration_difference
from sim.integrators.node_step import begin_part, hands_on, mean_of_node, node_of_mean, part_of, step_mean, within
from sim.integrators.slip_stop import stopping_error
from sim.integrators.substeps import AccuracyGoal, Clock, SubstepState
from sim.model.layout import data_view, model_view
from sim.model.options import Guess, StepOptions
from solvers.compiler import Table, kernel
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import Vector

# iterations of a step that may be shorter, and of one that may be longer: at folds, the interior point would try all
# its starts
FEW, MANY = 40, 100

_SOLVED = int(Status.SOLVED)
_FAILED = 1e300
_LATE, _LONGER_ONES = 1e-4, 5  # [s] longest step that ends an impact; lengths that are tried
_LATER = 0.02  # [s] for which the error of an impact is followed
_AHEAD = 1e-3  # [s] least length of the steps behind an impact whose velocities are compared


@kernel
def _step_ahead(
    model_at: Table, data_at: Table, options: StepOptions, line: SubstepState, x: Vector, out: Vector, again: bool
) -> int:  # fmt: skip
    """out = the mean state one step after the node x, in which the ground acts on both alike; the Status.

    again: the step before was the same, to line.ahead, from a node nearby, which is a start to be tried first.
    """
    model, data = model_view(model_at), data_view(data_at)
    begin_part(data, line.wrench)
    status = mean_of_node(model_at, data_at, options.h, line.u, x, line.half)
    if status != _SOLVED:
        return status
    nq = data.theta1.shape[0]
    if again and hands_on(model):
        begin_part(data, line.wrench)
        near = Guess(line.ahead[nq:], True)
        if step_mean(model, data, options, line.u, line.half, near, out, line.report) == _SOLVED:
            return _SOLVED
    begin_part(data, line.wrench)
    return step_mean(model, data, options, line.u, line.half, Guess(line.half[nq:], False), out, line.report)


@kernel
def _node_ahead(
    model_at: Table, data_at: Table, options: StepOptions, line: SubstepState, x: Vector, k: int
) -> bool:  # fmt: skip
    """line.settled[k] = the node one step after the node x; whether that is solved."""
    model, data, out = model_view(model_at), data_view(data_at), line.settled[k]
    if _step_ahead(model_at, data_at, options, line, x, out, k > 0) != _SOLVED:
        return False
    copy_vector(out, line.ahead)
    return node_of_mean(model, data, options.h, line.u, line.ahead, out) == _SOLVED


@kernel
def _settle(model_at: Table, data_at: Table, step: tuple[Vector, Vector, float], line: SubstepState) -> bool:
    """line.settled = the nodes one step after line.node and line.trial, as short as the halves; or of the first of ever
    longer ones that both of them have. False where no such step is solved.   step: (goal, settings, length).
    """
    goal, settings, h = step
    length = 0.5 * h
    for _ in range(_LONGER_ONES):
        options = within(part_of(goal, settings, length, 1), FEW, 1.0)
        if _node_ahead(model_at, data_at, options, line, line.node, 0):
            if _node_ahead(model_at, data_at, options, line, line.trial, 1):
                return True
        length *= 10.0
        if length > _LATE:
            return False
    return False


@kernel
def jumps(clock: Vector) -> bool:
    """Whether velocities may jump in the step just tried: in an impact, and across lengths that have no solution."""
    return clock[Clock.HIT] + clock[Clock.BEYOND] > 0.0


@kernel
def _counted(goal: Vector, line: SubstepState) -> float:
    """The rest of the step, at least half a second: the time over which an error of a velocity counts [s]."""
    return max(goal[AccuracyGoal.END] - line.clock[Clock.TIME], 0.5)


@kernel
def _after_impact(line: SubstepState) -> tuple[Vector, Vector, Vector]:
    """(node after the step just tried, after its halves, scratch), where the impact has ended if that is known."""
    if line.clock[Clock.ENDED] > 0.0:
        return line.settled[0], line.settled[1], line.node
    return line.node, line.trial, line.settled[0]


@kernel
def _both_ahead(
    model_at: Table, data_at: Table, options: StepOptions, line: SubstepState, nodes: tuple[Vector, Vector], out: Vector
) -> bool:  # fmt: skip
    """line.ahead, out = the mean states one step after both nodes; whether both are solved."""
    if _step_ahead(model_at, data_at, options, line, nodes[0], line.ahead, False) != _SOLVED:
        return False
    return _step_ahead(model_at, data_at, options, line, nodes[1], out, True) == _SOLVED


@kernel
def impact_errors(
    model_at: Table, data_at: Table, step: tuple[Vector, Vector, float], line: SubstepState, out: Vector
) -> None:  # fmt: skip
    """out = |v - v'| t, the errors that the velocities behind an impact cause in the coordinates if they stay as they
    are, (nv,) [m, rad].

    v, v': means of the second of two steps. The first ends the impact (`_settle`), before contacts that it pressed open
    again; in the other one the ground has acted. Where that is not solved, as an impact follows at once, they are those
    after the first one.
    """
    data, goal, settings, h = data_view(data_at), step[0], step[1], step[2]
    line.clock[Clock.ENDED] = 1.0 if _settle(model_at, data_at, step, line) else 0.0
    one, other, spare = _after_impact(line)
    options = part_of(goal, settings, max(0.5 * h, _AHEAD), 1)
    if _both_ahead(model_at, data_at, options, line, (one, other), spare):
        one, other = line.ahead, spare
    nq, time = data.theta1.shape[0], _counted(goal, line)
    for d in range(out.shape[0]):
        out[d] = time * abs(one[nq + d] - other[nq + d])


@kernel
def followed_error(
    model_at: Table, data_at: Table, step: tuple[Vector, Vector, float], line: SubstepState, scratch: Vector
) -> float:  # fmt: skip
    """Error of the impact just tried, followed for _LATER: |q - q'| then, and |v - v'| for the rest of the time; or
    that of friction that stops. 1e300 where it cannot be followed [m, rad].

    Dampers and contacts take up most of what an impact leaves.   step: (goal, settings, length).   scratch: (nv,).
    """
    model, data = model_view(model_at), data_view(data_at)
    goal, settings, h = step
    nq, time = data.theta1.shape[0], _counted(goal, line) - _LATER
    one, other, spare = _after_impact(line)
    options = within(part_of(goal, settings, _LATER, 1), MANY, 1.0)
    if not _both_ahead(model_at, data_at, options, line, (one, other), spare):
        return _FAILED
    configuration_difference(model, line.ahead[:nq], spare[:nq], scratch)
    error = stopping_error(model, line.parts, line.slips, h)
    for d in range(scratch.shape[0]):
        error = max(error, abs(scratch[d]) + time * abs(line.ahead[nq + d] - spare[nq + d]))
    return error
