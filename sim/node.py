"""A node of a composed step: poses, columns, inertias, and momenta of the bodies from joint velocities and back.

momentum_in    (nbody, 6) of each body at its centre of mass: linear, angular, world axes
impulse        (nv,) of springs, dampers and JOINT inputs, in joint coordinates
"""

from __future__ import annotations

from sim.dynamics import _apply_input, world_inertia
from sim.elimination import project, solve, subtree_sums
from sim.energy import solve_mass_matrix
from sim.kinematics import tree_poses
from sim.model import InputKind, Model, Vector, Work
from sim.rotation import cross, rotate
from sim.velocity import joint_twists
from solvers.jit import kernel

_JOINT = int(InputKind.JOINT)


@kernel
def place_node(model: Model, work: Work, q: Vector) -> None:
    """Poses, columns and inertias at configuration 2 = q, about the place of body 0."""
    floating = model.joint_ntrans[0] == 3
    for k in range(3):
        work.origin[k] = q[k] if floating else model.joint_parent_point[0, k]
    tree_poses(model, q, q, work.origin, work.pos2, work.quat2, work.rot2, work.S2)
    world_inertia(model, work.rot2, work.inertia_world)


@kernel
def advance_node(model: Model, work: Work, q: Vector) -> None:
    """Configuration 3 becomes configuration 2: q, poses, columns about the new place of body 0, and inertias."""
    for k in range(q.shape[0]):
        q[k] = work.theta3[k]
    o = work.origin
    dx, dy, dz = o[0], o[1], o[2]
    if model.joint_ntrans[0] == 3:
        for k in range(3):
            o[k] = q[k]
    dx, dy, dz = dx - o[0], dy - o[1], dz - o[2]
    for i in range(model.body_parent.shape[0]):
        for k in range(3):
            work.pos2[i, k] = work.pos3[i, k]
        for k in range(4):
            work.quat2[i, k] = work.quat3[i, k]
        R = work.rot2[i]
        for k in range(9):
            R[k] = work.rot3[i, k]
        stop = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:  # about the axes of the body itself, through its joint point
            stop -= 3
            c = model.joint_child_point[i]
            x, y, z = rotate(work.rot2, i, c[0], c[1], c[2])
            x, y, z = x + work.pos2[i, 0] - o[0], y + work.pos2[i, 1] - o[1], z + work.pos2[i, 2] - o[2]
            for k in range(3):
                S = work.S2[stop + k]
                S[0], S[1], S[2] = cross(x, y, z, R[k], R[3 + k], R[6 + k])
                S[3], S[4], S[5] = R[k], R[3 + k], R[6 + k]
        for d in range(model.body_vadr[i], stop):
            S, T = work.S2[d], work.S3[d]
            x, y, z = cross(dx, dy, dz, T[3], T[4], T[5])
            S[0], S[1], S[2], S[3], S[4], S[5] = T[0] + x, T[1] + y, T[2] + z, T[3], T[4], T[5]
    world_inertia(model, work.rot2, work.inertia_world)


@kernel
def momenta_of_velocity(model: Model, work: Work, v: Vector) -> None:
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
def _project_momenta(model: Model, work: Work, out: Vector) -> None:
    """out = S2^T momentum_in.   (nv,)"""
    for i in range(model.body_parent.shape[0]):
        P = work.momentum_in[i]
        x, y, z = cross(
            work.pos2[i, 0] - work.origin[0], work.pos2[i, 1] - work.origin[1], work.pos2[i, 2] - work.origin[2],
            P[0], P[1], P[2],
        )  # fmt: skip
        W = work.wrench[i]
        W[0], W[1], W[2], W[3], W[4], W[5] = P[0], P[1], P[2], P[3] + x, P[4] + y, P[5] + z
    subtree_sums(model, work.wrench, work.subtree)
    project(model, work.S2, work.subtree, out)


@kernel
def velocity_of_momenta(model: Model, work: Work, impulse: Vector, v: Vector) -> bool:
    """v = M^-1 (S2^T momentum_in + impulse), refined once so that its error has no direction; False when singular."""
    _project_momenta(model, work, work.residual)
    for d in range(v.shape[0]):
        impulse[d] += work.residual[d]
    if not solve_mass_matrix(model, work, impulse, v):
        return False
    momenta_of_velocity(model, work, v)
    _project_momenta(model, work, work.residual)
    for d in range(v.shape[0]):
        work.residual[d] = impulse[d] - work.residual[d]
    solve(model, work, work.residual, work.dnu)
    for d in range(v.shape[0]):
        v[d] += work.dnu[d]
    return True


@kernel
def add_forces(model: Model, work: Work, h: float, u: Vector, impulse: Vector) -> None:
    """Impulses of gravity and inputs over a time h, at the node: on momentum_in, and on `impulse` for JOINT inputs."""
    for i in range(model.body_parent.shape[0]):
        for k in range(3):
            work.momentum_in[i, k] += h * model.body_mass[i] * model.gravity[k]
    for j in range(u.shape[0]):
        if model.input_kind[j] == _JOINT:
            impulse[model.input_index[j]] += h * u[j]
        else:
            _apply_input(model, work, h, j, u[j])
