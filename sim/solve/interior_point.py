"""The interior point of a step: Newton's method on the joint velocities, contacts and limits held on the central path.

Eight things decide (60,000 random extreme states, `benchmarks/robustness.py`, seeds 0 to 2):

* The friction cone is no variable of the interior point. On the central path it is a smooth law of the slip, solved for
  beta by Newton, at a `smoothing` that follows down to kappa (contacts/friction.py); only gaps and normal impulses have
  to stay positive. Conic scalings jam on thin cones.
* The start is on the central path of a kappa0 fit for the predicted overlap. Only a motion that all but balances with
  the impulses of kappa itself, a robot at rest or a good guess, starts there; and one that goes on, at what the step
  linearised there predicts (prediction.py).
* The boundary of the cones stops no step: pairs that would leave return to the central path (line_search.py).
* No body turns by more than .7 rad per iteration, beyond which a gap is not what its Jacobian says.
* Where the path has folded, friction bounds and arms of impulses count as constant, half or more (direction.py).
* Which faces, edges and corners of two shapes touch is chosen where an attempt starts; a solution at which others
  overlap is none (pairs/choice.py).
* Nor is one that gains energy (energy_balance.py): impulses and large turns can wind one another up.
* An attempt that ends in a fold all the same is given up, and the next starts elsewhere: a share of the incoming
  velocity, or beyond the fold; at another kappa0. Some solutions lie beyond folds (legs that jam between a joint limit
  and the ground), and without a part of the friction Newton's method only creeps towards them: late attempts, two of
  four, take its direction as it is. From a share of the velocity their friction follows the impulses as at first: at
  a kappa0 of 1 N s m and more, that finds hard impacts more often than friction led down step by step.
"""

from __future__ import annotations

from sim import late
from sim.contacts.far import came_near, choose_far, sunk_contact
from sim.contacts.friction import slip_noise
from sim.energy_balance import step_gained
from sim.late import begin_pairs, find_impacts, impacts_gained, overlapping, pairs_gained
from sim.model import Model, Vector
from sim.options import (
    ASTRAY,
    AT_EVERY_POSE,
    AT_START,
    BESIDE_KEPT,
    FAILED,
    OVERLAPPING,
    PLACED,
    WOUND_UP,
    Guess,
    Options,
    Outcome,
)
from sim.solve.central_path import AGAIN, Beginning, begin, start
from sim.solve.complementarity import products, slip_error
from sim.solve.direction import direction, linearize_step
from sim.solve.line_search import search
from sim.solve.merit import Merit, follow, is_near, judge, residuals
from sim.solve.residual import absorb_residual, residual_scale, rounding
from sim.work import Work
from solvers.compiler import inlined, kernel
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NO_PROGRESS = int(Status.NO_PROGRESS)
_SINGULAR = int(Status.SINGULAR)
_COLLISION_STEP = int(Status.COLLISION_STEP)
_ENERGY_STEP = int(Status.ENERGY_STEP)
_CONTACT_SUNK = int(Status.CONTACT_SUNK)

_ROUNDING = 2e-14  # [N s m] of the products: slips come from differences of positions over a time step
# first attempt whose friction smoothing is led down step by step; before, and late in all from a share of the velocity,
# it follows the normal impulses
_LED = 2
_WORSE, _WORSE_LED = 10.0, 2.0  # times the residual before: what smaller violations may cost, and where friction is led
_ATTEMPTS = 60
_PATIENCE = 30  # iterations of an attempt
_CHOICES = 3  # repetitions of an attempt, with other elements of the shapes in contact
_REPLACED = 2  # last attempt whose first repetition has the new elements only; later ones have those that pressed, too
_LENIENT = 4  # first attempt at whose end shapes may overlap a little, in elements that would have to pull
_AS_IT_IS = 8  # first attempt that takes Newton's direction as it is, at folds too
_FEW = 4  # halvings; an attempt that needs more is given up


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
    model: Model,
    work: Work,
    options: Options,
    inputs: tuple[Vector, Vector, Vector],
    attempt: int,
    iterations: int,
    beginning: Beginning,
) -> Outcome:
    """One attempt; NO_PROGRESS when it is given up.

    inputs: (q, v, u);  iterations: those of the attempts before;  beginning: where attempt 0 starts.
    """
    q, v, u = inputs
    h = options.h
    kappa = options.kappa
    spread = max(kappa * min(1e-3, 1e5 * options.tolerance), _ROUNDING)
    scale = max(residual_scale(work), rounding(model, work, h) / options.tolerance)
    led = attempt >= _LED and (attempt < _AS_IT_IS or attempt % 2 == 1)
    worse = _WORSE_LED if led else _WORSE
    smoothing = beginning.kappa
    balance = beginning.balance
    if attempt != 0:
        smoothing = start(model, work, options, q, v, attempt)
        balance = residuals(model, work, h, q, v, u)
    ratio = 1e-2
    beyond = attempt >= _AS_IT_IS and attempt % 4 < 2
    patience = iterations + _PATIENCE
    halvings = 0
    merit = judge(model, work, kappa, scale, max(smoothing, kappa), balance)
    while smoothing > 0.0 and merit.residual < 1e300:
        slip = merit.slip
        if not led:
            if merit.mean < smoothing and smoothing > kappa:
                smoothing = max(kappa, merit.mean)
                slip = slip_error(model, work, smoothing)
            smoothing, slip, ratio = follow(model, work, kappa, smoothing, ratio, slip)
        else:
            before = smoothing
            smoothing, slip, ratio = follow(model, work, max(kappa, 0.1 * merit.mean), smoothing, ratio, slip)
            if smoothing < before:
                patience = max(patience, iterations + _PATIENCE // 2)
        merit = Merit(merit.residual, max(merit.violation, slip), slip, merit.mean)
        solved = merit.residual < options.tolerance and smoothing <= kappa
        # a guess within the tolerance gets one step too: the error is squared
        if solved and iterations > 0 and on_path(model, work, h, kappa, spread, merit.violation):
            return Outcome(_SOLVED, iterations, merit.residual, merit.violation)
        if iterations >= options.max_iterations:
            return Outcome(_MAX_ITERATIONS, iterations, merit.residual, merit.violation)
        if iterations >= patience or halvings > _FEW:
            break
        iterations += 1
        if not linearize_step(model, work, h, q, v, smoothing, is_near(merit, kappa), beyond):
            return Outcome(_SINGULAR, iterations, merit.residual, merit.violation)
        boundary = direction(model, work, h, kappa, merit.mean)
        merit, halvings = search(model, work, options, inputs, scale, smoothing, boundary, merit, worse)
    return Outcome(_NO_PROGRESS, iterations, merit.residual, merit.violation)


@inlined
def misplacement(
    model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], out: Outcome
) -> int:
    """What a solution says of the elements chosen, as `overlapping`; ASTRAY also where collisions gave energy, WOUND_UP
    where the step gained some.   inputs: (q, v, u).
    """
    if out.status != _SOLVED:
        return PLACED
    found = overlapping(model, work)
    if found == PLACED and pairs_gained(model, work, options, inputs[1]):
        return ASTRAY
    if found == PLACED and step_gained(model, work, options, inputs):
        return WOUND_UP
    return found


@late.interior_point.defined(otherwise=FAILED)
def interior_point(
    model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector, guess: Guess
) -> Outcome:
    """Solve the step for v25 with all complementarity products at kappa; the guess may be far off.

    Leaves configuration 3, cone variables and residual wrenches (work.wrench, work.subtree) at the solution.
    """
    out = Outcome(_NO_PROGRESS, 0, 1e300, 1e300)
    if sunk_contact(model) >= 0:
        return Outcome(_CONTACT_SUNK, 1, 1e300, 0.0)
    work.pair_free[1] = 0  # `find_impacts` chooses elements, too
    begin_pairs(model, work, options)
    choose_far(model, work, options)
    find_impacts(model, work, options.h)
    while True:
        work.pair_free[0] = AT_START
        work.pair_free[1] = 0
        beginning = begin(model, work, options, (q, v, u), guess)
        wound_up = False
        for attempt in range(beginning.attempt, _ATTEMPTS):
            if wound_up and attempt % 2 == 1:  # beyond folds there are more such solutions
                continue
            work.pair_free[1] = 1 if attempt >= _LENIENT else 0
            out = try_from(model, work, options, (q, v, u), attempt, out.iterations, beginning)
            misplaced = misplacement(model, work, options, (q, v, u), out)
            for choice in range(_CHOICES):
                if misplaced != OVERLAPPING or work.pair_free[0] == AT_EVERY_POSE:
                    break
                if choice > 0 or attempt > _REPLACED:
                    work.pair_free[0] = BESIDE_KEPT
                out = try_from(model, work, options, (q, v, u), AGAIN, out.iterations, beginning)
                misplaced = misplacement(model, work, options, (q, v, u), out)
            if misplaced == PLACED and (out.status == _SOLVED or out.status == _MAX_ITERATIONS):
                break
            why = _COLLISION_STEP if misplaced == OVERLAPPING or misplaced == ASTRAY else _NO_PROGRESS
            wound_up = wound_up or misplaced == WOUND_UP
            out = Outcome(why, out.iterations, out.residual, out.violation)
            work.pair_free[0] = AT_EVERY_POSE if (attempt + 1) // 2 % 2 == 1 else AT_START
        if wound_up and out.status != _SOLVED:
            out = Outcome(_ENERGY_STEP, out.iterations, out.residual, out.violation)
        if came_near(model, work):
            continue
        if out.status != _SOLVED or not impacts_gained(model, work, options.h):
            break
    if out.status == _SOLVED:
        absorb_residual(model, work)
    return out
