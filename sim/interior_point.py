"""The interior point of a step: contacts and limits on the central path of kappa, joint velocities by Newton's method."""

from __future__ import annotations

from typing import NamedTuple

from sim.dynamics import momentum_balance, momentum_balance_jacobian
from sim.elimination import factor, project, solve, subtree_sums
from sim.inequalities import (
    apply_inequalities,
    apply_limits,
    boundary_step,
    condense_inequalities,
    inequality_kinematics,
    inequality_rhs,
    keep_inequalities,
    move_inequalities,
    products,
    products_ahead,
    recover_inequalities,
    start_inequalities,
)
from sim.joints import joint_blocks, joint_impulses
from sim.kinematics import velocity_columns
from sim.model import Model, Vector, Work
from solvers.jit import kernel
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NO_PROGRESS = int(Status.NO_PROGRESS)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)


class Options(NamedTuple):
    """Settings of a step."""

    h: float  # time step [s]
    kappa: float  # central-path parameter [N s m]
    tolerance: float  # largest residual [N s, m, m/s], times the scale of the momenta
    max_iterations: int


class Outcome(NamedTuple):
    """How a step ended."""

    status: int
    iterations: int
    residual: float  # largest equality residual
    violation: float  # largest |product - kappa| of complementary pairs


@kernel
def residual_scale(work: Work) -> float:
    """1 + largest incoming momentum: rounding grows with it, and so does the tolerance."""
    s = 1.0
    for i in range(work.momentum_in.shape[0]):
        for k in range(6):
            s = max(s, 1.0 + abs(work.momentum_in[i, k]))
    return s


@kernel
def evaluate(model: Model, work: Work, h: float, q: Vector, v: Vector, u: Vector) -> bool:
    """Configuration 3 and balances of the bodies at work.nu; False outside the domain."""
    inside = momentum_balance(model, work, h, q)
    inequality_kinematics(model, work, h)
    return inside


@kernel
def residuals(model: Model, work: Work, h: float, q: Vector, v: Vector, u: Vector) -> tuple[float, float]:
    """Largest generalized residual and largest equality residual of the cones."""
    for i in range(work.balance.shape[0]):
        for k in range(6):
            work.wrench[i, k] = work.balance[i, k]
    e = apply_inequalities(model, work)
    subtree_sums(model, work.wrench, work.subtree)
    project(model, work.S2, work.subtree, work.residual)
    joint_impulses(model, work, h, q, v, u)
    apply_limits(model, work)
    r = 0.0
    for d in range(work.residual.shape[0]):
        r = max(r, abs(work.residual[d]))
    return r, e


@kernel
def interior_point(model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector, par: Vector) -> Outcome:
    h = options.h
    kappa = options.kappa
    tolerance = options.tolerance
    spread = kappa * min(1e-2, 1e6 * tolerance)
    scale = residual_scale(work)
    nv = v.shape[0]
    degree = 0.0
    for d in range(nv):
        work.nu_trial[d] = v[d]
        work.dnu[d] = 0.0
    alpha = 0.0
    iterations = 0
    backtracks = 0
    r0 = 0.0
    c0 = 0.0
    status = _MAX_ITERATIONS
    r = 0.0
    violation = 0.0
    while True:
        for d in range(nv):
            work.nu[d] = work.nu_trial[d] + alpha * work.dnu[d]
        inside = evaluate(model, work, h, q, v, u)
        if iterations == 0:
            if not inside:
                for d in range(nv):
                    work.nu_trial[d] *= 0.7
                backtracks += 1
                if backtracks > 30:
                    status = _ANGULAR_STEP
                    break
                continue
            k0 = max(kappa, par[0])
            start_inequalities(model, work, k0, par[1] * k0**0.5)
        else:
            move_inequalities(model, work, alpha)
        rd, re = residuals(model, work, h, q, v, u)
        r = max(rd / scale, re)
        mean, low, high = products(model, work)
        violation = max(high - kappa, kappa - low)
        if iterations > 0 and not (inside and ((r <= r0 or violation <= c0))):
            backtracks += 1
            if backtracks < 12:
                alpha *= 0.5
                continue
        backtracks = 0
        if r < tolerance and violation < spread:
            status = _SOLVED
            break
        if iterations >= options.max_iterations:
            break
        r0 = r
        c0 = violation
        iterations += 1
        velocity_columns(model, work.S3, work.nu, h, work.S3nu)
        momentum_balance_jacobian(model, work, h, work.A)
        joint_blocks(model, work, h, q, v)
        condense_inequalities(model, work, h)
        if not factor(model, work):
            status = _SINGULAR
            break
        target = kappa
        for phase in range(2):
            for d in range(nv):
                work.dnu[d] = -work.residual[d]
            inequality_rhs(model, work, target, phase == 1)
            solve(model, work, work.dnu, work.dnu)
            recover_inequalities(model, work, h)
            alpha = boundary_step(model, work)
            if phase == 0:
                a = min(1.0, 0.95 * alpha)
                total = products_ahead(model, work, 0.0)
                ahead = products_ahead(model, work, a)
                sigma = min(max(ahead / total, 0.0), 1.0) ** 3
                target = max(kappa, sigma * mean)
                if par[2] > 0.0:
                    target = max(target, min(par[2] * r, mean))
        tau = 0.95 if max(r, violation) > 1e-3 else 0.99
        alpha = min(1.0, tau * alpha)
        for d in range(nv):
            work.nu_trial[d] = work.nu[d]
        keep_inequalities(model, work)
        if not (alpha > 1e-12):
            status = _NO_PROGRESS
            break
    return Outcome(status, iterations, r, violation)
