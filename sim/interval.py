"""An interval of a composed step: Newton's method on -D1 L_d(q2, q3) = p2, for intervals of either sign."""

from __future__ import annotations

from sim.ball_spring import spring_turns
from sim.dynamics import _turns_below_half, angular_momentum, momentum_balance, momentum_balance_jacobian
from sim.elimination import factor, project, solve, subtree_sums
from sim.joints import joint_blocks
from sim.kinematics import velocity_columns
from sim.model import Model, Options, Outcome, Vector, Work
from sim.newton import norm, residual_scale, rounding
from sim.node import advance_node
from sim.rotation import Vec3, cross, rotate
from solvers.jit import kernel
from solvers.status import Status

_KEEP = 1e-3  # a Newton matrix that shrinks the residual so much is kept for the next step
_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NO_PROGRESS = int(Status.NO_PROGRESS)
_SINGULAR = int(Status.SINGULAR)


@kernel
def add_joint_impulses(model: Model, work: Work, h: float, q: Vector, end: bool, scale: float, out: Vector) -> None:
    """out += scale times the half of the impulses of springs and dampers at one end of the interval from q by h nu:

    scalar        h k/2 (q + h nu/2 - rest) + h d/2 nu
    quaternion    h k/2 (c I - [s]) (s2 + s3) + h d/2 nu,     (c, s) the rotation from rest at that end
    """
    for i in range(model.body_parent.shape[0]):
        stop = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            stop -= 3
            g = 0.5 * scale * h * model.dof_spring[stop]
            if g != 0.0:
                _, r2, r3 = spring_turns(model, work, h, q, work.nu, i)
                r = r3 if end else r2
                x, y, z = r2[1] + r3[1], r2[2] + r3[2], r2[3] + r3[3]
                t = cross(r[1], r[2], r[3], x, y, z)
                out[stop] += g * (r[0] * x - t[0])
                out[stop + 1] += g * (r[0] * y - t[1])
                out[stop + 2] += g * (r[0] * z - t[2])
            for d in range(stop, stop + 3):
                out[d] += 0.5 * scale * h * model.dof_damper[d] * work.nu[d]
        for d in range(model.body_vadr[i], stop):
            middle = q[model.dof_qadr[d]] + 0.5 * h * work.nu[d] - model.dof_rest[d]
            force = model.dof_spring[d] * middle + model.dof_damper[d] * work.nu[d]
            out[d] += 0.5 * scale * h * force


@kernel
def _balance(model: Model, work: Work, h: float, q: Vector, impulse: Vector) -> bool:
    """residual = -D1 L_d(q, q (+) h nu) - p2 in joint coordinates; False when a body would turn by half a turn."""
    inside = momentum_balance(model, work, h, q)
    subtree_sums(model, work.balance, work.subtree)
    project(model, work.S2, work.subtree, work.residual)
    add_joint_impulses(model, work, h, q, False, 1.0, work.residual)
    for d in range(impulse.shape[0]):
        work.residual[d] -= impulse[d]
    return inside


@kernel
def _matrix(model: Model, work: Work, h: float, q: Vector) -> bool:
    """Factors of d(residual)/d(nu) at the trial velocity nu; False when it is singular."""
    velocity_columns(model, work.S3, work.nu, h, work.S3nu)
    momentum_balance_jacobian(model, work, h, work.A)
    joint_blocks(model, work, h, q, work.nu)
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        for k in range(n):  # a damper has half of its impulse at this end
            work.joint_block[i, k * n + k] -= 0.5 * h * model.dof_damper[d + k]
    return factor(model, work) != 0


@kernel
def solve_interval(model: Model, work: Work, options: Options, h: float, q: Vector, impulse: Vector) -> Outcome:
    """Solve -D1 L_d(q, q (+) h nu) = p2 for nu by Newton's method from the guess in work.nu, with one step at least."""
    scale = residual_scale(work)
    floor = rounding(model, work, h) / scale
    last = 0.0
    r = 1e300
    alpha = 1.0
    halvings = 0
    iterations = 0
    for d in range(work.nu.shape[0]):
        work.nu_trial[d] = work.nu[d]
        work.dnu[d] = 0.0
    while True:
        inside = _balance(model, work, h, q, impulse)
        r = norm(work.residual) / scale
        if not (inside and (r < max(last, options.tolerance) or iterations == 0)):
            if inside and iterations > 0 and r < floor:
                return Outcome(_SOLVED, iterations, r, 0.0)
            if halvings > 40:
                return Outcome(_NO_PROGRESS, iterations, r, 0.0)
            halvings += 1
            if iterations == 0:  # the guess itself lies outside: slow everything down
                for d in range(work.nu.shape[0]):
                    work.nu_trial[d] *= 0.7
            alpha *= 0.5
        elif iterations > 0 and r < options.tolerance:
            return Outcome(_SOLVED, iterations, r, 0.0)
        elif iterations == options.max_iterations:
            return Outcome(_MAX_ITERATIONS, iterations, r, 0.0)
        else:
            if not r < _KEEP * last and not _matrix(model, work, h, q):
                return Outcome(_SINGULAR, iterations, r, 0.0)
            for d in range(work.nu.shape[0]):
                work.rhs[d] = -work.residual[d]
                work.nu_trial[d] = work.nu[d]
            solve(model, work, work.rhs, work.dnu)
            iterations += 1
            halvings = 0
            last = r
            alpha = 1.0
        for d in range(work.nu.shape[0]):
            work.nu[d] = work.nu_trial[d] + alpha * work.dnu[d]


@kernel
def left_over(model: Model, work: Work, impulse: Vector) -> tuple[Vec3, Vec3, Vec3]:
    """What the interval leaves of its balance, to be handed on: momentum then drifts by no tolerance and no rounding.

    impulse = -residual; but that of a floating base, whose axes turn, as (force, moment, joint point) in the world.
    """
    for d in range(impulse.shape[0]):
        impulse[d] = -work.residual[d]
    if model.joint_ntrans[0] < 3 or model.joint_nrot[0] < 3:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    r, S = work.residual, work.S2
    for d in range(6):
        impulse[d] = 0.0
    F = (
        r[0] * S[0, 0] + r[1] * S[1, 0] + r[2] * S[2, 0],
        r[0] * S[0, 1] + r[1] * S[1, 1] + r[2] * S[2, 1],
        r[0] * S[0, 2] + r[1] * S[1, 2] + r[2] * S[2, 2],
    )
    T = (
        r[3] * S[3, 3] + r[4] * S[4, 3] + r[5] * S[5, 3],
        r[3] * S[3, 4] + r[4] * S[4, 4] + r[5] * S[5, 4],
        r[3] * S[3, 5] + r[4] * S[4, 5] + r[5] * S[5, 5],
    )
    c = model.joint_child_point[0]
    x, y, z = rotate(work.rot2, 0, c[0], c[1], c[2])
    return F, T, (work.pos2[0, 0] + x, work.pos2[0, 1] + y, work.pos2[0, 2] + z)


@kernel
def arrive(model: Model, work: Work, h: float, q: Vector, impulse: Vector) -> bool:
    """Make configuration 3 the node: q, poses, and its momentum p3 = D2 L_d.  False after half a turn or more.

    A body's momentum is in world axes the same at both ends of an interval, for L_d does not care where it is and how
    it is turned: so it is computed once, as the balance has it, and no rounding comes between the two.
    """
    F, T, o = left_over(model, work, impulse)
    add_joint_impulses(model, work, h, q, True, -1.0, impulse)
    for i in range(work.turn.shape[0]):
        c, x, y, z = work.turn[i, 0], work.turn[i, 1], work.turn[i, 2], work.turn[i, 3]
        p = work.momentum_in[i]
        m = model.body_mass[i] / h
        for k in range(3):
            p[k] = m * (work.pos3[i, k] - work.pos2[i, k])
        p[3], p[4], p[5] = angular_momentum(work.inertia_world, i, h, c, x, y, z)
        for k in range(4):
            work.turn_in[i, k] = work.turn[i, k]
    representable = _turns_below_half(model, work, h, work.nu)
    advance_node(model, work, q)
    p = work.momentum_in[0]
    x, y, z = cross(o[0] - work.pos2[0, 0], o[1] - work.pos2[0, 1], o[2] - work.pos2[0, 2], F[0], F[1], F[2])
    p[0], p[1], p[2] = p[0] - F[0], p[1] - F[1], p[2] - F[2]
    p[3], p[4], p[5] = p[3] - T[0] - x, p[4] - T[1] - y, p[5] - T[2] - z
    return representable
