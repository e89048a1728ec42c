"""One time step. This is the table of contents of the physics."""

from __future__ import annotations

from sim import late
from sim.dynamics import begin_step
from sim.energy_balance import step_gained
from sim.late import (
    is_farther,
    lead_again,
    loops_gained,
    loops_regular,
    meet_ahead,
    predict_loops,
    solve,
    start_loops,
    stay_regular,
    worst_contact,
)
from sim.model import Model, Vector
from sim.options import Guess, Options, Outcome
from sim.work import Work
from solvers.compiler import inlined
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)
_LOOP_STEP = int(Status.LOOP_STEP)
_ENERGY_STEP = int(Status.ENERGY_STEP)
_LEADS = 2  # times that directions of loops are found anew


@inlined
def _after(r: Outcome, last: Outcome) -> Outcome:
    """The last of several solves, with the iterations of all."""
    return Outcome(last.status, r.iterations + last.iterations, last.residual, last.violation)


@inlined
def _checked(model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], r: Outcome) -> Outcome:
    """The outcome of a step, refused where the forces of loops gave energy (coupling/loop_work.py), or it gained some.

    The interior point asks for the latter of every solution it finds.
    """
    if r.status == _SOLVED and loops_gained(model, work, options, inputs[1]):
        return Outcome(_LOOP_STEP, r.iterations, r.residual, r.violation)
    smooth = model.contact_body.shape[0] + model.limit_dof.shape[0] == 0
    if r.status == _SOLVED and smooth and step_gained(model, work, options, inputs):
        return Outcome(_ENERGY_STEP, r.iterations, r.residual, r.violation)
    return r


@inlined
def solve_branch(
    model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], guess: Guess
) -> Outcome:
    """`solve` on the branch of the loops' motion (coupling/loop_motion.py and loop_lead.py).   inputs: (q, v, u)."""
    q, v, u = inputs
    r = Outcome(_SOLVED, 0, 0.0, 0.0)
    if loops_regular(model, work):
        r = _after(r, solve(model, work, options, q, v, u, guess))
        if stay_regular(model, work, r.status):
            return _checked(model, work, options, inputs, r)
        guess = Guess(guess.velocity, guess.impulses and r.status == _SOLVED)
    if predict_loops(model, work, options.h, q, v, guess.velocity):
        guess = Guess(work.loop_velocity, guess.impulses)
    r = _after(r, solve(model, work, options, q, v, u, guess))
    if r.status == _SOLVED and meet_ahead(model, work):
        r = _after(r, solve(model, work, options, q, v, u, Guess(work.loop_start, guess.impulses)))
        if is_farther(model, work, r.status):
            r = _after(r, solve(model, work, options, q, v, u, Guess(work.loop_start, guess.impulses)))
    for _ in range(_LEADS):
        if r.status != _SOLVED or not lead_again(model, work, options.h, q):
            break
        r = _after(r, solve(model, work, options, q, v, u, Guess(work.loop_velocity, guess.impulses)))
    return _checked(model, work, options, inputs, r)


@late.step.defined(otherwise=int(Status.NOT_FINITE))
def step(
    model: Model, work: Work, options: Options, x: Vector, u: Vector, guess: Guess, out: Vector, report: Vector
) -> int:
    """out = state after one step from x = (q, v) under the input u; returns the Status.

    guess: of the next velocity, x[nq:] when nothing better is known.
    report: (5,) Status, iterations, residual, violation, contact with the largest violation (-1: none). `out` holds the
    last iterate when the status is not SOLVED; nobody must use it.
    Scenes with contacts or limits bind the interior point as `solve`, those without bind Newton's method.
    """
    nq = work.theta1.shape[0]
    q = x[:nq]
    v = x[nq:]
    r = Outcome(_ANGULAR_STEP, 0, 1e300, 0.0)
    if begin_step(model, work, options.h, q, v, u):
        start_loops(model, work, guess.impulses)
        r = solve_branch(model, work, options, (q, v, u), guess)
    total = 0.0
    for k in range(nq):
        out[k] = work.theta3[k]
        total += out[k]
    for k in range(v.shape[0]):
        out[nq + k] = work.nu[k]
        total += out[nq + k]
    status = r.status
    if not abs(total) < 1e300:
        status = _NOT_FINITE
    report[1] = r.iterations
    report[2] = r.residual
    report[3] = r.violation
    report[4] = -1.0
    if status != _SOLVED and r.iterations > 0:
        report[4] = worst_contact(model, work, options.kappa)
    report[0] = status
    work.counts[3] = work.counts[3] + 1 if status == _SOLVED else 0
    return status
