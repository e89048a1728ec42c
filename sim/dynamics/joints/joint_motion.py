"""Motion of one joint: the pose of its body, the columns that map its rates to twists, and the derivatives of both.

A joint is a row of translations along axes t_k of its frame, and then one rotation: none, about an axis a, a swing
(swing.py), or a quaternion. A rotation about an axis may carry its body along the axis: by its lead [m/rad] for each
radian, as a screw does; that of a hinge is zero. With Q the joint frame and o the joint point:

    pose       o + sum_k q_k R(Q) t_k + q lead R(Q) a,    Q quat_joint(q)
    columns    translation (R(Q) t_k, 0);    axis (o x a + lead a, a), a = R(Q) a;    swing and quaternion (o x b, b)
    over an interval, with E = R(turn of the parent) - I and columns at configuration 2
               translation, lead    dx + q E t + h v (t + E t)
               rotation             turn exp(h sum_k v_k a_k)

The walks down the tree (kinematics.py, displacements.py) see poses and columns only, whatever the kind of a joint.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

from sim.dynamics.joints.swing import swing_pose, swing_turn
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import inlined, kernel
from solvers.rotation import Mat3, Quat, Vec3, cross, quat_exp, quat_matrix, quat_mul, rotate, times
from solvers.types import Matrix, Vector


class Increment(NamedTuple):
    """Coordinates at configuration 2, and h v, by which they change."""

    q: Vector  # (nq,)
    v: Vector  # (nv,)
    h: float  # time step [s], negative for the way back to configuration 1


@kernel
def axis_column(S: Matrix, d: int, a0: float, a1: float, a2: float, x: float, y: float, z: float) -> None:
    """S[d] = (r x a, a): rotation about the axis a through the point r from O."""
    v0, v1, v2 = cross(x, y, z, a0, a1, a2)
    S[d, 0] = v0
    S[d, 1] = v1
    S[d, 2] = v2
    S[d, 3] = a0
    S[d, 4] = a1
    S[d, 5] = a2


@kernel
def add_lead(model: Model, i: int, d: int, S: Matrix) -> None:
    """S[d] += (lead a, 0), where S[d] = (r x a, a) and the rotation d of joint i has a lead."""
    lead = model.joint_lead[i]
    if lead != 0.0:
        s = S[d]
        s[0], s[1], s[2] = s[0] + lead * s[3], s[1] + lead * s[4], s[2] + lead * s[5]


# -- configuration 2 ---------------------------------------------------------------------------------------------------


@kernel
def translate(model: Model, q: Vector, i: int, o: Vec3, Q: Quat, S: Matrix) -> Vec3:
    """o + sum_k q_k R(Q) t_k over the translations of joint i; S: their columns (R(Q) t_k, 0)."""
    x, y, z = o
    R = quat_matrix(Q[0], Q[1], Q[2], Q[3])
    for k in range(model.joint_ntrans[i]):
        a = q[model.body_qadr[i] + k]
        s = S[model.body_vadr[i] + k]
        t = model.joint_trans_axes[i, 3 * k : 3 * k + 3]
        s[0], s[1], s[2] = times(R, t[0], t[1], t[2])
        s[3], s[4], s[5] = 0.0, 0.0, 0.0
        x, y, z = x + a * s[0], y + a * s[1], z + a * s[2]
    return x, y, z


@kernel
def joint_rotation(model: Model, q: Vector, i: int) -> Quat:
    """Rotation of joint i at the coordinates q, in its frame on the parent."""
    a = model.body_qadr[i] + model.joint_ntrans[i]
    if model.joint_nrot[i] == 1:
        c = cos(0.5 * q[a])
        s = sin(0.5 * q[a])
        t = model.joint_axis[i]
        return c, s * t[0], s * t[1], s * t[2]
    if model.joint_nrot[i] == 3:
        return q[a], q[a + 1], q[a + 2], q[a + 3]
    if model.joint_nrot[i] == 2:
        return swing_pose(model, i, q[a], q[a + 1])[0]
    return 1.0, 0.0, 0.0, 0.0


@kernel
def lead_along(model: Model, q: Vector, i: int, o: Vec3, R: Mat3) -> Vec3:
    """o + q lead R a of the rotation of joint i; the axis is the same before and after it, R: of its body."""
    lead = model.joint_lead[i]
    if lead == 0.0:
        return o
    t = model.joint_axis[i]
    x, y, z = times(R, t[0], t[1], t[2])
    a = lead * q[model.body_qadr[i + 1] - 1]
    return o[0] + a * x, o[1] + a * y, o[2] + a * z


@kernel
def rotation_columns(model: Model, q: Vector, i: int, R: Mat3, o: Vec3, S: Matrix) -> None:
    """Columns of the rotations of joint i, through o from O, in axes of its body, whose rotation is R."""
    n = model.joint_nrot[i]
    d = model.body_vadr[i + 1] - n
    if n == 1:  # the axis is the same before and after the rotation
        t = model.joint_axis[i]
        x, y, z = times(R, t[0], t[1], t[2])
        axis_column(S, d, x, y, z, o[0], o[1], o[2])
        add_lead(model, i, d, S)
    elif n == 2:
        a = model.body_qadr[i + 1] - 2
        _, first, second = swing_pose(model, i, q[a], q[a + 1])
        x, y, z = times(R, first[0], first[1], first[2])
        axis_column(S, d, x, y, z, o[0], o[1], o[2])
        x, y, z = times(R, second[0], second[1], second[2])
        axis_column(S, d + 1, x, y, z, o[0], o[1], o[2])
    elif n == 3:
        for k in range(3):
            axis_column(S, d + k, R[k], R[3 + k], R[6 + k], o[0], o[1], o[2])


# -- configurations 1 and 3, from 2 ------------------------------------------------------------------------------------


@kernel
def joint_turn(model: Model, data: Data, by: Increment, i: int) -> Quat:
    """Rotation of joint i by its increment, world axes at configuration 2."""
    n = model.joint_nrot[i]
    d = model.body_vadr[i + 1] - n
    if n == 2:
        a = model.body_qadr[i + 1] - 2
        c, x, y, z = swing_turn(model, i, by.q[a], by.q[a + 1], by.h * by.v[d], by.h * by.v[d + 1])
        x, y, z = rotate(data.rot2, i, x, y, z)
        return c, x, y, z
    x, y, z = 0.0, 0.0, 0.0
    for e in range(d, d + n):
        s = data.S2[e]
        a = by.h * by.v[e]
        x, y, z = x + a * s[3], y + a * s[4], z + a * s[5]
    return quat_exp(x, y, z)


@kernel
def turn_on(model: Model, data: Data, by: Increment, i: int, t: Quat) -> Quat:
    """The turn t of the parent, then that of joint i; with a scalar part that is not negative."""
    e = joint_turn(model, data, by, i)
    r = quat_mul(t[0], t[1], t[2], t[3], e[0], e[1], e[2], e[3])
    if r[0] < 0.0:
        return -r[0], -r[1], -r[2], -r[3]
    return r


@kernel
def slide(model: Model, data: Data, by: Increment, i: int, E: Mat3, dx: Vec3, S: Matrix) -> Vec3:
    """dx + sum_k q_k E t_k + h v_k (t_k + E t_k) over the translations of joint i; E of the parent, S their columns."""
    x, y, z = dx
    for k in range(model.joint_ntrans[i]):
        d = model.body_vadr[i] + k
        t = data.S2[d]
        s = S[d]
        g0, g1, g2 = times(E, t[0], t[1], t[2])
        s[0], s[1], s[2] = t[0] + g0, t[1] + g1, t[2] + g2
        s[3], s[4], s[5] = 0.0, 0.0, 0.0
        a = by.q[model.body_qadr[i] + k]
        b = by.h * by.v[d]
        x, y, z = x + a * g0 + b * s[0], y + a * g1 + b * s[1], z + a * g2 + b * s[2]
    return x, y, z


@kernel
def lead_on(model: Model, data: Data, by: Increment, i: int, E: Mat3, dx: Vec3) -> Vec3:
    """dx + lead (q E a + h v (a + E a)) of the rotation of joint i about a; E of the parent."""
    lead = model.joint_lead[i]
    if lead == 0.0:
        return dx
    d = model.body_vadr[i + 1] - 1
    s = data.S2[d]
    g0, g1, g2 = times(E, s[3], s[4], s[5])
    b = lead * by.h * by.v[d]
    a = lead * by.q[model.body_qadr[i + 1] - 1] + b
    return dx[0] + a * g0 + b * s[3], dx[1] + a * g1 + b * s[4], dx[2] + a * g2 + b * s[5]


@inlined
def turned_columns(model: Model, data: Data, i: int, E: Mat3, o: Vec3, S: Matrix) -> None:
    """Columns of the rotations of joint i: their axes at 2 turned with the parent, through o from O; E: of the parent.

    Not those of a joint with two rotations.
    """
    for d in range(model.body_vadr[i + 1] - model.joint_nrot[i], model.body_vadr[i + 1]):
        s = data.S2[d]
        x, y, z = times(E, s[3], s[4], s[5])
        axis_column(S, d, s[3] + x, s[4] + y, s[5] + z, o[0], o[1], o[2])
        add_lead(model, i, d, S)


@kernel
def swing_columns(model: Model, data: Data, theta: Vector, i: int, E: Mat3, o: Vec3, S: Matrix) -> None:
    """Columns of a joint with two rotations at the coordinates theta, through o from O; E: of its body."""
    a = model.body_qadr[i + 1] - 2
    d = model.body_vadr[i + 1] - 2
    _, first, second = swing_pose(model, i, theta[a], theta[a + 1])
    x, y, z = rotate(data.rot2, i, first[0], first[1], first[2])
    e = times(E, x, y, z)
    axis_column(S, d, x + e[0], y + e[1], z + e[2], o[0], o[1], o[2])
    x, y, z = rotate(data.rot2, i, second[0], second[1], second[2])
    e = times(E, x, y, z)
    axis_column(S, d + 1, x + e[0], y + e[1], z + e[2], o[0], o[1], o[2])


@inlined
def moved_columns(model: Model, data: Data, theta: Vector, i: int, E: Mat3, F: Mat3, o: Vec3, S: Matrix) -> None:
    """Columns of the rotations of joint i at theta, through o from O; E: of the parent, F: of its body."""
    if model.joint_nrot[i] == 2:
        swing_columns(model, data, theta, i, F, o, S)
    else:
        turned_columns(model, data, i, E, o, S)
