"""The interior point of a step: Newton's method on the joint velocities, contacts and limits held on the central path.

Three things decide (20,000 random extreme states, `benchmarks/robustness.py`):

* The friction cone is no variable of the interior point. On the central path it is a smooth law of the slip, solved for
  beta by Newton, at a `smoothing` that follows down to kappa (friction.py); only gaps and normal impulses have to stay
  positive. Conic scalings jam on thin cones.
* The start is on the central path: of kappa itself where that balances, else of a kappa0 fit for the predicted overlap.
* When the boundary or the line search allow only a short step, or nothing has converged for a while, the method does
  not creep: it starts again on the central path, at a larger kappa, from rest, half the incoming velocity, or all of
  it.
"""

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
from sim.model import Goal, Model, Options, Outcome, Vector, Work
from sim.newton import norm, residual_scale
from solvers.jit import kernel
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)

_ROUNDING = 2e-14  # [N s m] of the products: slips come from differences of positions over a time step
_SHORT = 0.1  # a step below this share of the Newton step is short
_RESTART_GROWTH = 3.0  # of the starting kappa, per restart
_HURRY = 12  # iterations of the first attempt, whose friction follows the normal impulses
_PATIENCE = 30  # iterations of the others, whose friction is led down to kappa step by step
_HALVINGS = 12  # of the line search, then the step is taken as it is and counts as short


@kernel
def residuals(model: Model, work: Work, h: float, q: Vector, v: Vector, u: Vector) -> tuple[float, float]:
    """Largest generalized residual, and largest |gap - slack|; fills residual, wrench, subtree."""
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
def linearize_step(model: Model, work: Work, h: float, q: Vector, v: Vector, smoothing: float) -> bool:
    """Newton matrix at the present iterate, contacts and limits condensed, eliminated; False if it is singular."""
    velocity_columns(model, work.S3, work.nu, h, work.S3nu)
    momentum_balance_jacobian(model, work, h, work.A)
    joint_blocks(model, work, h, q, v)
    condense_inequalities(model, work, h, smoothing)
    return factor(model, work)


@kernel
def direction(model: Model, work: Work, h: float, kappa: float, mean: float) -> float:
    """Newton step dnu and the steps of all cones; returns the step to their boundary.

    predictor     full residual, products to kappa                      -> sigma = (mean ahead / mean)^3
    corrector     full residual, products to max(kappa, sigma mean), second-order term        (Mehrotra 1992);
                  left out where the predictor already lands on kappa
    if short      half the residual, products to half the mean; then a tenth, to nine tenths
    """
    sigma = 0.0
    share = 1.0
    alpha = 0.0
    for phase in range(4):
        if phase >= 2:
            if alpha > _SHORT:
                break
            share = 0.5 if phase == 2 else 0.1
            sigma = 1.0 - share
        goal = Goal(max(kappa, sigma * mean), share, phase == 1)
        for d in range(work.dnu.shape[0]):
            work.dnu[d] = -share * work.residual[d]
        inequality_rhs(model, work, goal)
        solve(model, work, work.dnu, work.dnu)
        recover_inequalities(model, work, h, share)
        alpha = boundary_step(model, work)
        if phase == 0:
            ahead = products_ahead(model, work, min(1.0, 0.95 * alpha))
            if alpha > 1.06 and abs(ahead - kappa) < 0.1 * kappa:
                break
            sigma = min(max(ahead / mean, 0.0), 1.0) ** 3
    return alpha


@kernel
def follow(model: Model, work: Work, kappa: float, smoothing: float) -> tuple[float, float]:
    """The smoothing brought down towards kappa as far as the friction law holds on the way, and its violation there."""
    slip = slip_error(model, work, smoothing)
    while smoothing > kappa and slip < 0.3 * smoothing:
        smoothing = max(kappa, 0.1 * smoothing)
        slip = slip_error(model, work, smoothing)
    return smoothing, slip


@kernel
def place(model: Model, work: Work, h: float, q: Vector, v: Vector, share: float) -> bool:
    """nu = share v, slowed down until no body turns by half a turn; False if that fails."""
    for _ in range(30):
        for d in range(v.shape[0]):
            work.nu[d] = share * v[d]
            work.nu_trial[d] = work.nu[d]
        if momentum_balance(model, work, h, q):
            return True
        share *= 0.7
    return False


@kernel
def balances_at_kappa(model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector) -> bool:
    """Whether the incoming motion balances better with the impulses of kappa itself than with those of a larger start.

    The gap of a resting contact encodes its impulse, kappa / gap: a robot that stands still starts at its solution.
    """
    start_inequalities(model, work, options.h, options.kappa, 0.0)
    hard, _ = residuals(model, work, options.h, q, v, u)
    start_inequalities(model, work, options.h, options.kappa, 1.0)
    soft, _ = residuals(model, work, options.h, q, v, u)
    return hard < soft


@kernel
def start(model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector, attempt: int) -> float:
    """Start on the central path: attempt 0 at kappa itself or the usual kappa0, 1 the usual one, then ever larger ones.

    nu is the incoming velocity at first; from attempt 2 on rest, half of it, all of it in turn.
    Returns the kappa of the start, 0 if there is none.
    """
    share = 1.0
    if attempt >= 2:
        share = 0.0 if attempt % 3 == 2 else (0.5 if attempt % 3 == 0 else 1.0)
    if not place(model, work, options.h, q, v, share):
        return 0.0
    inequality_kinematics(model, work, options.h)
    growth = _RESTART_GROWTH ** max(attempt - 1, 0)
    if attempt == 0 and balances_at_kappa(model, work, options, q, v, u):
        growth = 0.0
    return start_inequalities(model, work, options.h, options.kappa, growth)


@kernel
def interior_point(model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector) -> Outcome:
    """Solve the step for v25 with all complementarity products at kappa.

    Leaves configuration 3, cone variables and residual wrenches (work.wrench, work.subtree) at the solution.
    """
    h = options.h
    kappa = options.kappa
    spread = max(kappa * min(1e-3, 1e5 * options.tolerance), _ROUNDING)
    scale = residual_scale(work)
    status = _MAX_ITERATIONS
    iterations = 0
    attempt = 0
    patience = 0
    halvings = 0
    smoothing = kappa
    starting = True
    alpha = 1.0
    r = 1e300
    violation = 1e300
    last_r = 1e300
    last_violation = 1e300
    while True:
        if starting:
            smoothing = start(model, work, options, q, v, u, attempt)
            inside = smoothing > 0.0
            patience = iterations + (_PATIENCE if attempt > 0 else _HURRY)
            last_r = 1e300
            last_violation = 1e300
        else:
            for d in range(v.shape[0]):
                work.nu[d] = work.nu_trial[d] + alpha * work.dnu[d]
            inside = momentum_balance(model, work, h, q)
            inequality_kinematics(model, work, h)
            move_inequalities(model, work, alpha)
        rd, re = residuals(model, work, h, q, v, u)
        mean, violation = products(model, work, kappa)
        violation = max(violation, slip_error(model, work, smoothing))
        r = max(rd / scale, re)
        if not (r < 1e300 and violation < 1e300):
            inside = False
        better = r <= max(last_r, options.tolerance, 0.1 * mean**0.5)
        better = better or (violation <= last_violation and last_violation > kappa and r < 2.0 * last_r)
        if not starting and not (inside and better) and halvings < _HALVINGS:
            halvings += 1
            alpha *= 0.5
            continue
        if not inside:
            status = _NOT_FINITE
            break
        smoothing, slip = follow(model, work, kappa, smoothing if attempt > 0 else max(kappa, min(mean, smoothing)))
        violation = max(violation, slip)
        if r < options.tolerance and violation < spread and smoothing <= kappa:
            status = _SOLVED
            break
        if iterations >= options.max_iterations:
            break
        starting = False
        last_r = r
        last_violation = violation
        iterations += 1
        if not linearize_step(model, work, h, q, v, smoothing):
            status = _SINGULAR
            break
        alpha = direction(model, work, h, kappa, mean)
        if alpha < _SHORT or halvings > 3 or iterations >= patience:
            attempt += 1
            halvings = 0
            starting = True
            continue
        halvings = 0
        alpha = min(1.0, (0.95 if max(r, violation) > 1e-3 else 0.99) * alpha)
        for d in range(v.shape[0]):
            work.nu_trial[d] = work.nu[d]
        keep_inequalities(model, work)
    return Outcome(status, iterations, r, violation)
