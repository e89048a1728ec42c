"""Displacements of the bodies over an interval: the poses at configurations 3 and 1 from those at 2, down the tree.

A velocity is a displacement over h. As a difference of two poses it would carry their rounding, eps |x|/h; here every
displacement is that of the parent plus that of the joint, rounded to eps |h v|:

    turn       T = T_parent exp(h sum_k v_k a_k),  a_k the axes of the joint at 2;  see joints/joint_motion.py
    rotation   R = R2 + E R2,   E = R(T) - I
    joint      dx = dx_parent + E_parent (R_parent p_parent) + sum_k q_k E_parent t_k + h v_k (t_k + E_parent t_k)
    body       dx - E (R2 p_child)
"""

from __future__ import annotations

from sim.dynamics.joints.joint_motion import Increment, lead_on, moved_columns, slide, turn_on
from sim.dynamics.kinematics import displace
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.rotation import Mat3, Quat, Vec3, quat_mul, rows_of, times
from solvers.types import Matrix, Vector


@kernel
def turn_matrix(T: Quat) -> Mat3:
    """E = R(T) - I = 2 (c [s] + [s]^2),   T = (c, s)"""
    c, x, y, z = T
    return (
        -2.0 * (y * y + z * z), 2.0 * (x * y - c * z), 2.0 * (x * z + c * y),
        2.0 * (x * y + c * z), -2.0 * (x * x + z * z), 2.0 * (y * z - c * x),
        2.0 * (x * z - c * y), 2.0 * (y * z + c * x), -2.0 * (x * x + y * y),
    )  # fmt: skip


@kernel
def parent_move(data: Data, i: int, p: int, move: Matrix, turn: Matrix) -> tuple[Quat, Mat3, Vec3]:
    """Turn T and E = R(T) - I of the parent p of body i, and the displacement of the joint frame; none of the world."""
    if p < 0:
        return (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    arm = data.arm[i]
    E = rows_of(data.turn_matrix, p)
    x, y, z = times(E, arm[0], arm[1], arm[2])
    t = (turn[p, 0], turn[p, 1], turn[p, 2], turn[p, 3])
    return t, E, (move[p, 0] + x, move[p, 1] + y, move[p, 2] + z)


@kernel
def tree_displacements(model: Model, data: Data, by: Increment, third: bool) -> None:
    """Positions of all bodies at configuration 3, or 1, from configuration 2, turns, and unit joint columns.

    Fills theta3, pos3, S3, and over the interval 2-3 move and turn; or theta1, pos1, S1, and over the interval 1-2
    move_in and turn_in; and turn_matrix, with which `turn_bodies` makes rot3 or rot1.

    Columns: the axes at 2 turned with the parent. Those of a quaternion joint, the axes of the body at 2, are then
    derivatives with respect to a right perturbation of q2 at a constant increment, which follows the perturbed
    quaternion.
    """
    theta = data.theta3 if third else data.theta1
    pos = data.pos3 if third else data.pos1
    S = data.S3 if third else data.S1
    move = data.move if third else data.move_in
    turn = data.turn if third else data.turn_in
    O = data.origin
    displace(model, by.q, by.v, by.h, theta)
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        arm = data.arm[i]
        t, E, dx = parent_move(data, i, p, move, turn)
        if model.joint_ntrans[i] > 0:
            dx = slide(model, data, by, i, E, dx, S)
        dx = lead_on(model, data, by, i, E, dx)
        o = (
            data.pos2[i, 0] - O[0] + arm[3] + dx[0],
            data.pos2[i, 1] - O[1] + arm[4] + dx[1],
            data.pos2[i, 2] - O[2] + arm[5] + dx[2],
        )
        if model.joint_nrot[i] > 0:
            t = turn_on(model, data, by, i, t)
            F = turn_matrix(t)
            moved_columns(model, data, theta, i, E, F, o, S)
            E = F
        x, y, z = times(E, arm[3], arm[4], arm[5])
        dx = (dx[0] - x, dx[1] - y, dx[2] - z)
        for k in range(9):
            data.turn_matrix[i, k] = E[k]
        for k in range(4):
            turn[i, k] = t[k]
        for k in range(3):
            move[i, k] = dx[k]
            pos[i, k] = data.pos2[i, k] + dx[k]


@kernel
def turn_bodies(data: Data, out: Matrix) -> None:
    """out = R2 + E R2 of all bodies, with the turn matrices of the last `tree_displacements`.   out: (nbody, 9)."""
    for i in range(out.shape[0]):
        E = rows_of(data.turn_matrix, i)
        R = rows_of(data.rot2, i)
        a = times(E, R[0], R[3], R[6])
        b = times(E, R[1], R[4], R[7])
        c = times(E, R[2], R[5], R[8])
        r = out[i]
        r[0], r[1], r[2] = R[0] + a[0], R[1] + b[0], R[2] + c[0]
        r[3], r[4], r[5] = R[3] + a[1], R[4] + b[1], R[5] + c[1]
        r[6], r[7], r[8] = R[6] + a[2], R[7] + b[2], R[8] + c[2]


@kernel
def previous_displacements(model: Model, data: Data, h: float, q: Vector, v: Vector) -> None:
    """Configuration 1, and the interval 1-2, of the state (q, v) whose configuration 2 is in `data`."""
    tree_displacements(model, data, Increment(q, v, -h), False)
    turn_bodies(data, data.rot1)
    for i in range(data.move_in.shape[0]):  # from 2 to 1 so far
        for k in range(3):
            data.move_in[i, k] = -data.move_in[i, k]
            data.turn_in[i, 1 + k] = -data.turn_in[i, 1 + k]


@kernel
def other_quaternions(data: Data) -> None:
    """quat1 and quat3, from the rotation increments; only derivatives by parameters need them."""
    for i in range(data.quat2.shape[0]):
        b = data.quat2[i]
        t = data.turn_in[i]
        a = quat_mul(t[0], -t[1], -t[2], -t[3], b[0], b[1], b[2], b[3])
        c = third_quaternion(data, i)
        for k in range(4):
            data.quat1[i, k] = a[k]
            data.quat3[i, k] = c[k]


@kernel
def third_quaternion(data: Data, i: int) -> Quat:
    """Orientation of body i at configuration 3."""
    t = data.turn[i]
    b = data.quat2[i]
    return quat_mul(t[0], t[1], t[2], t[3], b[0], b[1], b[2], b[3])
