"""States from a velocity at a node: the mean velocity of the interval before it that has the node's momentum."""

from __future__ import annotations

from sim.dynamics.elimination import factor, project, solve, subtree_sums
from sim.dynamics.energy import add_spring_momentum, armature_blocks, node_momentum, spatial_inertia
from sim.dynamics.kinematics import velocity_columns
from sim.dynamics.momentum_balance import momentum_balance_jacobian, turns_below_half
from sim.dynamics.velocity import joint_twists
from sim.model.data import Work
from sim.model.layout import model_view, work_view
from sim.model.model import Model
from sim.solve.residual import rounding
from solvers.compiler import Table, kernel
from solvers.status import Status
from solvers.types import Vector


@kernel
def momentum_of_velocity(model: Model, work: Work, v: Vector, out: Vector) -> None:
    """out = M(q) v = S2^T (inertia (S2 v)) + I v, at the poses of configuration 2 in `work`.   out: (nv,)."""
    spatial_inertia(model, work.origin, work.pos2, work.inertia_world, work.A)
    joint_twists(model, work, v)
    for i in range(model.body_parent.shape[0]):
        for r in range(6):
            f = 0.0
            for k in range(6):
                f += work.A[i, 6 * r + k] * work.twist[i, k]
            work.wrench[i, r] = f
    subtree_sums(model, work.wrench, work.subtree)
    project(model, work.S2, work.subtree, out)
    for d in range(out.shape[0]):
        out[d] += model.dof_armature[d] * v[d]


@kernel
def momentum_error(model: Model, work: Work, h: float, x: Vector, target: Vector, out: Vector) -> float:
    """out = p(x) - target, p the node momentum in joint coordinates; returns its largest entry."""
    node_momentum(model, work, h, x, work.wrench)
    subtree_sums(model, work.wrench, work.subtree)
    project(model, work.S2, work.subtree, out)
    nq = work.theta1.shape[0]
    add_spring_momentum(model, h, x[:nq], x[nq:], out)
    error = 0.0
    for d in range(out.shape[0]):
        out[d] -= target[d]
        error = max(error, abs(out[d])) if abs(out[d]) < 1e300 else 1e301
    return error


@kernel
def _turn_back(work: Work) -> None:
    """The interval 1-2 read backwards, as `momentum_balance_jacobian` reads the interval 2-3."""
    for i in range(work.pos1.shape[0]):
        work.turn[i, 0] = work.turn_in[i, 0]
        for k in range(3):
            work.turn[i, 1 + k] = -work.turn_in[i, 1 + k]
            work.pos3[i, k] = work.pos1[i, k]


@kernel
def newton_direction(model: Model, work: Work, h: float, v: Vector) -> bool:
    """dnu = -(dp/dv15)^-1 (p - target), at the state of the last `momentum_error`; False when singular.

        -dp/dv15 = S2^T A S1nu - I - h^2 k/4,     A = d(-momentum)/d(pose 1),   S1nu = d(pose 1)/d(v15)

    The spring term is exact but for quaternion joints.
    """
    _turn_back(work)
    momentum_balance_jacobian(model, work, h, work.A)
    velocity_columns(model, work.S1, v, -h, work.S3nu)
    armature_blocks(model, -1.0, work.joint_block)
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        for k in range(n):
            work.joint_block[i, k * n + k] -= 0.25 * h * h * model.dof_spring[d + k]
    if not factor(model, work):
        return False
    solve(model, work, work.residual, work.dnu)
    return True


@kernel
def start_state(model: Model, work: Work, h: float, velocity: Vector, x: Vector) -> int:
    """Solve p(q, v15) = M(q) velocity for v15 by Newton's method with backtracking.

    x: [q; first guess of v15], its velocities are overwritten; velocity: (nv,).
    """
    nv = velocity.shape[0]
    nq = x.shape[0] - nv
    v = x[nq:]
    momentum_error(model, work, h, x, velocity, work.residual)  # for the poses
    momentum_of_velocity(model, work, velocity, work.nu)
    for d in range(nv):
        work.rhs[d] = 0.0
    add_spring_momentum(model, h, x[:nq], v, work.rhs)
    scale = 1.0
    for d in range(nv):  # a stiff spring is rounded like its own half impulse
        scale = max(scale, abs(work.nu[d]), abs(work.rhs[d]))
    error = momentum_error(model, work, h, x, work.nu, work.residual)
    for _ in range(50):
        _turn_back(work)
        if not turns_below_half(model, work, h, v):
            return Status.ANGULAR_STEP.value
        if not error < 1e300:
            return Status.NOT_FINITE.value
        if error <= 1e-14 * scale:
            return Status.SOLVED.value
        if not newton_direction(model, work, h, v):
            return Status.SINGULAR.value
        for d in range(nv):
            work.nu_trial[d] = v[d]
        alpha = 1.0
        while alpha > 1e-6:
            for d in range(nv):
                v[d] = work.nu_trial[d] + alpha * work.dnu[d]
            trial = momentum_error(model, work, h, x, work.nu, work.residual)
            _turn_back(work)
            if trial < error and turns_below_half(model, work, h, v):
                break
            alpha *= 0.5
        if alpha <= 1e-6:
            for d in range(nv):
                v[d] = work.nu_trial[d]
            return (
                Status.SOLVED.value if error <= 1e-11 * scale + rounding(model, work, h) else Status.NO_PROGRESS.value
            )
        error = trial
    return Status.MAX_ITERATIONS.value


@kernel
def start_at(model_at: Table, work_at: Table, h: float, velocity: Vector, x: Vector) -> int:
    """`start_state` from tables."""
    return start_state(model_view(model_at), work_view(work_at), h, velocity, x)
