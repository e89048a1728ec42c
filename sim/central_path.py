"""Where the interior point starts: velocities, gaps and impulses on the central path."""

from __future__ import annotations

from sim.dynamics import momentum_balance
from sim.elimination import project, subtree_sums
from sim.inequalities import (
    apply_inequalities,
    apply_limits,
    inequality_kinematics,
    keep_inequalities,
    move_inequalities,
    start_inequalities,
)
from sim.joints import joint_impulses
from sim.loops import apply_loops
from sim.model import Guess, Model, Options, Vector, Work
from sim.newton import norm
from solvers.jit import inlined, kernel

_AT_REST = 0.1  # the residual at kappa, over that of the usual start, of a motion that may start at kappa
_GROWTH = 3.0  # of the starting kappa, per attempt; it begins again after
_GROWTHS = 8  # attempts
_GOLDEN = 0.6180339887498949


@kernel
def residuals(model: Model, work: Work, h: float, q: Vector, v: Vector, u: Vector) -> tuple[float, float]:
    """Largest generalized residual, and largest |gap - slack|; fills residual, wrench, subtree."""
    for i in range(work.balance.shape[0]):
        for k in range(6):
            work.wrench[i, k] = work.balance[i, k]
    e = max(apply_inequalities(model, work), apply_loops(model, work))
    subtree_sums(model, work.wrench, work.subtree)
    project(model, work.S2, work.subtree, work.residual)
    joint_impulses(model, work, h, q, v, u)
    apply_limits(model, work)
    return norm(work.residual), e


@kernel
def place(model: Model, work: Work, h: float, q: Vector, v: Vector, share: float) -> bool:
    """nu = share v, slowed down until no body turns by half a turn; False if that fails."""
    for _ in range(30):
        for d in range(v.shape[0]):
            work.nu[d] = share * v[d]
            work.nu_trial[d] = work.nu[d]
        if momentum_balance(model, work, h, q):
            inequality_kinematics(model, work, h)
            return True
        share *= 0.7
    return False


@kernel
def first_attempt(
    model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector], guess: Guess
) -> int:
    """0, the start at kappa itself, where the guess all but balances; 1 everywhere else.

    Its impulses are those of the gaps, kappa / gap, with which a step whose solution is known starts there; or those of
    the step before where they balance better: the gap of a pressing contact changes too much, its impulse does not.
    Leaves the iterate at the start of attempt 0.
    """
    q, v, u = inputs
    if work.counts[2] + model.limit_dof.shape[0] == 0:  # nothing to be on the central path of
        return 0 if place(model, work, options.h, q, guess.velocity, 1.0) else 1
    keep_inequalities(model, work)
    if not place(model, work, options.h, q, v, 1.0):
        return 1
    start_inequalities(model, work, options.h, options.kappa, 1.0)
    soft, _ = residuals(model, work, options.h, q, v, u)
    placed = True  # a rollout guesses the incoming velocity: there already
    for d in range(v.shape[0]):
        placed = placed and guess.velocity[d] == v[d]
    if not placed and not place(model, work, options.h, q, guess.velocity, 1.0):
        return 1
    start_inequalities(model, work, options.h, options.kappa, 0.0)
    hard, _ = residuals(model, work, options.h, q, v, u)
    if guess.impulses:
        move_inequalities(model, work, 0.0)
        last, _ = residuals(model, work, options.h, q, v, u)
        if last < min(hard, soft):
            return 0
        start_inequalities(model, work, options.h, options.kappa, 0.0)
    return 0 if hard < _AT_REST * soft else 1


@inlined
def start(model: Model, work: Work, options: Options, q: Vector, v: Vector, attempt: int) -> float:
    """Start on the central path: attempt 0 at kappa itself (see above), 1 at the usual kappa0, then at others.

    nu is the incoming velocity at first, from attempt 2 on a share of it: 1/2 and on by the golden ratio, modulo 1.
    Returns the kappa of the start, 0 if there is none.
    """
    if attempt == 0:
        return options.kappa
    share = 1.0 if attempt < 2 else (0.5 + _GOLDEN * (attempt - 2)) % 1.0
    if not place(model, work, options.h, q, v, share):
        return 0.0
    return start_inequalities(model, work, options.h, options.kappa, _GROWTH ** ((attempt - 1) % _GROWTHS))
