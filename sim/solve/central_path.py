"""Where the interior point starts: velocities, gaps and impulses on the central path."""

from __future__ import annotations

from typing import NamedTuple

from sim.model import Model, Vector
from sim.options import Guess, Options
from sim.solve.inequalities import (
    keep_inequalities,
    move_inequalities,
    resume_inequalities,
    start_inequalities,
    total_impulse,
)
from sim.solve.line_search import largest_turn
from sim.solve.merit import residuals
from sim.solve.placing import NOWHERE, place
from sim.solve.prediction import predict, predictable
from sim.work import Work
from solvers.compiler import inlined, kernel

_AT_REST = 0.1  # the residual at kappa, over that of the usual start, of a motion that may start at kappa
_RESUMED = 3e-4  # [N s m] least kappa of a start near the impulses of the step before
_BALANCED = 0.3  # the residual at kappa, over that of such a start, of a motion that may start at kappa
_GOES_ON = 0.1  # the residual with the impulses of the step before, over their sum, where they are kept
_GROWTH = 3.0  # of the starting kappa, per attempt; it begins again after
_GROWTHS = 8  # attempts
_GOLDEN = 0.6180339887498949
AGAIN = -1  # instead of the number of an attempt
_BEYOND = 2.0  # [rad] from a fold to a start on its other side


class Beginning(NamedTuple):
    """Where the first attempt begins."""

    attempt: int
    kappa: float  # of the central path on which attempt 0 starts
    balance: tuple[float, float]  # residuals there


@kernel
def begin(model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], guess: Guess) -> Beginning:
    """Attempt 0, whose iterate it leaves, where anything is known of the solution; attempt 1 elsewhere.

    Where the impulses of the step before are known, as predicted from them (`go_on`), or near them (`resume`);
    otherwise with those of the gaps, kappa / gap, where the guess all but balances with them.
    """
    q, v, u = inputs
    h = options.h
    kappa = options.kappa
    if work.counts[2] + model.limit_dof.shape[0] == 0:  # nothing to be on the central path of
        if place(model, work, h, q, guess.velocity, 1.0):
            return Beginning(0, kappa, residuals(model, work, h, q, v, u))
        return Beginning(1, kappa, NOWHERE)
    keep_inequalities(model, work)
    if guess.impulses and work.counts[2] == work.counts[0]:  # pairs of points may be others than in the step before
        if predictable(model, work):
            beginning = go_on(model, work, options, inputs, guess.velocity)
            if beginning.attempt == 0:
                return beginning
        return resume(model, work, options, inputs, guess.velocity)
    if not place(model, work, h, q, v, 1.0):
        return Beginning(1, kappa, NOWHERE)
    start_inequalities(model, work, h, kappa, 1.0)
    usual, _ = residuals(model, work, h, q, v, u)
    placed = True  # most guess the incoming velocity: there already
    for d in range(v.shape[0]):
        placed = placed and guess.velocity[d] == v[d]
    if not placed and not place(model, work, h, q, guess.velocity, 1.0):
        return Beginning(1, kappa, NOWHERE)
    start_inequalities(model, work, h, kappa, 0.0)
    hard = residuals(model, work, h, q, v, u)
    return Beginning(0 if hard[0] < _AT_REST * usual else 1, kappa, hard)


@inlined
def go_on(
    model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> Beginning:
    """Attempt 0 at kappa: with the impulses of the step before where they all but balance, otherwise as predicted.

    Attempt 1 where that fails.
    """
    q, v, u = inputs
    if not place(model, work, options.h, q, velocity, 1.0):
        return Beginning(1, options.kappa, NOWHERE)
    move_inequalities(model, work, 0.0)
    balance = residuals(model, work, options.h, q, v, u)
    if balance[0] > _GOES_ON * total_impulse(model, work):
        balance = predict(model, work, options, inputs)
    return Beginning(0 if balance[0] < 1e300 else 1, options.kappa, balance)


@inlined
def resume(
    model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], velocity: Vector
) -> Beginning:
    """Attempt 0 with the impulses of the step before: the gap of a pressing contact changes much, its impulse does not.

    At kappa itself where they all but balance; otherwise near them and the gaps, on the path of a larger kappa.
    """
    q, v, u = inputs
    h = options.h
    if not place(model, work, h, q, velocity, 1.0):
        return Beginning(1, options.kappa, NOWHERE)
    kappa = max(options.kappa, _RESUMED)
    resume_inequalities(model, work, h, kappa, False)
    away, _ = residuals(model, work, h, q, v, u)
    move_inequalities(model, work, 0.0)
    last = residuals(model, work, h, q, v, u)
    if last[0] < _BALANCED * away:
        return Beginning(0, options.kappa, last)
    resume_inequalities(model, work, h, kappa, False)
    return Beginning(0, kappa, residuals(model, work, h, q, v, u))


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
