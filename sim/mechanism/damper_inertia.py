"""Inertias that dampers see, constants of a mechanism: whether a damper is stiff in a step is judged by its own.

    I_d = 1/(M^-1)_dd,      M: mass matrix with all hinges at BEND, all other coordinates at zero

the inertia of a coordinate while all others are free: twice the least kinetic energy of the motions with the rate 1 of
it. These motions are x_d = I_d M^-1 e_d, so a parameter p changes the inertia by

    dI_d/dp = d(x_d.M x_d)/dp at constant x_d

At zero angles the axes of an arm are often aligned, which makes their inertias unusually small.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.mechanism.pose import turn
from sim.mechanism.shapes import rotation_matrix
from sim.model.model import Model
from solvers.types import Floats

BEND = 0.5  # [rad]
_SINGULAR = 1e-13  # times the largest eigenvalue of M: with a smaller one M counts as singular


class Bent(NamedTuple):
    """A mechanism with its hinges at BEND: positions [m] and directions in the world."""

    rotation: Floats  # (nbody, 3, 3)
    center: Floats  # (nbody, 3) centres of mass
    joint: Floats  # (nbody, 3) joint points on the parents
    frame: Floats  # (nbody, 3, 3) orientations of the joint frames on the parents
    columns: Floats  # (nv, 6) velocity at the origin of the world and angular velocity per unit of a rate
    inertia: Floats  # (nbody, 6, 6) about the origin


def bent(model: Model) -> Bent:
    """The mechanism with its hinges at BEND."""
    n = len(model.body_mass)
    rotation, frame = np.empty((n, 3, 3)), np.empty((n, 3, 3))
    center, joint = np.empty((n, 3)), np.empty((n, 3))
    columns, inertia = np.zeros((len(model.dof_body), 6)), np.empty((n, 6, 6))
    for i in range(n):
        p, offset = int(model.body_parent[i]), rotation_matrix(model.joint_offset[i])
        frame[i] = offset if p < 0 else rotation[p] @ offset
        joint[i] = model.joint_parent_point[i] if p < 0 else center[p] + rotation[p] @ model.joint_parent_point[i]
        rotation[i], center[i] = frame[i], joint[i].copy()
        if model.joint_nrot[i] == 1:
            rotation[i] = frame[i] @ turn(model.joint_axis[i], BEND)
            center[i] += BEND * model.joint_lead[i] * (frame[i] @ model.joint_axis[i])
        center[i] -= rotation[i] @ model.joint_child_point[i]
        dofs = slice(int(model.body_vadr[i]), int(model.body_vadr[i + 1]))
        local = joint_columns(model, i)
        columns[dofs, 3:] = local[:, 3:] @ frame[i].T
        columns[dofs, :3] = local[:, :3] @ frame[i].T - columns[dofs, 3:] @ _skew(joint[i])
        J = rotation[i] @ model.body_inertia[i].reshape(3, 3) @ rotation[i].T
        inertia[i] = _about_origin(float(model.body_mass[i]), J, center[i])
    return Bent(rotation, center, joint, frame, columns, inertia)


def joint_columns(model: Model, i: int) -> Floats:
    """(nv_i, 6) translation and rotation of the joint point per unit of each rate of joint i, joint frame."""
    ntrans, nrot = int(model.joint_ntrans[i]), int(model.joint_nrot[i])
    out = np.zeros((ntrans + nrot, 6))
    out[:ntrans, :3] = model.joint_trans_axes[i].reshape(3, 3)[:ntrans]
    if nrot == 1:
        out[ntrans, :3], out[ntrans, 3:] = model.joint_lead[i] * model.joint_axis[i], model.joint_axis[i]
    elif nrot > 1:
        out[ntrans:, 3:] = model.joint_swing_axes[i].reshape(2, 3) if nrot == 2 else np.eye(3)
    return out


def _about_origin(m: float, J: Floats, c: Floats) -> Floats:
    """6 x 6 spatial inertia of a body with its centre of mass at c."""
    out, cross = np.empty((6, 6)), _skew(c)
    out[:3, :3], out[:3, 3:] = m * np.eye(3), -m * cross
    out[3:, :3], out[3:, 3:] = m * cross, J - m * cross @ cross
    return out


def _skew(a: Floats) -> Floats:
    """[a], [a] b = a x b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def damper_inertias(model: Model) -> Floats:
    """(nv,) those of all degrees of freedom; ones where nothing is damped."""
    if not model.dof_damper.any():
        return np.ones(len(model.dof_damper))
    return damper_motions(model, bent(model))[0]


def damper_motions(model: Model, at: Bent) -> tuple[Floats, Floats]:
    """(I_d (nv,), motions x_d as columns (nv, nv))."""
    M = _mass_matrix(model, at)
    try:
        root = np.linalg.inv(np.linalg.cholesky(M))
        inverse = root.T @ root
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(M)
        inverse = (vectors / np.maximum(values, _SINGULAR * values[-1])) @ vectors.T
    seen = 1.0 / np.diag(inverse)
    return seen, inverse * seen


def _mass_matrix(model: Model, at: Bent) -> Floats:
    """M = sum of J^T inertia J + armature, (nv, nv), from the composite inertias of the branches."""
    composite, n = at.inertia.copy(), len(at.inertia)
    for i in range(n - 1, -1, -1):
        if model.body_parent[i] >= 0:
            composite[model.body_parent[i]] += composite[i]
    branch = np.eye(n, dtype=bool)  # bodies from the root to each of them
    for i, p in enumerate(model.body_parent):
        if p >= 0:
            branch[i] |= branch[p]
    momentum = np.einsum("dj,djk->dk", at.columns, composite[model.dof_body])
    lower = np.where(branch[model.dof_body][:, model.dof_body], momentum @ at.columns.T, 0.0)
    full = np.where(lower != 0.0, lower, lower.T)
    return np.asarray(full + np.diag(model.dof_armature))
