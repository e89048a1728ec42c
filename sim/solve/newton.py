"""The step of a scene without contacts and limits: Newton's method on the momentum balance."""

from __future__ import annotations

from sim.dynamics.displacements import turn_bodies
from sim.dynamics.elimination import solve
from sim.dynamics.loops.closure import apply_loops, keep_loops, move_loops
from sim.dynamics.loops.coupling_system import factor_coupling, solve_coupling
from sim.dynamics.momentum_balance import momentum_balance
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FAILED, Guess, Outcome, StepOptions
from sim.model.record_columns import CoupleRank
from sim.model.slots import Slot
from sim.solve.newton_matrix import factor_free
from sim.solve.residual import absorb_residual, balance_to_wrench, norm, project_wrench, residual_scale, rounding
from solvers.compiler import inlined, kernel, optional
from solvers.status import Status
from solvers.types import Vector

_ROUNDED = 1e-10


@inlined
def evaluate(
    model: Model, data: Data, h: float, inputs: tuple[Vector, Vector, Vector], alpha: float
) -> tuple[bool, float, float]:
    """At nu = nu_trial + alpha dnu: whether it is inside the domain, the largest residual, and the largest gap."""
    q, v, u = inputs
    for d in range(v.shape[0]):
        data.nu[d] = data.nu_trial[d] + alpha * data.dnu[d]
    inside = momentum_balance(model, data, h, q)
    if model.loop_ntrans.shape[0] > 0:
        turn_bodies(data, data.rot3)
    balance_to_wrench(data)
    move_loops(model, data, alpha)
    gap = apply_loops(model, data)
    gap = max(gap, project_wrench(model, data, h, q, v, u))
    return inside, norm(data.residual), gap


@inlined
def newton_step(model: Model, data: Data, h: float, q: Vector, v: Vector) -> bool:
    """H dnu = -R at nu, which becomes nu_trial; False when H is singular."""
    if not factor_free(model, data, h, q, v) or not factor_coupling(model, data):
        return False
    for d in range(v.shape[0]):
        data.nu_trial[d] = data.nu[d]
        data.rhs[d] = -data.residual[d]
    solve(model, data, data.rhs, data.dnu)
    solve_coupling(model, data, 1.0, data.dnu)
    keep_loops(model, data)
    return True


@kernel
def closed_to(data: Data, options: StepOptions) -> float:
    """Tolerance of loop gaps: near a bifurcation of their motion, gaps grow slowly away from either branch.

    Least pivot: the product of the distances of configurations 2 and 3 from there.
    """
    return (
        options.tolerance * max(data.couple_rank[CoupleRank.PIVOT], _ROUNDED) ** 0.5
        if data.couple_rank[CoupleRank.SIZE] > 0.0
        else 1e300
    )


@optional(Slot.NEWTON, default=FAILED)
def newton(model: Model, data: Data, options: StepOptions, q: Vector, v: Vector, u: Vector, guess: Guess) -> Outcome:
    """Solve R(v25) = 0 from the guess of v25; halve steps that leave the domain or let the residual grow.

    Leaves configuration 3, the balances and the residual wrenches (data.wrench, data.subtree) at the solution.
    """
    h = options.h
    scale = residual_scale(data)
    floor = rounding(model, data, h) / scale
    keep_loops(model, data)
    for d in range(v.shape[0]):
        data.nu_trial[d] = guess.velocity[d]
        data.dnu[d] = 0.0
    alpha = 1.0
    last = 1e300
    halvings = 0
    iterations = 0
    while True:
        inside, r, gap = evaluate(model, data, h, (q, v, u), alpha)
        r = max(r / scale, gap)
        if not (inside and r < max(last, options.tolerance)):
            if inside and iterations > 0 and r < floor:
                break
            if halvings > 40:
                return Outcome(Status.NO_PROGRESS.value, iterations, r, 0.0)
            halvings += 1
            if iterations == 0:  # the start itself lies outside: slow everything down
                for d in range(v.shape[0]):
                    data.nu_trial[d] *= 0.7
            alpha *= 0.5
            continue
        if r < options.tolerance and (gap < closed_to(data, options) or r >= last):
            break
        if iterations == options.max_iterations:
            return Outcome(Status.MAX_ITERATIONS.value, iterations, r, 0.0)
        iterations += 1
        halvings = 0
        last = r
        alpha = 1.0
        if not newton_step(model, data, h, q, v):
            return Outcome(Status.SINGULAR.value, iterations, r, 0.0)
    turn_bodies(data, data.rot3)
    absorb_residual(model, data)
    return Outcome(Status.SOLVED.value, iterations, r, 0.0)
