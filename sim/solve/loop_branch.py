"""The step of a scene with loops: its solution on the branch of the motion, also at singular poses.

Where loops are regular (branch_motion.py), they move on one branch, and the step is solved as any other. At a singular
pose branches meet (bifurcation.py): the motion continues along the one on which it arrived.
"""

from __future__ import annotations

from sim.dynamics.loops.branch_motion import (
    crosses_bifurcation,
    is_other_branch,
    loops_regular,
    predict_loops,
    recompute_bifurcation,
    stay_regular,
)
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import Guess, Outcome, StepOptions
from sim.model.slots import Slot
from sim.solve.solve_step import solve_step
from solvers.compiler import inlined, optional
from solvers.status import Status
from solvers.types import Vector

_LEADS = 2  # times that directions of loops are found anew


@inlined
def _after(r: Outcome, last: Outcome) -> Outcome:
    """The last of several solves, with the iterations of all."""
    return Outcome(last.status, r.iterations + last.iterations, last.residual, last.violation)


@optional(Slot.SOLVE_LOOPS)
def solve_loops(
    model: Model, data: Data, options: StepOptions, q: Vector, v: Vector, u: Vector, guess: Guess
) -> Outcome:
    """`solve_step` on the branch of the loops' motion."""
    r = Outcome(Status.SOLVED.value, 0, 0.0, 0.0)
    if loops_regular(model, data):
        r = _after(r, solve_step(model, data, options, q, v, u, guess))
        if stay_regular(model, data, r.status):
            return r
        guess = Guess(guess.velocity, guess.impulses and r.status == Status.SOLVED)
    if predict_loops(model, data, options.h, q, v, guess.velocity):
        guess = Guess(data.loop_velocity, guess.impulses)
    r = _after(r, solve_step(model, data, options, q, v, u, guess))
    if r.status == Status.SOLVED and crosses_bifurcation(model, data):
        r = _after(r, solve_step(model, data, options, q, v, u, Guess(data.loop_start, guess.impulses)))
        if is_other_branch(model, data, r.status):
            r = _after(r, solve_step(model, data, options, q, v, u, Guess(data.loop_start, guess.impulses)))
    for _ in range(_LEADS):
        if r.status != Status.SOLVED or not recompute_bifurcation(model, data, options.h, q):
            break
        r = _after(r, solve_step(model, data, options, q, v, u, Guess(data.loop_velocity, guess.impulses)))
    return r
