"""The interior point of a step: Newton's method on the joint velocities, contacts and limits held on the central path.

Algorithm 1 of Howell et al. 2022 (Dojo), a primal-dual method with the predictor and corrector of Mehrotra:

    from a start on the central path of kappa0, until residual and products are within their tolerances:
        linearise and eliminate the equations, contacts and limits condensed              newton_direction.py
        find the Newton direction: predictor, corrector, centring                         newton_direction.py
        search along it, and put pairs that leave their cones back onto the path          step_length.py

The friction cone has no variable: it is a law of the slip at a `smoothing` that follows down to kappa. Differences from
the published method, and reasons: docs/theory/interior_point.md.
"""

from __future__ import annotations

from sim.contact.active_contacts import slip_error
from sim.contact.contact_law import slip_noise
from sim.contact.inactive import has_corners, sunk_contact
from sim.contact.pairs.active_features import overlapping
from sim.contact.pairs.pair_energy import pairs_gained
from sim.contact.restitution import find_impacts, impacts_gained
from sim.dynamics.joints.dry_friction import fit_dry
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FAILED, FeatureChoice, Guess, Outcome, StepOptions, Verdict
from sim.model.slots import Slot
from sim.solve.complementarity import products
from sim.solve.energy_balance import step_gained
from sim.solve.globalization import (
    ATTEMPTS,
    UNKNOWN,
    Start,
    Strategy,
    from_last_iterate,
    start_on_path,
    strategy,
)
from sim.solve.inequalities import choose_inequalities, inequalities_activated
from sim.solve.known_start import KnownStart, after_tentative, known_start
from sim.solve.merit import Merit, follow, is_near, judge, residuals
from sim.solve.newton_direction import direction, linearize_step
from sim.solve.residual import absorb_residual, residual_scale, rounding
from sim.solve.step_length import search
from solvers.compiler import inlined, kernel, optional
from solvers.status import Status
from solvers.types import Vector

_ROUNDING = 2e-14  # [N s m] of the products: slips come from differences of positions over a time step
# times the residual before: growth allowed for smaller violations, and during the continuation in friction
_WORSE, _WORSE_LED = 10.0, 2.0
_SMOOTHED = 1e3  # times kappa: smoothing of friction with which a known start is led
_PATIENCE = 30  # iterations of an attempt
_REPETITIONS = 3  # of an attempt, with other active features
_INSIDE = 0.9  # part of its first Newton step within the cones, from which on a tentative start is not given up
_FEW = 4  # halvings; an attempt that needs more is given up


@inlined
def on_path(model: Model, data: Data, h: float, kappa: float, spread: float, violation: float) -> bool:
    """Whether products and friction laws hold to `spread`; friction laws to their rounding, where that is coarser."""
    if violation < spread:
        return True
    if not violation < spread + slip_noise(model, data, h):
        return False
    return products(model, data, kappa)[1] < spread


@inlined
def lower_smoothing(
    model: Model, data: Data, kappa: float, continuation: bool, smoothing: float, ratio: float, merit: Merit
) -> tuple[float, float, Merit]:
    """The friction smoothing, its ratio, and the merit with the violation of the friction law at that smoothing.

    continuation: lead it down step by step, behind a tenth of the mean product; otherwise it follows the mean.
    """
    slip = merit.slip
    least = kappa
    if continuation:
        least = max(kappa, 0.1 * merit.mean)
    elif merit.mean < smoothing and smoothing > kappa:
        smoothing = max(kappa, merit.mean)
        slip = slip_error(model, data, smoothing)
    smoothing, slip, ratio = follow(model, data, least, smoothing, ratio, slip)
    return smoothing, ratio, Merit(merit.residual, max(merit.violation, slip), slip, merit.mean)


@kernel
def solve_from(
    model: Model,
    data: Data,
    options: StepOptions,
    inputs: tuple[Vector, Vector, Vector],
    s: Strategy,
    iterations: int,
    known: KnownStart,
) -> Outcome:
    """One attempt of a strategy; NO_PROGRESS when it is given up.

    inputs: (q, v, u);  iterations: those of the attempts before;  known: where the first strategy starts.
    """
    q, v, u = inputs
    h, kappa = options.h, options.kappa
    spread = max(kappa * min(1e-3, 1e5 * options.tolerance), _ROUNDING)
    scale = max(residual_scale(data), rounding(model, data, h) / options.tolerance)
    worse = _WORSE_LED if s.continuation else _WORSE
    smoothing, balance = known.kappa, known.balance
    if s.continuation:
        smoothing = max(smoothing, _SMOOTHED * kappa)
    if s.start != Start.KNOWN:
        smoothing = start_on_path(model, data, options, q, v, s)
        balance = residuals(model, data, h, q, v, u)
    ratio = 1e-2
    patience = iterations + _PATIENCE
    halvings = 0
    merit = judge(model, data, kappa, scale, max(smoothing, kappa), balance)
    while smoothing > 0.0 and merit.residual < 1e300:
        before = smoothing
        smoothing, ratio, merit = lower_smoothing(model, data, kappa, s.continuation, smoothing, ratio, merit)
        if s.continuation and smoothing < before:
            patience = max(patience, iterations + _PATIENCE // 2)
        share = known.share if iterations == 1 else 1.0
        solved = merit.residual < share * options.tolerance and smoothing <= kappa
        # a guess within the tolerance gets one step, too: Newton's method squares its error
        if solved and iterations > 0 and on_path(model, data, h, kappa, share**0.5 * spread, merit.violation):
            return Outcome(Status.SOLVED.value, iterations, merit.residual, merit.violation)
        if iterations >= options.max_iterations:
            return Outcome(Status.MAX_ITERATIONS.value, iterations, merit.residual, merit.violation)
        if iterations >= patience or halvings > _FEW:
            break
        iterations += 1
        if not linearize_step(model, data, h, q, v, smoothing, is_near(merit, kappa), s.undamped):
            return Outcome(Status.SINGULAR.value, iterations, merit.residual, merit.violation)
        boundary = direction(model, data, h, kappa, merit.mean)
        if known.tentative and boundary < _INSIDE and iterations == 1:
            break
        merit, halvings = search(model, data, options, inputs, (scale, smoothing), boundary, merit, worse)
    return Outcome(Status.NO_PROGRESS.value, iterations, merit.residual, merit.violation)


@inlined
def judge_solution(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector], out: Outcome
) -> int:
    """The Verdict on the outcome of an attempt; VALID if it is not a solution.   inputs: (q, v, u)."""
    if out.status != Status.SOLVED:
        return Verdict.VALID
    found = overlapping(model, data)
    if found == Verdict.VALID and pairs_gained(model, data, options, inputs[1]):
        return Verdict.TUNNELED
    if found == Verdict.VALID and step_gained(model, data, options, inputs):
        return Verdict.ENERGY_GAIN
    return found


@inlined
def attempt(
    model: Model,
    data: Data,
    options: StepOptions,
    inputs: tuple[Vector, Vector, Vector],
    s: Strategy,
    iterations: int,
    known: KnownStart,
) -> tuple[Outcome, int]:
    """One attempt of a strategy, repeated with other active features while shapes overlap: its outcome and Verdict."""
    out = solve_from(model, data, options, inputs, s, iterations, known)
    verdict = judge_solution(model, data, options, inputs, out)
    for repetition in range(_REPETITIONS):
        if verdict != Verdict.OVERLAPPING or data.feature_choice[0] == FeatureChoice.EVERY_POSE:
            break
        if repetition > 0 or not s.replace_features:
            data.feature_choice[0] = FeatureChoice.WITH_PREVIOUS
        out = solve_from(model, data, options, inputs, from_last_iterate(s), out.iterations, known)
        verdict = judge_solution(model, data, options, inputs, out)
    return out, verdict


@inlined
def solve_active(
    model: Model,
    data: Data,
    options: StepOptions,
    inputs: tuple[Vector, Vector, Vector],
    guess: Guess,
    out: Outcome,
) -> Outcome:
    """The step with the present active contacts: strategies in order, until one finds a valid solution.

    out: the previous outcome, whose iterations are added.
    """
    data.feature_choice[0] = FeatureChoice.ONCE
    data.overlap_allowed[0] = 0
    known = known_start(model, data, options, inputs, guess)
    # the motion before chose the active contacts: those that the start brings near take part now, not after a solve
    if known.found and model.pair_kind.shape[0] == 0 and inequalities_activated(model, data, options):
        known = known_start(model, data, options, inputs, guess)
    gained, corners = False, False
    for k in range(0 if known.found else UNKNOWN, ATTEMPTS):
        s = strategy(k)
        if gained and s.start != Start.FRACTION:  # other solutions beyond folds gain energy as well
            continue
        if s.on_corners:  # the last attempt has moved the iterate
            known = known_start(model, data, options, inputs, guess) if corners else known
            if not (corners and known.found):
                continue
        data.overlap_allowed[0] = 1 if s.overlap else 0
        while True:
            out, verdict = attempt(model, data, options, inputs, s, out.iterations, known)
            if not (known.tentative and out.status == Status.NO_PROGRESS and out.iterations == 1):
                break
            known = after_tentative(model, data, options, inputs, guess.velocity)
        corners = verdict == Verdict.VALID and out.status == Status.NO_PROGRESS and has_corners(model)
        if verdict == Verdict.VALID and (out.status == Status.SOLVED or out.status == Status.MAX_ITERATIONS):
            if out.status == Status.SOLVED:
                data.strategy_solves[k] += 1
            break
        refused = verdict == Verdict.OVERLAPPING or verdict == Verdict.TUNNELED
        why = Status.SHAPES_CROSSED.value if refused else Status.NO_PROGRESS.value
        out = Outcome(why, out.iterations, out.residual, out.violation)
        gained = gained or verdict == Verdict.ENERGY_GAIN
        # those of the next strategy in the list, also where it is skipped
        data.feature_choice[0] = strategy(min(k + 1, ATTEMPTS - 1)).features
    if gained and out.status != Status.SOLVED:
        return Outcome(Status.ENERGY_GAIN.value, out.iterations, out.residual, out.violation)
    return out


@optional(Slot.INTERIOR_POINT, default=FAILED)
def interior_point(
    model: Model, data: Data, options: StepOptions, q: Vector, v: Vector, u: Vector, guess: Guess
) -> Outcome:
    """Solve the step for v25 with all complementarity products at kappa; the guess may be far off.

    Leaves configuration 3, cone variables and residual wrenches (data.wrench, data.subtree) at the solution.
    """
    out = FAILED
    if sunk_contact(model) >= 0:
        return Outcome(Status.CONTACT_SUNK.value, 1, 1e300, 0.0)
    data.overlap_allowed[0] = 0  # `find_impacts` chooses features, too
    choose_inequalities(model, data, options)
    find_impacts(model, data, options.h)
    fit_dry(model, data, options.h, q, v, u)
    while True:
        out = solve_active(model, data, options, (q, v, u), guess, out)
        if inequalities_activated(model, data, options):
            continue
        if out.status != Status.SOLVED or not impacts_gained(model, data, options.h):
            break
    if out.status == Status.SOLVED:
        absorb_residual(model, data)
    return out
