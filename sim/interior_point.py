"""The interior point of a step: contacts and limits on the central path of kappa, joint velocities by Newton's method."""

from __future__ import annotations

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
    slip_error,
    start_inequalities,
)
from sim.joints import joint_blocks, joint_impulses
from sim.kinematics import velocity_columns
from sim.model import Model, Options, Outcome, Vector, Work
from sim.newton import norm, residual_scale
from solvers.jit import kernel
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NO_PROGRESS = int(Status.NO_PROGRESS)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)


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
    return norm(work.residual), e


@kernel
def interior_point(model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector) -> Outcome:
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
            k0 = max(kappa, 0.01)
            floor = 0.1 * k0**0.5
            for c in range(model.contact_body.shape[0]):
                depth = -work.contact_kin[c, 0]
                if depth > 0.0:
                    k0 = max(k0, 0.3 * model.body_mass[model.contact_body[c]] * depth * depth / h)
                    floor = max(floor, 0.5 * depth)
            for c in range(model.limit_dof.shape[0]):
                depth = -work.bound_gap[c]
                if depth > 0.0:
                    k0 = max(k0, 0.01 * depth * depth / h)
                    floor = max(floor, 0.5 * depth)
            start_inequalities(model, work, k0, floor)
        else:
            move_inequalities(model, work, alpha)
            for c in range(model.contact_body.shape[0]):
                z = work.cone[c]
                if model.contact_friction[c] > 0 and model.contact_law[c] == 2:
                    b0 = model.contact_friction[c] * z[1]
                    n = (z[2] * z[2] + z[3] * z[3]) ** 0.5
                    if n > b0:
                        z[2] *= b0 / n
                        z[3] *= b0 / n
        rd, re = residuals(model, work, h, q, v, u)
        r = max(rd / scale, re)
        mean, low, high = products(model, work)
        center = max(kappa, mean)
        slip = slip_error(model, work, kappa)
        violation = max(high - kappa, kappa - low, slip)
        if iterations > 0 and not (inside and (r <= max(r0, tolerance) or (violation <= c0 and r < 2.0 * r0 and c0 > kappa))):
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
        condense_inequalities(model, work, h, center)
        if not factor(model, work):
            status = _SINGULAR
            break
        target = kappa
        affine = 1.0
        reduce = 1.0
        for phase in range(4):
            if phase >= 2:
                if alpha > 0.1:
                    break
                reduce = 0.5 if phase == 2 else 0.1
                target = max(kappa, (1.0 - reduce) * mean)
            for d in range(nv):
                work.dnu[d] = -reduce * work.residual[d]
            inequality_rhs(model, work, target, phase == 1 and affine > 0.0, reduce)
            solve(model, work, work.dnu, work.dnu)
            recover_inequalities(model, work, h, reduce)
            alpha = boundary_step(model, work)
            if phase == 0:
                a = min(1.0, 0.95 * alpha)
                affine = a
                total = products_ahead(model, work, 0.0)
                ahead = products_ahead(model, work, a)
                sigma = min(max(ahead / total, 0.0), 1.0) ** 3
                target = max(kappa, sigma * mean)
        tau = 0.95 if max(r, violation) > 1e-3 else 0.99
        alpha = min(1.0, tau * alpha)
        for d in range(nv):
            work.nu_trial[d] = work.nu[d]
        keep_inequalities(model, work)
        if not (alpha > 1e-12):
            status = _NO_PROGRESS
            break
    return Outcome(status, iterations, r, violation)
