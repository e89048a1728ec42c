"""States from a velocity at a node: the mean velocity of the interval before it that has the node's momentum."""

from __future__ import annotations

from sim.dynamics.elimination import factor, project, solve, subtree_sums
from sim.dynamics.energy import add_spring_momentum, armature_blocks, node_momentum, spatial_inertia
from sim.dynamics.kinematics import velocity_columns
from sim.dynamics.momentum_balance import momentum_balance_jacobian, turns_below_half
from sim.dynamics.velocity import joint_twists
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.solve.residual import rounding
from solvers.compiler import Table, kernel
from solvers.status import Status
from solvers.types import Vector


@kernel
def momentum_of_velocity(model: Model, data: Data, v: Vector, out: Vector) -> None:
    """out = M(q) v = S2^T (inertia (S2 v)) + I v, at the poses of configuration 2 in `data`.   out: (nv,)."""
    spatial_inertia(model, data.origin, data.pos2, data.inertia_world, data.A)
    joint_twists(model, data, v)
    for i in range(model.body_parent.shape[0]):
        for r in range(6):
            f = 0.0
            for k in range(6):
                f += data.A[i, 6 * r + k] * data.twist[i, k]
            data.wrench[i, r] = f
    subtree_sums(model, data.wrench, data.subtree)
    project(model, data.S2, data.subtree, out)
    for d in range(out.shape[0]):
        out[d] += model.dof_armature[d] * v[d]


@kernel
def momentum_error(model: Model, data: Data, h: float, x: Vector, target: Vector, out: Vector) -> float:
    """out = p(x) - target, p the node momentum in joint coordinates; returns its largest entry."""
    node_momentum(model, data, h, x, data.wrench)
    subtree_sums(model, data.wrench, data.subtree)
    project(model, data.S2, data.subtree, out)
    nq = data.theta1.shape[0]
    add_spring_momentum(model, h, x[:nq], x[nq:], out)
    error = 0.0
    for d in range(out.shape[0]):
        out[d] -= target[d]
        error = max(error, abs(out[d])) if abs(out[d]) < 1e300 else 1e301
    return error


@kernel
def _turn_back(data: Data) -> None:
    """The interval 1-2 read backwards, as `momentum_balance_jacobian` reads the interval 2-3."""
    for i in range(data.pos1.shape[0]):
        data.turn[i, 0] = data.turn_in[i, 0]
        for k in range(3):
            data.turn[i, 1 + k] = -data.turn_in[i, 1 + k]
            data.pos3[i, k] = data.pos1[i, k]


@kernel
def newton_direction(model: Model, data: Data, h: float, v: Vector) -> bool:
    """dnu = -(dp/dv15)^-1 (p - target), at the state of the last `momentum_error`; False when singular.

        -dp/dv15 = S2^T A S1nu - I - h^2 k/4,     A = d(-momentum)/d(pose 1),   S1nu = d(pose 1)/d(v15)

    The spring term is exact but for quaternion joints.
    """
    _turn_back(data)
    momentum_balance_jacobian(model, data, h, data.A)
    velocity_columns(model, data.S1, v, -h, data.S3nu)
    armature_blocks(model, -1.0, data.joint_block)
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        for k in range(n):
            data.joint_block[i, k * n + k] -= 0.25 * h * h * model.dof_spring[d + k]
    if not factor(model, data):
        return False
    solve(model, data, data.residual, data.dnu)
    return True


@kernel
def _backtrack(model: Model, data: Data, h: float, x: Vector, error: float) -> float:
    """The error after the longest of dnu, dnu/2, ... that makes it less; 1e300 and x as it was without one."""
    nv = data.nu.shape[0]
    v = x[x.shape[0] - nv :]
    for d in range(nv):
        data.nu_trial[d] = v[d]
    alpha = 1.0
    while alpha > 1e-6:
        for d in range(nv):
            v[d] = data.nu_trial[d] + alpha * data.dnu[d]
        trial = momentum_error(model, data, h, x, data.nu, data.residual)
        _turn_back(data)
        if trial < error and turns_below_half(model, data, h, v):
            return trial
        alpha *= 0.5
    for d in range(nv):
        v[d] = data.nu_trial[d]
    return 1e300


@kernel
def start_state(model: Model, data: Data, h: float, velocity: Vector, x: Vector) -> int:
    """Solve p(q, v15) = M(q) velocity for v15 by Newton's method with backtracking.

    x: [q; first guess of v15], its velocities are overwritten; velocity: (nv,).
    """
    nv = velocity.shape[0]
    nq = x.shape[0] - nv
    v = x[nq:]
    momentum_error(model, data, h, x, velocity, data.residual)  # for the poses
    momentum_of_velocity(model, data, velocity, data.nu)
    for d in range(nv):
        data.rhs[d] = 0.0
    add_spring_momentum(model, h, x[:nq], v, data.rhs)
    scale = 1.0
    for d in range(nv):  # a stiff spring is rounded like its own half impulse
        scale = max(scale, abs(data.nu[d]), abs(data.rhs[d]))
    error = momentum_error(model, data, h, x, data.nu, data.residual)
    for _ in range(50):
        _turn_back(data)
        if not turns_below_half(model, data, h, v):
            return Status.ANGULAR_STEP.value
        if not error < 1e300:
            return Status.NOT_FINITE.value
        if error <= 1e-14 * scale:
            return Status.SOLVED.value
        if not newton_direction(model, data, h, v):
            return Status.SINGULAR.value
        trial = _backtrack(model, data, h, x, error)
        if not trial < error:
            return (
                Status.SOLVED.value if error <= 1e-11 * scale + rounding(model, data, h) else Status.NO_PROGRESS.value
            )
        error = trial
    return Status.MAX_ITERATIONS.value


@kernel
def start_at(model_at: Table, data_at: Table, h: float, velocity: Vector, x: Vector) -> int:
    """`start_state` from tables."""
    return start_state(model_view(model_at), data_view(data_at), h, velocity, x)
