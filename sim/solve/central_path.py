"""Where the interior point starts: velocities, gaps and impulses on the central path."""

from __future__ import annotations

from sim.dynamics import momentum_balance
from sim.late import choose_pairs
from sim.model import Model, Vector
from sim.moves import turn_bodies
from sim.options import Guess, Options
from sim.solve.inequalities import inequality_kinematics, keep_inequalities, move_inequalities, start_inequalities
from sim.solve.line_search import largest_turn
from sim.solve.merit import residuals
from sim.work import Work
from solvers.jit import inlined, kernel

_AT_REST = 0.1  # the residual at kappa, over that of the usual start, of a motion that may start at kappa
_GROWTH = 3.0  # of the starting kappa, per attempt; it begins again after
_GROWTHS = 8  # attempts
_GOLDEN = 0.6180339887498949
AGAIN = -1  # instead of the number of an attempt
_BEYOND = 2.0  # [rad] from a fold to a start on its other side


@kernel
def place(model: Model, work: Work, h: float, q: Vector, v: Vector, share: float) -> bool:
    """nu = share v, slowed down until no body turns by half a turn; False if that fails."""
    for _ in range(30):
        for d in range(v.shape[0]):
            work.nu[d] = share * v[d]
            work.nu_trial[d] = work.nu[d]
        if momentum_balance(model, work, h, q):
            turn_bodies(work, work.rot3)
            choose_pairs(model, work)
            inequality_kinematics(model, work, h)
            return True
        share *= 0.7
    return False


@kernel
def first_attempt(
    model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], guess: Guess
) -> tuple[int, tuple[float, float]]:
    """0, the start at kappa itself, where the guess all but balances; 1 everywhere else; and the residuals of 0.

    Its impulses are those of the gaps, kappa / gap, with which a step whose solution is known starts there; or those of
    the step before where they balance better: the gap of a pressing contact changes too much, its impulse does not.
    Leaves the iterate at the start of attempt 0.
    """
    q, v, u = inputs
    if work.counts[2] + model.limit_dof.shape[0] == 0:  # nothing to be on the central path of
        if place(model, work, options.h, q, guess.velocity, 1.0):
            return 0, residuals(model, work, options.h, q, v, u)
        return 1, (1e300, 1e300)
    keep_inequalities(model, work)
    if not place(model, work, options.h, q, v, 1.0):
        return 1, (1e300, 1e300)
    start_inequalities(model, work, options.h, options.kappa, 1.0)
    soft, _ = residuals(model, work, options.h, q, v, u)
    placed = True  # a rollout guesses the incoming velocity: there already
    for d in range(v.shape[0]):
        placed = placed and guess.velocity[d] == v[d]
    if not placed and not place(model, work, options.h, q, guess.velocity, 1.0):
        return 1, (1e300, 1e300)
    start_inequalities(model, work, options.h, options.kappa, 0.0)
    hard = residuals(model, work, options.h, q, v, u)
    first = 0 if hard[0] < _AT_REST * soft else 1
    if guess.impulses:
        move_inequalities(model, work, 0.0)
        last = residuals(model, work, options.h, q, v, u)
        if last[0] < min(hard[0], _AT_REST * soft):
            return 0, last
        if first == 0:
            start_inequalities(model, work, options.h, options.kappa, 0.0)
            hard = residuals(model, work, options.h, q, v, u)
    return first, hard


@inlined
def start(model: Model, work: Work, options: Options, q: Vector, v: Vector, attempt: int) -> float:
    """Start of attempt 1 on the central path of the usual kappa0, of the others at others; returns kappa0, or 0.

    nu is the incoming velocity at first, then by turns
        even    a share of it: none, and on by the golden ratio, modulo 1
        AGAIN   where the last attempt ended, which is no solution because shapes overlap there in other points
        odd     where the last attempt ended, and on along its Newton step, forward and backward by turns: attempts end
                at folds of the path, where the matrix is all but singular and its null vector leads to the other side
    """
    if attempt == AGAIN:
        for d in range(v.shape[0]):
            work.dnu[d] = work.nu[d]
        placed = place(model, work, options.h, q, work.dnu, 1.0)
    elif attempt > 1 and attempt % 2 == 1:
        far = min(_BEYOND / largest_turn(work), 100.0)
        if attempt % 4 == 3:
            far = -far
        for d in range(v.shape[0]):
            work.dnu[d] = work.nu[d] + far * work.dnu[d]
        placed = place(model, work, options.h, q, work.dnu, 1.0)
    else:
        share = 1.0 if attempt == 1 else _GOLDEN * (attempt - 2) % 1.0
        placed = place(model, work, options.h, q, v, share)
    if not placed:
        return 0.0
    growth = _GROWTH ** ((attempt - 1) % _GROWTHS) if attempt > 0 else 1.0
    return start_inequalities(model, work, options.h, options.kappa, growth)
