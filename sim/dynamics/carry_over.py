"""Transition from one step of a motion to the next: configurations 2 and 3 become configurations 1 and 2."""

from __future__ import annotations

from sim.dynamics.displacements import third_quaternion
from sim.dynamics.joints.joint_motion import axis_column
from sim.dynamics.kinematics import tree_poses
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross, quat_exp, quat_matrix, rotate, rows_of, times
from solvers.types import Matrix, Vector

_MAX_CARRIED_STEPS = 16  # steps until poses are computed from coordinates


@kernel
def continues_motion(data: Data, q: Vector, v: Vector) -> bool:
    """Whether (q, v) is where the last step of this motion ended, with its configurations still in `data`."""
    if data.carry.steps[0] == 0:
        return False
    for k in range(q.shape[0]):
        if q[k] != data.theta3[k]:
            return False
    for d in range(v.shape[0]):
        if v[d] != data.nu[d]:
            return False
    return True


@kernel
def _shift(S: Matrix, x: float, y: float, z: float, out: Matrix) -> None:
    """Columns about a point that lies (x, y, z) before the present one: v + (x, y, z) x a."""
    for d in range(S.shape[0]):
        s = S[d]
        o = out[d]
        u, v, w = cross(x, y, z, s[3], s[4], s[5])
        o[0], o[1], o[2] = s[0] + u, s[1] + v, s[2] + w
        o[3], o[4], o[5] = s[3], s[4], s[5]


@kernel
def _axis(model: Model, data: Data, i: int, d: int, a: Vec3, pos: Matrix, rot: Matrix, S: Matrix) -> None:
    """Column d: rotation about the axis a through the joint of body i, at the poses pos and rot."""
    c = model.joint_child_point[i]
    o = data.origin
    x, y, z = rotate(rot, i, c[0], c[1], c[2])
    axis_column(S, d, a[0], a[1], a[2], pos[i, 0] + x - o[0], pos[i, 1] + y - o[1], pos[i, 2] + z - o[2])


@kernel
def _hand_on(model: Model, data: Data) -> None:
    """Poses of configurations 2 and 3 to 1 and 2, and the interval 2-3 to 1-2."""
    for i in range(model.body_parent.shape[0]):
        t = third_quaternion(data, i)
        p = model.body_parent[i]
        arm = data.arm[i]
        if p >= 0:
            x, y, z = times(rows_of(data.turn_matrix, p), arm[0], arm[1], arm[2])
            arm[0], arm[1], arm[2] = arm[0] + x, arm[1] + y, arm[2] + z
        x, y, z = times(rows_of(data.turn_matrix, i), arm[3], arm[4], arm[5])
        arm[3], arm[4], arm[5] = arm[3] + x, arm[4] + y, arm[5] + z
        for k in range(3):
            data.pos1[i, k] = data.pos2[i, k]
            data.pos2[i, k] = data.pos3[i, k]
            data.move_in[i, k] = data.move[i, k]
        for k in range(4):
            data.quat2[i, k] = t[k]
            data.turn_in[i, k] = data.turn[i, k]
        for k in range(9):
            data.rot1[i, k] = data.rot2[i, k]
            data.rot2[i, k] = data.rot3[i, k]


@kernel
def arriving_momenta(data: Data) -> None:
    """momentum_in = (p, P - (x2 - x1) x p) of the momentum (p, P) that left configuration 1.

    The last term is zero but for the rounding of x2, which would change x x p; with it, that total stays.
    """
    for i in range(data.pos2.shape[0]):
        a, b = data.pos1[i], data.pos2[i]
        p = data.momentum_out[i]
        x, y, z = cross(b[0] - a[0], b[1] - a[1], b[2] - a[2], p[0], p[1], p[2])
        for k in range(3):
            data.momentum_in[i, k] = p[k]
        data.momentum_in[i, 3], data.momentum_in[i, 4], data.momentum_in[i, 5] = p[3] - x, p[4] - y, p[5] - z


@kernel
def advance(model: Model, data: Data, h: float, q: Vector, v: Vector, before: Vec3) -> None:
    """Configurations 1 and 2 from 2 and 3 of the step before, whose common point O was `before`; momentum_in.

    Columns stay those of the same poses, about the new O; but for quaternion joints, whose axes are those of the new
    configuration 2: R2 of the body itself, and R1 exp(h w).

    Configuration 3 is 2 and a displacement, rounded: at regular intervals, 2 is computed from its coordinates anew.
    """
    _hand_on(model, data)
    x, y, z = before[0] - data.origin[0], before[1] - data.origin[1], before[2] - data.origin[2]
    _shift(data.S2, x, y, z, data.S1)
    _shift(data.S3, x, y, z, data.S2)
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 3:
            d = model.body_vadr[i + 1] - 3
            e = quat_exp(h * v[d], h * v[d + 1], h * v[d + 2])
            E = quat_matrix(e[0], e[1], e[2], e[3])
            for k in range(3):
                a = rotate(data.rot1, i, E[k], E[3 + k], E[6 + k])
                _axis(model, data, i, d + k, a, data.pos1, data.rot1, data.S1)
                a = (data.rot2[i, k], data.rot2[i, 3 + k], data.rot2[i, 6 + k])
                _axis(model, data, i, d + k, a, data.pos2, data.rot2, data.S2)
    if data.carry.steps[0] % _MAX_CARRIED_STEPS == 0:
        tree_poses(model, data, q)
    arriving_momenta(data)
