"""Whole horizons, where Python enters compiled code: rollouts, linearizations, batches.

    settings   (4,) time step [s], kappa [N s m], tolerance, largest number of iterations
    report     (6,) Status, iterations, residual, violation, contact with the largest violation (-1: none), and the
               accuracy of derivatives, 0 where there are none
    contacts   (ncontact, 11) impulse in world axes (3), point where it acts (3), gap, slip speed, normal (3)

Every function takes the tables of a Model and a Work (solvers/record.py); every loop stops at the first step that is
not SOLVED.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.late import gradient, report_contacts, step
from sim.layout import model_view, work_view
from sim.model import Integers, Matrix, Vector
from sim.options import Guess, Options
from sim.work import Work
from solvers.jit import kernel, parallel_kernel, prange
from solvers.record import Table
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)
ACCURACY = 3e-14  # of derivatives, times the stiffness of their contacts over inertia (contacts/softening.py)
Cube = Matrix  # (n, rows, columns)


class Linearized(NamedTuple):
    """Knots of a trajectory, and what their linearization fills in."""

    xs: Matrix  # (T, nx) or (T + 1, nx) states, in
    us: Matrix  # (T, nu) inputs, in
    A: Cube  # (T, ndx, ndx)
    B: Cube  # (T, ndx, nu)
    x_next: Matrix  # (T, nx), in: where the steps of one-step knots start to look for their velocities
    reports: Matrix  # (T, 6)


@kernel
def begin(work: Work, settings: Vector) -> Options:
    """Settings of a motion that begins here."""
    work.counts[3] = 0
    # what is known of far contacts (contacts/far.py), forces of loops and last directions belong to another motion
    work.far_law[0] = 0.0
    for row in range(work.couple_force.shape[0]):
        work.couple_force[row] = 0.0
    for c in range(work.cone_step.shape[0]):
        for k in range(work.cone_step.shape[1]):
            work.cone_step[c, k] = 0.0
    for k in range(work.bound_step.shape[0]):
        work.bound_step[k, 0] = work.bound_step[k, 1] = 0.0
    return Options(settings[0], settings[1], settings[2], int(settings[3]))


@kernel
def roll(
    model_at: Table,
    work_at: Table,
    settings: Vector,
    x: Vector,
    us: Matrix,
    xs: Matrix,
    reports: Matrix,
    contacts: Cube,
) -> int:
    """xs[t + 1] = step(xs[t], us[t]) from xs[0] = x; returns the number of solved steps.

    us: (T, nu); xs: (T + 1, nx); reports: (T, 6); contacts: (T, ncontact, 11).
    """
    model = model_view(model_at)
    work = work_view(work_at)
    options = begin(work, settings)
    nq = work.theta1.shape[0]
    for k in range(x.shape[0]):
        xs[0, k] = x[k]
    for t in range(us.shape[0]):
        if step(model, work, options, xs[t], us[t], Guess(xs[t, nq:], t > 0), xs[t + 1], reports[t]) != _SOLVED:
            return t
        report_contacts(model, work, options.h, contacts[t])
    return us.shape[0]


@kernel
def _chain(work: Work, A: Matrix, B: Matrix) -> None:
    """A := A_step A, B := A_step B + B_step."""
    n = A.shape[0]
    m = B.shape[1]
    T = work.chain
    S = work.step_A
    for i in range(n):
        t = T[i]
        for k in range(n):
            t[k] = 0.0
        for k in range(m):
            t[n + k] = work.step_B[i, k]
        for j in range(n):
            s = S[i, j]
            a = A[j]
            b = B[j]
            for k in range(n):
                t[k] += s * a[k]
            for k in range(m):
                t[n + k] += s * b[k]
    for i in range(n):
        for k in range(n):
            A[i, k] = T[i, k]
        for k in range(m):
            B[i, k] = T[i, n + k]


@kernel
def linearize(
    model_at: Table,
    work_at: Table,
    settings: Vector,
    knots: tuple[int, int],
    substeps: int,
    line: Linearized,
) -> None:
    """Derivatives of the knots from knots[0] up to knots[1]: products of the derivatives of their steps."""
    model = model_view(model_at)
    work = work_view(work_at)
    options = begin(work, settings)
    nq = work.theta1.shape[0]
    x = work.step_x[0]
    for t in range(knots[0], knots[1]):
        A = line.A[t]
        B = line.B[t]
        x_next = line.x_next[t]
        report = line.reports[t]
        velocity = work.step_x[1, nq:]
        for k in range(velocity.shape[0]):
            velocity[k] = x_next[nq + k]
        for k in range(x.shape[0]):
            x_next[k] = line.xs[t, k]
        for s in range(substeps):
            for k in range(x.shape[0]):
                x[k] = x_next[k]
            guess = Guess(velocity if substeps == 1 else x[nq:], s > 0)
            if step(model, work, options, x, line.us[t], guess, x_next, report) != _SOLVED:
                break
            Js = A if s == 0 else work.step_A
            Ju = B if s == 0 else work.step_B
            if not gradient(model, work, options.h, options.kappa, x[:nq], x[nq:], Js, Ju):
                report[0] = _SINGULAR
                break
            report[5] = max(report[5], ACCURACY * work.contact_hard[0])
            if s > 0:
                _chain(work, A, B)


@parallel_kernel
def linearize_knots(
    model_at: Table,
    work_ats: Table,
    settings: Vector,
    substeps: int,
    line: Linearized,
) -> None:
    """`linearize` of all knots, spread over the threads: chunk c has the scratch work_ats[c]."""
    n = line.us.shape[0]
    chunks = work_ats.shape[0]
    for c in prange(chunks):
        knots = (c * n // chunks, (c + 1) * n // chunks)
        linearize(model_at, work_ats[c], settings, knots, substeps, line)


@kernel
def _roll_one(
    model_at: Table,
    work_at: Table,
    settings: Vector,
    x0: Vector,
    us: Matrix,
    xs: Matrix,
) -> tuple[int, int]:
    """A rollout that keeps its states only: (status, number of solved steps)."""
    model = model_view(model_at)
    work = work_view(work_at)
    options = begin(work, settings)
    nq = work.theta1.shape[0]
    for k in range(x0.shape[0]):
        xs[0, k] = x0[k]
    for t in range(us.shape[0]):
        status = step(model, work, options, xs[t], us[t], Guess(xs[t, nq:], t > 0), xs[t + 1], work.report)
        if status != _SOLVED:
            return status, t
    return _SOLVED, us.shape[0]


@parallel_kernel
def roll_batch(
    model_at: Table,
    work_ats: Table,
    settings: Vector,
    x0s: Matrix,
    us: Cube,
    xs: Cube,
    status: Integers,
    knots: Integers,
) -> None:
    """Rollouts from x0s[i] under us[i], spread over the threads.  xs: (n, T + 1, nx); status, knots: (n,)."""
    n = us.shape[0]
    chunks = work_ats.shape[0]
    for c in prange(chunks):
        for i in range(c * n // chunks, (c + 1) * n // chunks):
            status[i], knots[i] = _roll_one(model_at, work_ats[c], settings, x0s[i], us[i], xs[i])
