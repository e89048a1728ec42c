"""One time step. This is the table of contents of the physics."""

from __future__ import annotations

from sim.contact_report import worst_contact
from sim.dynamics import begin_step
from sim.interior_point import interior_point
from sim.loops import start_loops
from sim.model import Guess, Model, Options, Outcome, Vector, Work
from sim.newton import newton
from solvers.jit import inlined
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)


@inlined
def step(
    model: Model,
    work: Work,
    options: Options,
    x: Vector,
    u: Vector,
    guess: Guess,
    out: Vector,
    report: Vector,
    hard: int | None,
    smooth: int | None,
) -> int:
    """out = state after one step from x = (q, v) under the input u; returns the Status.

    guess: of the next velocity, x[nq:] when nothing better is known.
    report: (5,) Status, iterations, residual, violation, contact with the largest violation (-1: none). `out` holds the
    last iterate when the status is not SOLVED; nobody must use it.
    Exactly one of `hard` and `smooth` is None, and what it stands for is not even compiled: the interior point of
    scenes with contacts or limits, Newton's method of scenes without.
    """
    nq = work.theta1.shape[0]
    q = x[:nq]
    v = x[nq:]
    r = Outcome(_ANGULAR_STEP, 0, 1e300, 0.0)
    if begin_step(model, work, options.h, q, v, u):
        start_loops(model, work, guess.impulses)
        if smooth is not None:
            r = newton(model, work, options, q, v, u, guess)
        if hard is not None:
            r = interior_point(model, work, options, q, v, u, guess)
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
    if hard is not None and status != _SOLVED and r.iterations > 0:
        report[4] = worst_contact(model, work, options.kappa)
    report[0] = status
    return status
