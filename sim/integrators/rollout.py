"""Whole horizons, where Python enters compiled code: rollouts, linearizations, batches.

    settings   (10,) the columns of StepSetting
    report     (9,) the columns of StepReport; kernels write those up to ACCURACY, which is 0 without derivatives
    contacts   (ncontact, 11) impulse in world axes (3), point where it acts (3), gap, slip speed, normal (3)

Every function takes the tables of a Model and a Data (solvers/compiler); every loop stops at the first step that is
not SOLVED, and after the first one that ends behind the deadline: model/interruptible_loops.py explains how it resumes.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.contact.contact_report import report_contacts
from sim.contact.pairs.pair_report import pairs_finite
from sim.derivatives.parameters.directions import At
from sim.derivatives.parameters.parameter_jacobian import parameter_jacobian
from sim.derivatives.step_gradient import gradient
from sim.dynamics.external_forces import set_external
from sim.dynamics.state_manifold import normalize_state
from sim.integrators.chained_derivatives import chain_step
from sim.integrators.feedback import FeedbackRun, begin_knot, end_knot
from sim.mechanism.checks import UNIT
from sim.model.data import Data
from sim.model.interruptible_loops import is_due, note_deadline
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.options import Guess, StepOptions
from sim.model.record_columns import StepReport, StepSetting
from sim.step import step
from solvers.compiler import Table, kernel
from solvers.dense import clear, copy_vector, is_finite
from solvers.lanes import LANES, load, spread, total
from solvers.status import Status
from solvers.types import Cube, IntegerMatrix, Matrix, Vector

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)
_NOT_FINITE = int(Status.NOT_FINITE)
REFUSED = -1  # in place of a Status: no state, or no inputs
ACCURACY = 7e-14  # of derivatives, times the stiffness of their contacts over inertia (contact/softening.py)


class Linearized(NamedTuple):
    """Knots of a trajectory, and buffers for their linearization."""

    xs: Matrix  # (T, nx) or (T + 1, nx) states, in
    us: Matrix  # (T, nu) inputs, in
    wrenches: Cube  # (T, nbody, 6) external ones, in, or (0, nbody, 6)
    A: Cube  # (T, ndx, ndx)
    B: Cube  # (T, ndx, nu)
    x_next: Matrix  # (T, nx), in: where the steps of one-step knots start to look for their velocities
    reports: Matrix  # (T, 9)


class MotionBuffers(NamedTuple):
    """A motion and the buffers of a loop over time; unused buffers have no rows."""

    xs: Matrix  # (T + 1, nx), of which the first row is given
    us: Matrix  # (T, nu) inputs, in
    wrenches: Cube  # (T, nbody, 6) external ones, in, or (0, nbody, 6)
    reports: Matrix  # (T, 9), or (1, 9) for that of the last step
    contacts: Cube  # (T, ncontact, 11), or (0, ncontact, 11)
    A: Cube  # (T, ndx, ndx) derivatives of the steps, or (0, ndx, ndx)
    B: Cube  # (T, ndx, nu)


class ParameterColumns(NamedTuple):
    """Parameters as the terms of their columns, the columns of every step, and scratch."""

    terms: IntegerMatrix
    weights: Vector
    J: Cube  # (T, ndx, n) d(next state)/d(parameters), out
    twists: Matrix  # (12, 6)
    below: Vector  # (nbody,)


@kernel
def options_of(data: Data, settings: Vector, begins: bool) -> StepOptions:
    """Options of the steps of a motion that begins here, or continues after a pause."""
    note_deadline(data, settings)
    if begins:
        begin(data)
    return StepOptions(
        settings[StepSetting.TIME_STEP],
        settings[StepSetting.KAPPA],
        settings[StepSetting.TOLERANCE],
        int(settings[StepSetting.MAX_ITERATIONS]),
        settings[StepSetting.GAIN],
        settings[StepSetting.LOSS],
        settings[StepSetting.CUTOFF],
        settings[StepSetting.LEFT],
    )


@kernel
def begin(data: Data) -> None:
    """Forget the motion before."""
    carry = data.carry
    carry.steps[0] = 0
    carry.travel_known[0] = 0
    carry.inactive_kappa[0] = 0.0
    clear(carry.cone_step)
    clear(carry.bound_step)
    clear(carry.dry_step)
    for numbers in (carry.couple_force, carry.next_velocity):
        for k in range(numbers.shape[0]):
            numbers[k] = 0.0


@kernel
def is_finite_matrix(M: Matrix) -> bool:
    """Whether all numbers of a matrix in C order are finite; checked while the matrix is in the processor's cache.

    Four sums: one would wait for itself. The last lanes may repeat some before.
    """
    n = M.shape[0] * M.shape[1]
    if n < LANES:
        for i in range(M.shape[0]):
            if not is_finite(M[i]):
                return False
        return True
    end = n - LANES
    a = b = c = d = spread(0.0)
    for k in range(0, n, 4 * LANES):
        a = a + 0.0 * load(M, 0, min(k, end))
        b = b + 0.0 * load(M, 0, min(k + LANES, end))
        c = c + 0.0 * load(M, 0, min(k + 2 * LANES, end))
        d = d + 0.0 * load(M, 0, min(k + 3 * LANES, end))
    return total((a + b) + (c + d)) == 0.0


@kernel
def accept(model: Model, motion: MotionBuffers) -> bool:
    """Whether a motion begins at a state, with quaternions of length one to UNIT, under inputs that are numbers."""
    if not is_finite(motion.xs[0]) or normalize_state(model, motion.xs[0], UNIT) >= 0:
        return False
    for t in range(motion.us.shape[0]):
        if not is_finite(motion.us[t]):
            return False
    return True


@kernel
def roll(
    model_at: Table,
    data_at: Table,
    settings: Vector,
    motion: MotionBuffers,
    first: int,
    columns: ParameterColumns | None,
    following: FeedbackRun | None,
) -> int:
    """xs[t + 1] = step(xs[t], us[t]) from the step `first` on; returns how many are solved, those before included.

    A step is solved once, and differentiated where it ends; by parameters, too, if there are columns of them. Inputs
    are written if the motion follows a law, with several steps per knot if it says so, and reports (1, 10) whose last
    number adds up the iterations. Without columns or a law, their code is not compiled. An invalid state is REFUSED.
    """
    model, data, n = model_view(model_at), data_view(data_at), 1
    if following is not None:
        n = following.substeps
    elif first == 0 and not accept(model, motion):
        motion.reports[0, StepReport.STATUS] = REFUSED
        return 0
    options = options_of(data, settings, first == 0)
    nq = data.theta1.shape[0]
    for t in range(first // n, motion.us.shape[0]):
        x, report = motion.xs[t], motion.reports[min(t, motion.reports.shape[0] - 1)]
        velocity, known = x[nq:], t > 0 or settings[StepSetting.IMPULSES] > 0.0
        if following is not None:
            begin_knot(model, data, following, x, motion.us[t], t)
            velocity = data.step_x[1, nq:] if n == 1 else velocity
            known = known or following.law.cones.shape[0] > 0
        set_external(data, motion.wrenches, t)
        for s in range(max(first - t * n, 0), n):
            if s > 0:
                copy_vector(motion.xs[t + 1], data.step_x[0])
                x, known = data.step_x[0], True
                velocity = x[nq:]
            if step(model, data, options, x, motion.us[t], Guess(velocity, known), motion.xs[t + 1], report) != _SOLVED:
                return t * n + s
            if following is not None:
                report[StepReport.EARLIER] += report[StepReport.ITERATIONS]
            if s + 1 < n and is_due(data, report[StepReport.ITERATIONS]):
                return t * n + s + 1
        if not report_step(model, data, options, motion, t, report):
            return t
        if columns is not None:
            at = At(options.h, x[:nq], x[nq:], motion.us[t], columns.twists, columns.below)
            parameter_jacobian(model_at, data_at, at, motion.A[t], columns.terms, columns.weights, columns.J[t])
        if following is not None:
            end_knot(model, data, following, motion.xs[t + 1], t)
        if is_due(data, report[StepReport.ITERATIONS] + (motion.A.shape[1] if motion.A.shape[0] > 0 else 0)):
            return (t + 1) * n
    return motion.us.shape[0] * n


@kernel
def report_step(model: Model, data: Data, options: StepOptions, motion: MotionBuffers, t: int, report: Vector) -> bool:
    """Contacts and derivatives of step t, where there are buffers for them; False where they are not finite."""
    x, nq = motion.xs[t], data.theta1.shape[0]
    if motion.contacts.shape[0] > 0:
        report_contacts(model, data, options.h, motion.contacts[t])
        for c in range(model.contact_height.shape[0]):
            if not is_finite(motion.contacts[t, c]):
                report[StepReport.STATUS] = _NOT_FINITE
                return False
        if not pairs_finite(model, data, motion.contacts[t]):
            report[StepReport.STATUS] = _NOT_FINITE
            return False
    if motion.A.shape[0] > 0:
        if not gradient(model, data, options.h, options.kappa, x[:nq], x[nq:], motion.A[t], motion.B[t]):
            report[StepReport.STATUS] = _SINGULAR
            return False
        if not (is_finite_matrix(motion.A[t]) and is_finite_matrix(motion.B[t])):
            report[StepReport.STATUS] = _NOT_FINITE
            return False
        report[StepReport.ACCURACY] = ACCURACY * data.contact_hard[0]
    return True


@kernel
def linearize(
    model_at: Table,
    data_at: Table,
    settings: Vector,
    knots: tuple[int, int, int],
    substeps: int,
    line: Linearized,
) -> int:
    """Derivatives of the knots from knots[0] up to knots[2], products of the derivatives of their steps.

    knots[1]: the step to resume at, counted from that of knot 0; returns the next such step.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    options = options_of(data, settings, knots[1] == knots[0] * substeps)
    nq = data.theta1.shape[0]
    x = data.step_x[0]
    for t in range(knots[1] // substeps, knots[2]):
        A = line.A[t]
        B = line.B[t]
        x_next = line.x_next[t]
        report = line.reports[t]
        velocity = data.step_x[1, nq:]
        before = max(knots[1] - t * substeps, 0)
        if before == 0:
            copy_vector(x_next[nq:], velocity)
            copy_vector(line.xs[t], x_next)
        for s in range(before, substeps):
            copy_vector(x_next, x)
            guess = Guess(velocity if substeps == 1 else x[nq:], s > 0 or settings[StepSetting.IMPULSES] > 0.0)
            set_external(data, line.wrenches, t)
            if step(model, data, options, x, line.us[t], guess, x_next, report) != _SOLVED:
                break
            Js = A if s == 0 else data.step_A
            Ju = B if s == 0 else data.step_B
            if not gradient(model, data, options.h, options.kappa, x[:nq], x[nq:], Js, Ju):
                report[StepReport.STATUS] = _SINGULAR
                break
            report[StepReport.ACCURACY] = max(report[StepReport.ACCURACY], ACCURACY * data.contact_hard[0])
            if s > 0:
                chain_step(data, A, B)
            if not (is_finite_matrix(A) and is_finite_matrix(B)):
                report[StepReport.STATUS] = _NOT_FINITE
                break
            if s + 1 < substeps and is_due(data, report[StepReport.ITERATIONS] + A.shape[0]):
                return t * substeps + s + 1
        if is_due(data, report[StepReport.ITERATIONS] + A.shape[0]):
            return (t + 1) * substeps
    return knots[2] * substeps
