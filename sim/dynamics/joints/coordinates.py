"""Coordinates of one joint from the poses of its bodies: the inverse of joint_motion.py."""

from __future__ import annotations

from math import atan2, floor, pi

from sim.dynamics.joints.swing_coordinates import swing_component, swing_of
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.rotation import Quat, Vec3, quat_log, quat_matrix, quat_mul, rotate
from solvers.types import Matrix, Vector


@kernel
def joint_frame(model: Model, i: int, pos: Matrix, quat: Matrix, rot: Matrix) -> tuple[Vec3, Quat]:
    """Origin and orientation, in the world, of the joint frame that joint i has on its parent."""
    b = model.joint_parent_point[i]
    f = model.joint_offset[i]
    p = model.body_parent[i]
    if p < 0:
        return (b[0], b[1], b[2]), (f[0], f[1], f[2], f[3])
    x, y, z = rotate(rot, p, b[0], b[1], b[2])
    Q = quat_mul(quat[p, 0], quat[p, 1], quat[p, 2], quat[p, 3], f[0], f[1], f[2], f[3])
    return (pos[p, 0] + x, pos[p, 1] + y, pos[p, 2] + z), Q


@kernel
def translation_axis(model: Model, i: int, k: int, Q: Quat) -> Vec3:
    """Free translation k of joint i in the world, R(Q) t_k."""
    R = quat_matrix(Q[0], Q[1], Q[2], Q[3])
    t = model.joint_trans_axes[i, 3 * k : 3 * k + 3]
    return (
        R[0] * t[0] + R[1] * t[1] + R[2] * t[2],
        R[3] * t[0] + R[4] * t[1] + R[5] * t[2],
        R[6] * t[0] + R[7] * t[1] + R[8] * t[2],
    )


@kernel
def axis_angle(model: Model, i: int, r: Quat) -> float:
    """Angle in [-pi, pi] of the rotation r about the axis of joint i."""
    a = model.joint_axis[i]
    s = 2.0 * atan2(a[0] * r[1] + a[1] * r[2] + a[2] * r[3], r[0])
    if s > pi:
        return s - 2.0 * pi
    if s < -pi:
        return s + 2.0 * pi
    return s


@kernel
def _relative(model: Model, i: int, pos: Matrix, quat: Matrix, rot: Matrix) -> tuple[Vec3, Quat, Quat]:
    """Joint i from the poses: world displacement from its frame, orientation Q of the frame, and rotation Q^* q."""
    o, Q = joint_frame(model, i, pos, quat, rot)
    c = model.joint_child_point[i]
    x, y, z = rotate(rot, i, c[0], c[1], c[2])
    d = (pos[i, 0] + x - o[0], pos[i, 1] + y - o[1], pos[i, 2] + z - o[2])
    return d, Q, quat_mul(Q[0], -Q[1], -Q[2], -Q[3], quat[i, 0], quat[i, 1], quat[i, 2], quat[i, 3])


@kernel
def whole_turns(model: Model, i: int, angle: float, Q: Quat, d: Vec3) -> float:
    """The angle about the axis of joint i, with the whole turns that its lead shows: those nearest to d . a / lead."""
    lead = model.joint_lead[i]
    if lead == 0.0:
        return angle
    t = model.joint_axis[i]
    R = quat_matrix(Q[0], Q[1], Q[2], Q[3])
    along = 0.0
    for k in range(3):
        along += d[k] * (R[3 * k] * t[0] + R[3 * k + 1] * t[1] + R[3 * k + 2] * t[2])
    return angle + 2.0 * pi * floor((along / lead - angle) / (2.0 * pi) + 0.5)


@kernel
def joint_coordinates(model: Model, data: Data, h: float, i: int, q: Vector, v: Vector) -> None:
    """Coordinates and velocities of joint i, in q and v, from the poses at configurations 2 and 1.

        translations    q_k = R(Q) t_k . d                   v = (q2 - q1)/h
        one axis        angle of r2 = Q2^* quat2 about it    v = angle of r1^* r2 / h
        swing           log(r2), across the axis             v = (log(r2) - log(r1))/h
        quaternion      r2, with nonnegative scalar part     v = log(r1^* r2)/h

    d: from the joint frame on the parent to the joint point of the child. An angle is in [-pi, pi]; with a lead, in any
    turn.
    """
    a = model.body_qadr[i]
    d = model.body_vadr[i]
    d2, Q2, r2 = _relative(model, i, data.pos2, data.quat2, data.rot2)
    d1, Q1, r1 = _relative(model, i, data.pos1, data.quat1, data.rot1)
    for k in range(model.joint_ntrans[i]):
        t2 = translation_axis(model, i, k, Q2)
        t1 = translation_axis(model, i, k, Q1)
        q[a] = t2[0] * d2[0] + t2[1] * d2[1] + t2[2] * d2[2]
        v[d] = (q[a] - t1[0] * d1[0] - t1[1] * d1[1] - t1[2] * d1[2]) / h
        a += 1
        d += 1
    e = quat_mul(r1[0], -r1[1], -r1[2], -r1[3], r2[0], r2[1], r2[2], r2[3])
    if model.joint_nrot[i] == 1:
        q[a] = whole_turns(model, i, axis_angle(model, i, r2), Q2, d2)
        v[d] = axis_angle(model, i, e) / h
    elif model.joint_nrot[i] == 2:
        s2 = quat_log(r2[0], r2[1], r2[2], r2[3])
        s1 = swing_of(r1, s2)
        for k in range(2):
            q[a + k] = swing_component(model, i, k, s2)
            v[d + k] = (q[a + k] - swing_component(model, i, k, s1)) / h
    elif model.joint_nrot[i] == 3:
        sign = 1.0 if r2[0] >= 0.0 else -1.0
        w = quat_log(e[0], e[1], e[2], e[3])
        for k in range(4):
            q[a + k] = sign * r2[k]
        for k in range(3):
            v[d + k] = w[k] / h
