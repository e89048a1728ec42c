"""SubstepState: a motion under one input, divided into sub-steps, with the lengths to try next."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from sim.integrators.contact_events import BEGINS, NEVER, UNKNOWN
from sim.model.record_columns import ContactRow, StepReport
from solvers.codes import Code
from solvers.compiler import kernel
from solvers.dense import clear, copy_vector
from solvers.rotation import three
from solvers.status import Status
from solvers.types import Cube, Integers, Matrix, Vector

_SOLVED = int(Status.SOLVED)
_SLIPS = 1e-3  # [m/s] slower contacts rest


class Clock(Code):
    """clock of a SubstepState."""

    TIME = 0  # [s] since its beginning
    SHORT = 1  # next length of order 2 [s]
    LONG = 2  # next length of order 8
    SHORT_RATIO = 3  # error over allowed of the last accepted step of order 2
    LONG_RATIO = 4
    READY = 5  # 1 where the Data of order 8 stand at the node
    RECENT = 6  # length of the last accepted step of order 2
    KINKS = 7  # error of the steps with kinks so far, in accuracies
    LEAST = 8  # shortest length of an impact with restitution at the node
    CUT = 9  # longest length before a contact or limit is reached, of this node
    BEYOND = 10  # length tried where the shortest step is not solved, 0 elsewhere
    ERROR = 11  # estimated, of the sub-steps so far, in accuracies times 1 s
    HIT = 12  # 1 where the step just tried has an impact
    AHEAD = 13  # time until the first contact of that step [s]
    IMPACT = 14  # longest length of a step with an impact
    BEGUN = 15  # 0 before the first sub-step
    ANY = 16  # 1 where no length beyond the shortest has an error that is allowed: whatever error is kept
    ORDER = 17  # of the step in the trial: 2, or 4 or 6 where it is extrapolated
    WAIT = 18  # steps of order 2 until the next extrapolation is tried
    WARM = 19  # length of the step whose impulses are in the Data of order 2, 0 where they are of no use [s]
    LANDING = 20  # time of the impact that IMPACT is for [s]
    CEILING = 21  # longest length: half of one without a solution, and more after every step since [s]
    REFUSED = 22  # 1 where the error of a step from this node was too large
    MISSES = 23  # steps of the shortest length in a row whose error is too large
    PUSH = 24  # velocity that contacts give as they open, in the step just tried [m/s, rad/s]
    MISS = 25  # error of the last impact that was refused, in accuracies; 0: none since the last one kept
    STALLS = 26  # impacts refused in a row that were no more exact than the one before
    ROUGH = 27  # length of the step just tried over the longest of order 4, 0 where that is not known
    ENDED = 28  # 1 where `settled` of a SubstepState are the nodes where the impact of the step just tried has ended
    STOP = 29  # time when the first contact stops sliding, at its deceleration [s]


class AccuracyGoal(Code):
    """goal of the sub-steps of a step."""

    ACCURACY = 0  # [m/s, rad/s]
    TIME_STEP = 1  # that kappa is for [s]
    END = 2  # of the step [s]
    SETTLED = 3  # length of step in which contacts settle [s]
    LEAST_KAPPA = 4  # [N s m]
    TREE = 5  # 1 where nothing couples the trees of joints
    IMPACT = 6  # shortest length of an impact [s]
    MOST = 7  # sub-steps: an input is not held for ever


class SubstepState(NamedTuple):
    """Motion under one input, and its sub-steps."""

    u: Vector  # (nu,) in
    wrench: Cube  # (1, nbody, 6) in, or (0, nbody, 6)
    x: Vector  # (nx,) the node, in place
    trial: Vector  # (nx,) scratch, as the next five
    mean: Vector
    whole: Vector
    half: Vector
    node: Vector  # (nx,) scratch: the node after the undivided step
    ahead: Vector  # (nx,) scratch: mean state of a step from there
    settled: Matrix  # (2, nx) scratch: nodes a short step after that, and after the halves
    clock: Vector  # (30,) in place
    report: Vector  # (9,) in place; PARTS counts the sub-steps
    parts: Cube  # (3, ncontact, 11) scratch: contacts of both halves, and of the whole step
    slips: Vector  # (ncontact,) at the node, after the last step; -1 unknown, -2 at the beginning of the step
    contacts: Matrix  # (ncontact, 11) in place: impulses so far, the rest of the last step
    starts: Matrix  # (n, nx) nodes where the sub-steps begin, of those since the last pause
    lengths: Vector  # (n,) [s]
    orders: Integers  # (n,)
    taken: Integers  # (1,) number of those sub-steps


class Embedded(NamedTuple):
    """Error estimate of a Scheme."""

    fifth: Vector  # (s + 1,) weights of the rates of the stages, and of the end of the step
    third: Vector
    rate: Vector  # (nv,) scratch
    distance: Vector  # (nv,)


@kernel
def begin_substeps(line: SubstepState, end: float) -> None:
    """A new step from line.x: lengths as long as it are the first to be tried."""
    clear(line.contacts)
    clock = line.clock
    for k in range(clock.shape[0]):
        clock[k] = 0.0
    for k in range(line.report.shape[0]):
        line.report[k] = 0.0
    clock[Clock.SHORT] = clock[Clock.LONG] = end
    clock[Clock.SHORT_RATIO] = clock[Clock.LONG_RATIO] = 1.0
    clock[Clock.LEAST] = clock[Clock.CUT] = clock[Clock.IMPACT] = NEVER
    clock[Clock.CEILING] = clock[Clock.STOP] = NEVER
    clock[Clock.BEGUN] = 1.0
    for c in range(line.slips.shape[0]):
        line.slips[c] = BEGINS


@kernel
def keep(line: SubstepState, h: float, order: int) -> None:
    """The trial becomes the node."""
    n = line.taken[0]
    copy_vector(line.x, line.starts[n])
    line.lengths[n], line.orders[n] = h, order
    line.taken[0] = n + 1
    line.report[StepReport.PARTS] += 1.0
    copy_vector(line.trial, line.x)
    line.clock[Clock.TIME] += h
    line.clock[Clock.CUT] = line.clock[Clock.LEAST] = NEVER
    line.clock[Clock.REFUSED] = 0.0
    line.clock[Clock.BEYOND] = line.clock[Clock.ANY] = 0.0
    line.clock[Clock.STOP] = NEVER
    if order == 8 or line.clock[Clock.HIT] > 0.0:
        line.clock[Clock.IMPACT] = NEVER
        line.clock[Clock.MISS] = line.clock[Clock.STALLS] = 0.0
    if order != 8:
        line.clock[Clock.READY] = 0.0
        add_contacts(line)
        line.clock[Clock.STOP] = line.clock[Clock.TIME] + _time_to_stop(line, h)


@kernel
def _time_to_stop(line: SubstepState, h: float) -> float:
    """Time until the first contact that slides stops, at the deceleration in the two halves of a step [s]."""
    time = NEVER
    for c in range(line.slips.shape[0]):
        slower = line.parts[0, c, ContactRow.SLIP] - line.parts[1, c, ContactRow.SLIP]
        if slower > 0.0 and line.slips[c] > _SLIPS and three(line.parts[1, c], ContactRow.IMPULSE) != (0.0, 0.0, 0.0):
            time = min(time, 0.5 * h * line.slips[c] / slower)
    return time


@kernel
def end_report(line: SubstepState, status: int) -> None:
    """The report of a step with this Status: its worst contact is that of the sub-step that failed with it."""
    if status == _SOLVED or int(line.report[StepReport.STATUS]) != status:
        line.report[StepReport.WORST] = -1.0
    line.report[StepReport.STATUS] = status


@kernel
def add_contacts(line: SubstepState) -> None:
    """Impulses of both halves to those before, at their mean points; gaps, slips and normals of the end."""
    for c in range(line.contacts.shape[0]):
        out = line.contacts[c]
        for half in range(2):
            row = line.parts[half, c]
            one, other = 0.0, 0.0
            for k in range(3):
                one, other = one + out[k] * out[k], other + row[k] * row[k]
            one, other = sqrt(one), sqrt(other)
            weight = other / (one + other) if one + other > 0.0 else 1.0
            for k in range(3):
                out[k] += row[k]
                out[ContactRow.POINT + k] += weight * (row[ContactRow.POINT + k] - out[ContactRow.POINT + k])
            for k in range(ContactRow.GAP, ContactRow.MOMENT):
                out[k] = row[k]
            for k in range(ContactRow.MOMENT, out.shape[0]):
                out[k] += row[k]
        one, other = line.parts[0, c, ContactRow.SLIP], line.parts[1, c, ContactRow.SLIP]
        line.slips[c] = max(0.0, 1.5 * other - 0.5 * one)


@kernel
def rest_contacts(line: SubstepState) -> None:
    """Gaps, slips and normals of the end of a flight, and points of contacts without an impulse; impulses stay."""
    for c in range(line.contacts.shape[0]):
        line.slips[c] = UNKNOWN
        free = three(line.contacts[c], ContactRow.IMPULSE) == (0.0, 0.0, 0.0)
        for k in range(ContactRow.POINT if free else ContactRow.GAP, ContactRow.MOMENT):
            line.contacts[c, k] = line.parts[0, c, k]
