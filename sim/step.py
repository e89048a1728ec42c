"""One time step, and the derivatives of one step. This is the table of contents of the physics."""

from __future__ import annotations

from sim.dynamics import begin_step
from sim.gradients import gradient
from sim.interior_point import interior_point
from sim.model import Matrix, Model, Options, Outcome, Vector, Work
from sim.newton import newton
from solvers.jit import kernel
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)


@kernel
def step(
    model: Model, work: Work, options: Options, x: Vector, u: Vector, out: Vector, hard: int | None, smooth: int | None
) -> Outcome:
    """out = state after one step from x = (q, v) under the input u.

    Exactly one of `hard` and `smooth` is None, and what it stands for is not even compiled: the interior point of scenes
    with contacts or limits, Newton's method of scenes without.
    out holds the last iterate when the status is not SOLVED; nobody must use it.
    """
    nq = work.theta1.shape[0]
    q = x[:nq]
    v = x[nq:]
    if not begin_step(model, work, options.h, q, v, u):
        return Outcome(_ANGULAR_STEP, 0, 1e300, 0.0)
    result = Outcome(_NOT_FINITE, 0, 1e300, 0.0)
    if smooth is not None:
        result = newton(model, work, options, q, v, u)
    if hard is not None:
        result = interior_point(model, work, options, q, v, u)
    total = 0.0
    for k in range(nq):
        out[k] = work.theta3[k]
        total += out[k]
    for k in range(v.shape[0]):
        out[nq + k] = work.nu[k]
        total += out[nq + k]
    if result.status == _SOLVED and not abs(total) < 1e300:
        return Outcome(_NOT_FINITE, result.iterations, result.residual, result.violation)
    return result


@kernel
def step_with_gradient(
    model: Model,
    work: Work,
    options: Options,
    x: Vector,
    u: Vector,
    out: Vector,
    A: Matrix,
    B: Matrix,
    hard: int | None,
    smooth: int | None,
) -> Outcome:
    """`step`, then A = d(out)/dx (2 nv, 2 nv) and B = d(out)/du (2 nv, nu) in tangent coordinates."""
    result = step(model, work, options, x, u, out, hard, smooth)
    if result.status != _SOLVED:
        return result
    nq = work.theta1.shape[0]
    if not gradient(model, work, options.h, options.kappa, x[:nq], x[nq:], A, B, hard):
        return Outcome(_SINGULAR, result.iterations, result.residual, result.violation)
    return result
