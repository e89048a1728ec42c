"""Steps of higher order: the variational step composed with itself over intervals g_1 h, g_2 h, ... of sum h.

The discrete Lagrangian of a step is symmetric, L_d(q2, q3; h) = -L_d(q3, q2; -h): rotational energy, gravity (half at
either end) and springs (at the middle) do not know which end came first. The map of coordinates and momentum at one node
to those at the next

    -D1 L_d(q2, q3) = p2,    p3 = D2 L_d(q2, q3)

is therefore its own adjoint, symplectic and of second order, and compositions with g_i = g_s+1-i reach order 4, 6, ...
(Yoshida 1990; Hairer, Lubich, Wanner, Geometric Numerical Integration, II.4 and V.3.2) with momentum as exact as before.
Dampers and inputs enter with half of their impulse at either end, which is symmetric too: the order is kept. Some g_i
are negative, for every order above 2 (Goldman and Kaper 1996): contacts and limits cannot be run backwards, and a damper
only as long as it is slow.

    state    x = [q; v], v at the node: p = M(q) v
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.dynamics import (
    _apply_input,
    _turns_below_half,
    angular_momentum,
    momentum_balance,
    momentum_balance_jacobian,
    world_inertia,
)
from sim.elimination import factor, project, solve, subtree_sums
from sim.energy import solve_mass_matrix
from sim.joints import joint_blocks, spring_turns
from sim.kinematics import tree_poses, velocity_columns
from sim.layout import model_view, work_view
from sim.model import InputKind, Matrix, Model, Options, Outcome, Vector, Work
from sim.newton import norm, residual_scale
from sim.rotation import Vec3, cross, rotate
from sim.velocity import joint_twists
from solvers.jit import kernel
from solvers.record import Table
from solvers.status import Status

_JOINT = int(InputKind.JOINT)
_SOLVED = int(Status.SOLVED)
_MAX_ITERATIONS = int(Status.MAX_ITERATIONS)
_NO_PROGRESS = int(Status.NO_PROGRESS)
_NOT_FINITE = int(Status.NOT_FINITE)
_SINGULAR = int(Status.SINGULAR)
_ANGULAR_STEP = int(Status.ANGULAR_STEP)


class Composition(NamedTuple):
    """A composition, and what a rollout remembers on its way."""

    parts: Vector  # (s,) the g_i
    impulse: Vector  # (nv,) of springs, dampers and inputs at the node so far
    past: NDArray[np.float64]  # (depth, s, nv) velocities of the parts, less that of the node, in the last few steps


@kernel
def _node(model: Model, work: Work, q: Vector) -> None:
    """Poses, columns and inertias at configuration 2 = q, about the place of body 0."""
    floating = model.body_parent.shape[0] > 0 and model.joint_ntrans[0] == 3
    for k in range(3):
        work.origin[k] = q[k] if floating else model.joint_parent_point[0, k]
    tree_poses(model, q, q, work.origin, work.pos2, work.quat2, work.rot2, work.S2)
    world_inertia(model, work.rot2, work.inertia_world)


@kernel
def _momenta_of_velocity(model: Model, work: Work, v: Vector) -> None:
    """momentum_in = (m v, J omega) of each body at its centre of mass, for joint velocities v at the node."""
    joint_twists(model, work, v)
    for i in range(model.body_parent.shape[0]):
        V = work.twist[i]
        J = work.inertia_world[i]
        P = work.momentum_in[i]
        x, y, z = cross(
            V[3], V[4], V[5],
            work.pos2[i, 0] - work.origin[0], work.pos2[i, 1] - work.origin[1], work.pos2[i, 2] - work.origin[2],
        )  # fmt: skip
        m = model.body_mass[i]
        P[0], P[1], P[2] = m * (V[0] + x), m * (V[1] + y), m * (V[2] + z)
        for k in range(3):
            P[3 + k] = J[3 * k] * V[3] + J[3 * k + 1] * V[4] + J[3 * k + 2] * V[5]


@kernel
def _velocity_of_momenta(model: Model, work: Work, impulse: Vector, v: Vector) -> bool:
    """v = M^-1 (S2^T momentum_in + impulse); False when M is singular."""
    for i in range(model.body_parent.shape[0]):
        P = work.momentum_in[i]
        x, y, z = cross(
            work.pos2[i, 0] - work.origin[0], work.pos2[i, 1] - work.origin[1], work.pos2[i, 2] - work.origin[2],
            P[0], P[1], P[2],
        )  # fmt: skip
        W = work.wrench[i]
        W[0], W[1], W[2], W[3], W[4], W[5] = P[0], P[1], P[2], P[3] + x, P[4] + y, P[5] + z
    subtree_sums(model, work.wrench, work.subtree)
    project(model, work.S2, work.subtree, work.residual)
    for d in range(v.shape[0]):
        work.residual[d] += impulse[d]
    return solve_mass_matrix(model, work, work.residual, v)


@kernel
def _add_joint_impulses(model: Model, work: Work, h: float, q: Vector, end: bool, scale: float, out: Vector) -> None:
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
def _add_forces(model: Model, work: Work, h: float, u: Vector, impulse: Vector) -> None:
    """Impulses of gravity and inputs over a time h, at the node: on momentum_in, and on `impulse` for JOINT inputs."""
    for i in range(model.body_parent.shape[0]):
        for k in range(3):
            work.momentum_in[i, k] += h * model.body_mass[i] * model.gravity[k]
    for j in range(u.shape[0]):
        if model.input_kind[j] == _JOINT:
            impulse[model.input_index[j]] += h * u[j]
        else:
            _apply_input(model, work, h, j, u[j])


@kernel
def _balance(model: Model, work: Work, h: float, q: Vector, impulse: Vector) -> bool:
    """residual = -D1 L_d(q, q (+) h nu) - p2 in joint coordinates; False when a body would turn by half a turn."""
    inside = momentum_balance(model, work, h, q)
    subtree_sums(model, work.balance, work.subtree)
    project(model, work.S2, work.subtree, work.residual)
    _add_joint_impulses(model, work, h, q, False, 1.0, work.residual)
    for d in range(impulse.shape[0]):
        work.residual[d] -= impulse[d]
    return inside


@kernel
def _direction(model: Model, work: Work, h: float, q: Vector) -> bool:
    """Newton step dnu at the trial velocity nu; False when its matrix is singular."""
    velocity_columns(model, work.S3, work.nu, h, work.S3nu)
    momentum_balance_jacobian(model, work, h, work.A)
    joint_blocks(model, work, h, q, work.nu)
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        for k in range(n):  # a damper has half of its impulse at this end
            work.joint_block[i, k * n + k] -= 0.5 * h * model.dof_damper[d + k]
    if not factor(model, work):
        return False
    for d in range(work.rhs.shape[0]):
        work.rhs[d] = -work.residual[d]
    solve(model, work, work.rhs, work.dnu)
    return True


@kernel
def _rounding(model: Model, work: Work, h: float) -> float:
    """What the balance cannot be told from zero: momenta are differences of positions, divided by h."""
    total = 0.0
    for i in range(model.body_parent.shape[0]):
        x = abs(work.pos2[i, 0]) + abs(work.pos2[i, 1]) + abs(work.pos2[i, 2])
        o = abs(work.origin[0]) + abs(work.origin[1]) + abs(work.origin[2])
        total += model.body_mass[i] * x * (1.0 + x + o)
    return 1e-15 * total / abs(h)


@kernel
def _interval(model: Model, work: Work, options: Options, h: float, q: Vector, impulse: Vector) -> Outcome:
    """Solve -D1 L_d(q, q (+) h nu) = p2 for nu by Newton's method from the guess in work.nu, with one step at least."""
    scale = residual_scale(work)
    tolerance = options.tolerance + _rounding(model, work, h) / scale
    last = 1e300
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
        if not (inside and r < max(last, tolerance)):
            if halvings > 40:
                return Outcome(_NO_PROGRESS, iterations, r, 0.0)
            halvings += 1
            if iterations == 0:  # the guess itself lies outside: slow everything down
                for d in range(work.nu.shape[0]):
                    work.nu_trial[d] *= 0.7
            alpha *= 0.5
        elif iterations > 0 and r < tolerance:
            return Outcome(_SOLVED, iterations, r, 0.0)
        elif iterations == options.max_iterations:
            return Outcome(_MAX_ITERATIONS, iterations, r, 0.0)
        else:
            if not _direction(model, work, h, q):
                return Outcome(_SINGULAR, iterations, r, 0.0)
            iterations += 1
            halvings = 0
            last = r
            alpha = 1.0
            for d in range(work.nu.shape[0]):
                work.nu_trial[d] = work.nu[d]
        for d in range(work.nu.shape[0]):
            work.nu[d] = work.nu_trial[d] + alpha * work.dnu[d]


@kernel
def _left_over(model: Model, work: Work, impulse: Vector) -> tuple[Vec3, Vec3, Vec3]:
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
def _arrive(model: Model, work: Work, h: float, q: Vector, impulse: Vector) -> bool:
    """Make configuration 3 the node: q, poses, and its momentum p3 = D2 L_d.  False after half a turn or more."""
    F, T, o = _left_over(model, work, impulse)
    _add_joint_impulses(model, work, h, q, True, -1.0, impulse)
    for i in range(work.turn.shape[0]):
        for k in range(4):
            work.turn_in[i, k] = work.turn[i, k]
        for k in range(3):
            work.momentum_in[i, k] = model.body_mass[i] * (work.pos3[i, k] - work.pos2[i, k]) / h
    representable = _turns_below_half(model, work, h, work.nu)
    for k in range(q.shape[0]):
        q[k] = work.theta3[k]
    _node(model, work, q)
    for i in range(work.turn.shape[0]):
        c, x, y, z = work.turn[i, 0], work.turn[i, 1], work.turn[i, 2], work.turn[i, 3]
        px, py, pz = angular_momentum(work.inertia_world, i, h, c, -x, -y, -z)
        work.momentum_in[i, 3] = -px
        work.momentum_in[i, 4] = -py
        work.momentum_in[i, 5] = -pz
    p = work.momentum_in[0]
    x, y, z = cross(o[0] - work.pos2[0, 0], o[1] - work.pos2[0, 1], o[2] - work.pos2[0, 2], F[0], F[1], F[2])
    p[0], p[1], p[2] = p[0] - F[0], p[1] - F[1], p[2] - F[2]
    p[3], p[4], p[5] = p[3] - T[0] - x, p[4] - T[1] - y, p[5] - T[2] - z
    return representable


@kernel
def _predict(composition: Composition, known: int, part: int, v: Vector, out: Vector) -> None:
    """out = v + what this part added to it in the last steps, extrapolated: 1; 2, -1; 3, -3, 1; ...

    known: steps taken so far; v: (nv,) at the node.
    """
    past = composition.past
    depth = min(known, past.shape[0])
    for d in range(v.shape[0]):
        out[d] = v[d]
    c = float(depth)
    for j in range(1, depth + 1):
        row = past[(known - j) % past.shape[0], part]
        for d in range(v.shape[0]):
            out[d] += c * row[d]
        c *= -(depth - j) / (j + 1.0)


@kernel
def composed_step(
    model: Model, work: Work, options: Options, composition: Composition, known: int, u: Vector, x: Vector,
    report: Vector,
) -> int:  # fmt: skip
    """x = [q; v at the node] one step later, in place; returns the Status.   report: (5,) as in sim/step.py."""
    nq = work.theta1.shape[0]
    q, v = x[:nq], x[nq:]
    impulse, past = composition.impulse, composition.past
    _node(model, work, q)
    _momenta_of_velocity(model, work, v)
    for d in range(v.shape[0]):
        impulse[d] = 0.0
    before = 0.0
    report[1] = report[2] = report[3] = 0.0
    report[4] = -1.0
    for part in range(composition.parts.shape[0]):
        h = composition.parts[part] * options.h
        _add_forces(model, work, 0.5 * (before + h), u, impulse)
        before = h
        _predict(composition, known, part, v, work.nu)
        r = _interval(model, work, options, h, q, impulse)
        report[1] += r.iterations
        report[2] = max(report[2], r.residual)
        if r.status != _SOLVED:
            return r.status
        for d in range(v.shape[0]):
            past[known % past.shape[0], part, d] = work.nu[d] - v[d]
        if not _arrive(model, work, h, q, impulse):
            return _ANGULAR_STEP
    _add_forces(model, work, 0.5 * before, u, impulse)
    return _SOLVED if _velocity_of_momenta(model, work, impulse, v) else _SINGULAR


@kernel
def roll(
    model_at: Table, work_at: Table, settings: Vector, composition: Composition, us: Matrix, xs: Matrix,
    reports: Matrix,
) -> int:  # fmt: skip
    """xs[t + 1] = step(xs[t], us[t]) from xs[0]; returns the number of solved steps.

    us: (T, nu); xs: (T + 1, nx); reports: (T, 5).
    """
    model = model_view(model_at)
    work = work_view(work_at)
    options = Options(settings[0], settings[1], settings[2], int(settings[3]))
    for t in range(us.shape[0]):
        total = 0.0
        for k in range(xs.shape[1]):
            xs[t + 1, k] = xs[t, k]
        status = composed_step(model, work, options, composition, t, us[t], xs[t + 1], reports[t])
        for k in range(xs.shape[1]):
            total += xs[t + 1, k]
        if status == _SOLVED and not abs(total) < 1e300:
            status = _NOT_FINITE
        reports[t, 0] = status
        if status != _SOLVED:
            return t
    return us.shape[0]
