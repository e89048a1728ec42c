"""States from a velocity at a node: the mean velocity of the interval before it that has the node's momentum.

Where a body turns by half a turn or more in a step, poses cannot tell a mean velocity: velocities of such states are
those of the node, means over next to no time.
"""

from __future__ import annotations

from sim.dynamics.coordinates import node_poses
from sim.dynamics.elimination import factor, project, solve, subtree_sums
from sim.dynamics.energy import add_spring_momentum, armature_blocks, node_momentum, spatial_inertia
from sim.dynamics.joints.damper import node_damping
from sim.dynamics.kinematics import velocity_columns
from sim.dynamics.momentum_balance import momentum_balance_jacobian, turns_below_half, world_inertia
from sim.dynamics.velocity import joint_twists
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.slots import Slot
from sim.solve.residual import rounding
from solvers.compiler import Table, kernel, optional
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import Matrix, Vector

SHORTEST = 1e-6  # interval of velocities of nodes, in steps


@kernel
def momentum_of_velocity(model: Model, data: Data, h: float, v: Vector, out: Vector) -> None:
    """out = (M(q) + C) v, M v = S2^T (inertia (S2 v)) + I v, at the poses of configuration 2 in `data`.

    C: of dampers in an interval h (joints/damper.py), none for 0.   out: (nv,).
    """
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
        out[d] += (model.dof_armature[d] + node_damping(model, h, d)) * v[d]


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
    armature_blocks(model, -1.0, 0.0, data.joint_block)
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
def _meet_momentum(model: Model, data: Data, h: float, scale: float, x: Vector) -> int:
    """Solve p(q, v15) = target, which is in data.nu, for the v15 of x by Newton's method with backtracking.

    scale: size of the momenta [N s], by which the error is judged.   x: [q; first guess of v15].
    """
    v = x[data.theta1.shape[0] :]
    error = momentum_error(model, data, h, x, data.nu, data.residual)
    for _ in range(50):
        _turn_back(data)
        if not turns_below_half(model, data, h, v):
            return Status.TURN_TOO_LARGE.value
        if not error < 1e300:
            return Status.NOT_FINITE.value
        if error <= 1e-14 * scale:
            return Status.SOLVED.value
        if not newton_direction(model, data, h, v):
            return Status.SINGULAR.value
        trial = _backtrack(model, data, h, error, x)
        if not trial < error:
            rounded = error <= 1e-11 * scale + rounding(model, data, h)
            return Status.SOLVED.value if rounded else Status.NO_PROGRESS.value
        error = trial
    return Status.MAX_ITERATIONS.value


@kernel
def _backtrack(model: Model, data: Data, h: float, error: float, x: Vector) -> float:
    """The error after the longest step v15 + alpha dnu that lowers it; v15 and `error` as before where none does."""
    v = x[data.theta1.shape[0] :]
    copy_vector(v, data.nu_trial)
    alpha = 1.0
    while alpha > 1e-6:
        for d in range(v.shape[0]):
            v[d] = data.nu_trial[d] + alpha * data.dnu[d]
        trial = momentum_error(model, data, h, x, data.nu, data.residual)
        _turn_back(data)
        if trial < error and turns_below_half(model, data, h, v):
            return trial
        alpha *= 0.5
    copy_vector(data.nu_trial, v)
    return error


@kernel
def _momentum_scale(model: Model, data: Data, h: float, x: Vector) -> float:
    """Size of the target in data.nu, at least 1; a stiff spring is rounded like its own half impulse."""
    nq = data.theta1.shape[0]
    for d in range(data.rhs.shape[0]):
        data.rhs[d] = 0.0
    add_spring_momentum(model, h, x[:nq], x[nq:], data.rhs)
    scale = 1.0
    for d in range(data.rhs.shape[0]):
        scale = max(scale, abs(data.nu[d]), abs(data.rhs[d]))
    return scale


@optional(Slot.MEET_MOMENTUM, default=int(Status.NOT_FINITE))
def meet_momentum(model: Model, data: Data, h: float, x: Vector) -> int:
    """Solve p(q, v15; h) = p for v15, p (nv,) in data.nu.   x: [q; guess of v15], its velocities are overwritten."""
    return _meet_momentum(model, data, h, _momentum_scale(model, data, h, x), x)


@kernel
def start_state(model: Model, data: Data, h: float, velocity: Vector, x: Vector) -> int:
    """Solve p(q, v15) = (M(q) + C) velocity for v15.

    x: [q; first guess of v15], its velocities are overwritten; velocity: (nv,).
    """
    momentum_error(model, data, h, x, velocity, data.residual)  # for the poses
    momentum_of_velocity(model, data, h, velocity, data.nu)
    return meet_momentum(model, data, h, x)


@kernel
def start_at(model_at: Table, data_at: Table, h: float, velocity: Vector, x: Vector) -> int:
    """`start_state` from tables."""
    return start_state(model_view(model_at), data_view(data_at), h, velocity, x)


@kernel
def momentum_at(model_at: Table, data_at: Table, h: float, x: Vector, out: Vector) -> None:
    """out = p(q, v15; h), the momentum of the node of a state in joint coordinates.   out: (nv,)."""
    model = model_view(model_at)
    data = data_view(data_at)
    for d in range(out.shape[0]):
        data.rhs[d] = 0.0
    momentum_error(model, data, h, x, data.rhs, out)


@kernel
def state_of_momentum(model_at: Table, data_at: Table, h: float, p: Vector, x: Vector) -> int:
    """`meet_momentum` of p (nv,), from tables."""
    model = model_view(model_at)
    data = data_view(data_at)
    copy_vector(p, data.nu)
    return meet_momentum(model, data, h, x)


@kernel
def momenta_of_velocities(model_at: Table, data_at: Table, x: Vector, vs: Matrix, out: Matrix) -> None:
    """out[k] = M(q) vs[k].   x: [q; v]; vs, out: (n, nv)."""
    model = model_view(model_at)
    data = data_view(data_at)
    node_poses(model, data, 1.0, x)
    world_inertia(model, data.rot2, data.inertia_world)
    for k in range(vs.shape[0]):
        momentum_of_velocity(model, data, 0.0, vs[k], out[k])


@kernel
def interval(model: Model, data: Data, h: float, x: Vector) -> float:
    """Interval of the velocity of the state x: h, or SHORTEST h if a body would turn by half a turn in h [s]."""
    node_poses(model, data, h, x)
    return h if turns_below_half(model, data, h, x[data.theta1.shape[0] :]) else SHORTEST * h


@kernel
def intervals(model_at: Table, data_at: Table, h: float, xs: Matrix, out: Vector) -> None:
    """`interval` of each state.   xs: (n, nx); out: (n,) [s]."""
    model = model_view(model_at)
    data = data_view(data_at)
    for t in range(xs.shape[0]):
        out[t] = interval(model, data, h, xs[t])
