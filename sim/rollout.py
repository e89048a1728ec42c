"""Whole horizons, where Python enters compiled code: rollouts, feedback rollouts, linearizations, batches.

    settings   (4,) time step [s], kappa [N s m], tolerance, largest number of iterations
    report     (5,) Status, iterations, residual, violation, contact with the largest violation (-1: none)
    contacts   (ncontact, 8) impulse in world axes (3), point where it acts (3), gap, slip speed
    hard       None for scenes without contacts and limits: their code is then not compiled; otherwise `smooth` is None

Every function takes the tables of a Model and a Work (solvers/record.py); every loop stops at the first step that is
not SOLVED.
"""

from __future__ import annotations

from sim.gradients import gradient
from sim.inequalities import report_contacts
from sim.layout import model_view, work_view
from sim.model import Integers, Matrix, Model, Options, Vector, Work
from sim.state import integrate_state, state_difference
from sim.step import step
from solvers.jit import kernel, parallel_kernel, prange
from solvers.record import Table
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)
Cube = Matrix  # (n, rows, columns)


@kernel
def _options(settings: Vector) -> Options:
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
    hard: int | None,
    smooth: int | None,
) -> int:
    """xs[t + 1] = step(xs[t], us[t]) from xs[0] = x; returns the number of solved steps.

    us: (T, nu); xs: (T + 1, nx); reports: (T, 5); contacts: (T, ncontact, 8).
    """
    model = model_view(model_at)
    work = work_view(work_at)
    options = _options(settings)
    for k in range(x.shape[0]):
        xs[0, k] = x[k]
    for t in range(us.shape[0]):
        if step(model, work, options, xs[t], us[t], xs[t + 1], reports[t], hard, smooth) != _SOLVED:
            return t
        if hard is not None:
            report_contacts(model, work, contacts[t])
    return us.shape[0]


@kernel
def closed_loop(
    model_at: Table,
    work_at: Table,
    settings: Vector,
    x: Vector,
    us: Matrix,
    policy: tuple[Matrix, Matrix, Cube, Matrix],
    alpha: float,
    limits: tuple[Vector, Vector],
    substeps: int,
    xs: Matrix,
    u_out: Matrix,
    report: Vector,
    hard: int | None,
    smooth: int | None,
) -> int:
    """Rollout under the policy (xs_ref, k, K, gaps) of a backward pass; returns the number of solved knots.

        u_t = clamp(us_t + alpha k_t + K_t (x_t (-) xs_ref_t))
        x_t+1 = f(x_t, u_t) (+) (alpha - 1) gap_t+1        gap_t+1 = f(xs_ref_t, us_t) (-) xs_ref_t+1

    us, u_out: (T, nu); xs, xs_ref: (T + 1, nx); k: (T, nu); K: (T, nu, ndx); gaps: (T + 1, ndx).
    """
    model = model_view(model_at)
    work = work_view(work_at)
    options = _options(settings)
    xs_ref, ks, Ks, gaps = policy
    low, high = limits
    ndx = gaps.shape[1]
    dx = work.chain[0]
    for k in range(x.shape[0]):
        xs[0, k] = x[k]
    for t in range(us.shape[0]):
        state_difference(model, xs_ref[t], xs[t], dx[:ndx])
        for j in range(us.shape[1]):
            f = us[t, j] + alpha * ks[t, j]
            K = Ks[t, j]
            for k in range(ndx):
                f += K[k] * dx[k]
            u_out[t, j] = min(max(f, low[j]), high[j])
        b = xs[t + 1]
        for k in range(x.shape[0]):
            b[k] = xs[t, k]
        for _ in range(substeps):
            for k in range(x.shape[0]):
                work.step_x[0, k] = b[k]
            if step(model, work, options, work.step_x[0], u_out[t], b, report, hard, smooth) != _SOLVED:
                return t
        if alpha < 1.0:
            for k in range(ndx):
                dx[k] = (alpha - 1.0) * gaps[t + 1, k]
            for k in range(x.shape[0]):
                work.step_x[0, k] = b[k]
            integrate_state(model, work.step_x[0], dx[:ndx], b)
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
def _linearize_knot(
    model: Model,
    work: Work,
    options: Options,
    x: Vector,
    u: Vector,
    substeps: int,
    A: Matrix,
    B: Matrix,
    x_next: Vector,
    report: Vector,
    hard: int | None,
    smooth: int | None,
) -> None:
    """A, B of one knot: the product of the derivatives of its steps."""
    nq = work.theta1.shape[0]
    for k in range(x.shape[0]):
        x_next[k] = x[k]
    for s in range(substeps):
        a = work.step_x[0]
        for k in range(x.shape[0]):
            a[k] = x_next[k]
        if step(model, work, options, a, u, x_next, report, hard, smooth) != _SOLVED:
            return
        Js = A if s == 0 else work.step_A
        Ju = B if s == 0 else work.step_B
        if not gradient(model, work, options.h, options.kappa, a[:nq], a[nq:], Js, Ju, hard):
            report[0] = _SINGULAR
            return
        if s > 0:
            _chain(work, A, B)


@kernel
def linearize(
    model_at: Table,
    work_at: Table,
    settings: Vector,
    knots: tuple[int, int],
    xs: Matrix,
    us: Matrix,
    substeps: int,
    A: Cube,
    B: Cube,
    x_next: Matrix,
    reports: Matrix,
    hard: int | None,
    smooth: int | None,
) -> None:
    """A[t], B[t], x_next[t] of the knots (xs[t], us[t]) from knots[0] up to knots[1]."""
    model = model_view(model_at)
    work = work_view(work_at)
    options = _options(settings)
    for t in range(knots[0], knots[1]):
        _linearize_knot(model, work, options, xs[t], us[t], substeps, A[t], B[t], x_next[t], reports[t], hard, smooth)


@parallel_kernel
def linearize_knots(
    model_at: Table,
    work_ats: Matrix,
    settings: Vector,
    xs: Matrix,
    us: Matrix,
    substeps: int,
    A: Cube,
    B: Cube,
    x_next: Matrix,
    reports: Matrix,
    hard: int | None,
    smooth: int | None,
) -> None:
    """`linearize` of all knots, spread over the threads: chunk c has the scratch work_ats[c]."""
    n = us.shape[0]
    chunks = work_ats.shape[0]
    for c in prange(chunks):
        knots = (c * n // chunks, (c + 1) * n // chunks)
        linearize(model_at, work_ats[c], settings, knots, xs, us, substeps, A, B, x_next, reports, hard, smooth)


@kernel
def _roll_one(
    model_at: Table,
    work_at: Table,
    settings: Vector,
    x0: Vector,
    us: Matrix,
    xs: Matrix,
    hard: int | None,
    smooth: int | None,
) -> tuple[int, int]:
    """A rollout that keeps its states only: (status, number of solved steps)."""
    model = model_view(model_at)
    work = work_view(work_at)
    options = _options(settings)
    for k in range(x0.shape[0]):
        xs[0, k] = x0[k]
    for t in range(us.shape[0]):
        status = step(model, work, options, xs[t], us[t], xs[t + 1], work.report, hard, smooth)
        if status != _SOLVED:
            return status, t
    return _SOLVED, us.shape[0]


@parallel_kernel
def roll_batch(
    model_at: Table,
    work_ats: Matrix,
    settings: Vector,
    x0s: Matrix,
    us: Cube,
    xs: Cube,
    status: Integers,
    knots: Integers,
    hard: int | None,
    smooth: int | None,
) -> None:
    """Rollouts from x0s[i] under us[i], spread over the threads.  xs: (n, T + 1, nx); status, knots: (n,)."""
    n = us.shape[0]
    chunks = work_ats.shape[0]
    for c in prange(chunks):
        for i in range(c * n // chunks, (c + 1) * n // chunks):
            status[i], knots[i] = _roll_one(model_at, work_ats[c], settings, x0s[i], us[i], xs[i], hard, smooth)
