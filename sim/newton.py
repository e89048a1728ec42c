"""The step of a scene without contacts and limits: Newton's method on the momentum balance, nothing else compiled."""

from __future__ import annotations

from sim.coupling import factor_coupling, solve_coupling
from sim.dynamics import momentum_balance, momentum_balance_jacobian
from sim.elimination import factor, project, solve, subtree_sums
from sim.gears import apply_gears
from sim.joints import joint_blocks, joint_impulses
from sim.kinematics import velocity_columns
from sim.loops import apply_loops, keep_loops, move_loops
from sim.model import FAILED, Guess, Late, Model, Options, Outcome, Vector, Work
from solvers.jit import kernel
from solvers.late import late
from solvers.status import Status

_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NO_PROGRESS = int(Status.NO_PROGRESS)
_SINGULAR = int(Status.SINGULAR)
_ROUNDED = 1e-10


@kernel
def residual_scale(work: Work) -> float:
    """1 + largest incoming momentum: rounding grows with it, and so does the tolerance."""
    s = 1.0
    for i in range(work.momentum_in.shape[0]):
        for k in range(6):
            s = max(s, 1.0 + abs(work.momentum_in[i, k]))
    return s


@kernel
def rounding(model: Model, work: Work, h: float) -> float:
    """Residual that cannot be told from zero: momenta are differences of rounded poses, divided by h."""
    total = 0.0
    o = abs(work.origin[0]) + abs(work.origin[1]) + abs(work.origin[2])
    for i in range(model.body_parent.shape[0]):
        x = abs(work.pos2[i, 0]) + abs(work.pos2[i, 1]) + abs(work.pos2[i, 2])
        J = model.body_inertia[i]
        total += model.body_mass[i] * x * (1.0 + x + o) + J[0] + J[4] + J[8]
    return 1e-15 * total / abs(h)


@kernel
def norm(x: Vector) -> float:
    """Largest absolute entry; NaN if any entry is NaN."""
    r = 0.0
    for d in range(x.shape[0]):
        a = abs(x[d])
        if not a <= r:
            r = a
    return r


@kernel
def closed_to(work: Work, options: Options) -> float:
    """How far loops may be open: near where two branches of their motion meet, gaps grow slowly away from either.

    Least pivot: the product of the distances of configurations 2 and 3 from there.
    """
    return options.tolerance * max(work.couple_rank[2], _ROUNDED) ** 0.5 if work.couple_rank[1] > 0.0 else 1e300


@late(Late.SOLVE, FAILED)
def newton(model: Model, work: Work, options: Options, q: Vector, v: Vector, u: Vector, guess: Guess) -> Outcome:
    """Solve R(v25) = 0 from the guess of v25; halve steps that leave the domain or let the residual grow.

    Leaves configuration 3, the balances and the residual wrenches (work.wrench, work.subtree) at the solution.
    """
    h = options.h
    scale = residual_scale(work)
    floor = rounding(model, work, h) / scale
    keep_loops(model, work)
    for d in range(v.shape[0]):
        work.nu_trial[d] = guess.velocity[d]
        work.dnu[d] = 0.0
    alpha = 1.0
    last = 1e300
    halvings = 0
    iterations = 0
    r = 1e300
    status = _MAX_ITERATIONS
    while True:
        for d in range(v.shape[0]):
            work.nu[d] = work.nu_trial[d] + alpha * work.dnu[d]
        inside = momentum_balance(model, work, h, q)
        for i in range(work.balance.shape[0]):
            for k in range(6):
                work.wrench[i, k] = work.balance[i, k]
        move_loops(model, work, alpha)
        gap = apply_loops(model, work)
        subtree_sums(model, work.wrench, work.subtree)
        project(model, work.S2, work.subtree, work.residual)
        joint_impulses(model, work, h, q, v, u)
        gap = max(gap, apply_gears(model, work, h))
        r = max(norm(work.residual) / scale, gap)
        if not (inside and r < max(last, options.tolerance)):
            if inside and iterations > 0 and r < floor:
                status = _SOLVED
                break
            if halvings > 40:
                status = _NO_PROGRESS
                break
            halvings += 1
            if iterations == 0:  # the start itself lies outside: slow everything down
                for d in range(v.shape[0]):
                    work.nu_trial[d] *= 0.7
            alpha *= 0.5
            continue
        if r < options.tolerance and (gap < closed_to(work, options) or r >= last):
            status = _SOLVED
            break
        if iterations == options.max_iterations:
            break
        iterations += 1
        halvings = 0
        last = r
        alpha = 1.0
        velocity_columns(model, work.S3, work.nu, h, work.S3nu)
        momentum_balance_jacobian(model, work, h, work.A)
        joint_blocks(model, work, h, q, v)
        if factor(model, work) == 0 or not factor_coupling(model, work):
            status = _SINGULAR
            break
        for d in range(v.shape[0]):
            work.nu_trial[d] = work.nu[d]
            work.rhs[d] = -work.residual[d]
        solve(model, work, work.rhs, work.dnu)
        solve_coupling(model, work, 1.0, work.dnu)
        keep_loops(model, work)
    return Outcome(status, iterations, r, 0.0)
