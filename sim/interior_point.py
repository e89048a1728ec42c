"""The interior point of a step: Newton's method on the joint velocities, contacts and limits held on the central path.

Four things decide (20,000 random extreme states, `benchmarks/robustness.py`):

* The friction cone is no variable of the interior point. On the central path it is a smooth law of the slip, solved for
  beta by Newton, at a `smoothing` that follows down to kappa (friction.py); only gaps and normal impulses have to stay
  positive. Conic scalings jam on thin cones.
* The start is on the central path of a kappa0 fit for the predicted overlap. Only a motion that all but balances with
  the impulses of kappa itself, a robot at rest or a good guess, starts there.
* An attempt whose steps become short, at the boundary or in the line search, is given up: creeping on costs more than
  starting again.
* The next attempt starts from another share of the incoming velocity and another kappa0. Shares are a golden-ratio
  sequence: starts that differ solve what no single better start did.
"""

from __future__ import annotations

from typing import NamedTuple

from sim.central_path import first_attempt, residuals, start
from sim.coupling import factor_coupling, solve_coupling
from sim.dynamics import momentum_balance, momentum_balance_jacobian
from sim.elimination import factor, solve
from sim.far import came_near, choose_far
from sim.friction import slip_noise
from sim.inequalities import (
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
)
from sim.joints import joint_blocks
from sim.kinematics import velocity_columns
from sim.model import Goal, Guess, Model, Options, Outcome, Vector, Work
from sim.newton import residual_scale, rounding
from solvers.jit import inlined, kernel
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NO_PROGRESS = int(Status.NO_PROGRESS)
_SINGULAR = int(Status.SINGULAR)

_ROUNDING = 2e-14  # [N s m] of the products: slips come from differences of positions over a time step
_SHORT = 0.1  # a step below this share of the Newton step is short
_LED = 2  # first attempt whose friction smoothing is led down step by step; before, it follows the normal impulses
_ATTEMPTS = 60
_PATIENCE = 30  # iterations of an attempt
_HALVINGS = 12  # of the line search
_FEW = 3  # halvings; an attempt that needs more is given up


class Merit(NamedTuple):
    """How far an iterate is from the solution; everything infinite where a body turns by half a turn."""

    residual: float  # largest equality residual, momenta relative to their scale
    violation: float  # largest |product - kappa|, or violation of the friction law at the present smoothing
    mean: float  # of the complementarity products


@inlined
def linearize_step(model: Model, work: Work, h: float, q: Vector, v: Vector, smoothing: float) -> bool:
    """Newton matrix at the present iterate, contacts and limits condensed, eliminated; False if it is singular."""
    velocity_columns(model, work.S3, work.nu, h, work.S3nu)
    momentum_balance_jacobian(model, work, h, work.A)
    joint_blocks(model, work, h, q, v)
    condense_inequalities(model, work, h, smoothing)
    return factor(model, work) and factor_coupling(model, work)


@inlined
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
        solve_coupling(model, work, share, work.dnu)
        recover_inequalities(model, work, h, share)
        alpha = boundary_step(model, work)
        if phase == 0:
            ahead = products_ahead(model, work, min(1.0, 0.95 * alpha))
            if alpha > 1.06 and abs(ahead - kappa) < 0.1 * kappa:
                break
            sigma = min(max(ahead / mean, 0.0), 1.0) ** 3
    return alpha


@kernel
def follow(model: Model, work: Work, least: float, smoothing: float, ratio: float) -> tuple[float, float, float]:
    """The smoothing brought down to `least` as far as the friction law holds on the way, and its violation there.

    ratio: of one smoothing to the next; it shrinks where Newton's method lands well within the law.
    """
    slip = slip_error(model, work, smoothing)
    if slip < 0.03 * smoothing:
        ratio = max(1e-4, ratio * ratio)
    elif slip > 0.3 * smoothing:
        ratio = min(1e-2, ratio**0.5)
    while smoothing > least and slip < 0.3 * smoothing:
        smoothing = max(least, ratio * smoothing)
        slip = slip_error(model, work, smoothing)
    return smoothing, slip, ratio


@kernel
def assess(
    model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector, scale: float, smoothing: float
) -> Merit:
    """Merit of the present iterate."""
    r, e = residuals(model, work, options.h, q, v, u)
    mean, violation = products(model, work, options.kappa)
    violation = max(violation, slip_error(model, work, smoothing))
    r = max(r / scale, e)
    if r < 1e300 and violation < 1e300:
        return Merit(r, violation, mean)
    return Merit(1e301, 1e301, 1e301)


@inlined
def search(
    model: Model,
    work: Work,
    options: Options,
    inputs: tuple[Vector, Vector, Vector],
    scale: float,
    smoothing: float,
    alpha: float,
    last: Merit,
) -> tuple[Merit, int]:
    """Merit after the step alpha along the Newton direction, halved until it is better than `last`; and the halvings.

    Better is a smaller residual, or one within the noise of the products that it belongs to; or smaller violations at
    a residual that did not double.
    """
    q, v, u = inputs
    for d in range(v.shape[0]):
        work.nu_trial[d] = work.nu[d]
    keep_inequalities(model, work)
    now = last
    for halvings in range(_HALVINGS + 1):
        for d in range(v.shape[0]):
            work.nu[d] = work.nu_trial[d] + alpha * work.dnu[d]
        inside = momentum_balance(model, work, options.h, q)
        inequality_kinematics(model, work, options.h)
        move_inequalities(model, work, alpha)
        now = assess(model, work, options, q, v, u, scale, smoothing)
        if inside and now.residual <= max(last.residual, options.tolerance, 0.1 * now.mean**0.5):
            return now, halvings
        fits = now.violation <= last.violation and last.violation > options.kappa
        if inside and fits and now.residual < 2.0 * last.residual:
            return now, halvings
        alpha *= 0.5
    return now, _HALVINGS + 1


@inlined
def on_path(model: Model, work: Work, h: float, kappa: float, spread: float, violation: float) -> bool:
    """Whether products and friction laws hold to `spread`; friction laws to their rounding, where that is coarser."""
    if violation < spread:
        return True
    if not violation < spread + slip_noise(model, work, h):
        return False
    return products(model, work, kappa)[1] < spread


@kernel
def try_from(
    model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], attempt: int, iterations: int
) -> Outcome:
    """One attempt; NO_PROGRESS when it is given up.  inputs: (q, v, u);  iterations: those of the attempts before."""
    q, v, u = inputs
    h = options.h
    kappa = options.kappa
    spread = max(kappa * min(1e-3, 1e5 * options.tolerance), _ROUNDING)
    scale = max(residual_scale(work), rounding(model, work, h) / options.tolerance)
    smoothing = start(model, work, options, q, v, attempt)
    ratio = 1e-2
    patience = iterations + _PATIENCE
    halvings = 0
    merit = assess(model, work, options, q, v, u, scale, max(smoothing, kappa))
    while smoothing > 0.0 and merit.residual < 1e300:
        before = smoothing
        if attempt < _LED:
            smoothing = max(kappa, min(merit.mean, smoothing))
            smoothing, slip, ratio = follow(model, work, kappa, smoothing, ratio)
        else:
            smoothing, slip, ratio = follow(model, work, max(kappa, 0.1 * merit.mean), smoothing, ratio)
            if smoothing < before:
                patience = max(patience, iterations + _PATIENCE // 2)
        merit = Merit(merit.residual, max(merit.violation, slip), merit.mean)
        solved = merit.residual < options.tolerance and smoothing <= kappa
        # a guess within the tolerance gets one step too: the error is squared
        if solved and iterations > 0 and on_path(model, work, h, kappa, spread, merit.violation):
            return Outcome(_SOLVED, iterations, merit.residual, merit.violation)
        if iterations >= options.max_iterations:
            return Outcome(_MAX_ITERATIONS, iterations, merit.residual, merit.violation)
        if iterations >= patience or halvings > _FEW:
            break
        iterations += 1
        if not linearize_step(model, work, h, q, v, smoothing):
            return Outcome(_SINGULAR, iterations, merit.residual, merit.violation)
        alpha = direction(model, work, h, kappa, merit.mean)
        if alpha < _SHORT:
            break
        alpha = min(1.0, (0.99 if max(merit.residual, merit.violation) > 0.1 else 0.9999) * alpha)
        merit, halvings = search(model, work, options, inputs, scale, smoothing, alpha, merit)
    return Outcome(_NO_PROGRESS, iterations, merit.residual, merit.violation)


@inlined
def interior_point(
    model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector, guess: Guess
) -> Outcome:
    """Solve the step for v25 with all complementarity products at kappa; the guess may be far off.

    Leaves configuration 3, cone variables and residual wrenches (work.wrench, work.subtree) at the solution.
    """
    out = Outcome(_NO_PROGRESS, 0, 1e300, 1e300)
    choose_far(model, work, options)
    while True:
        for attempt in range(first_attempt(model, work, options, (q, v, u), guess), _ATTEMPTS):
            out = try_from(model, work, options, (q, v, u), attempt, out.iterations)
            if out.status == _SOLVED or out.status == _MAX_ITERATIONS:
                break
        if not came_near(model, work):
            return out
