"""Maximal states z (nbody, 13) = [position, velocity, quaternion, angular velocity] from states x, and back.

Velocities are the mean ones of the interval that led to the node, vel = (x2 - x1)/h in world and omega = log(q1^* q2)/h
in body axes, so that
both states describe the same pair of configurations and the maps are inverse to each other exactly.
"""

from __future__ import annotations

from math import atan2, pi

from sim.dynamics.displacements import move_back
from sim.dynamics.joints.swing_coordinates import swing_component, swing_of
from sim.dynamics.kinematics import tree_poses
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.rotation import Quat, Vec3, quat_exp, quat_log, quat_matrix, quat_mul, rotate, transposed_times
from solvers.types import Matrix, Vector


@kernel
def node_poses(model: Model, data: Data, h: float, x: Vector) -> None:
    """Poses and joint columns at configurations 2 and 1 of a state, about the origin of the world, and moves."""
    nv = model.dof_body.shape[0]
    nq = x.shape[0] - nv
    for k in range(3):
        data.origin[k] = 0.0
    tree_poses(model, data, x[:nq])
    move_back(model, data, h, x[:nq], x[nq:])


@kernel
def body_turn(data: Data, i: int) -> Vec3:
    """log(q1^* q2) of body i: its rotation over the last interval, body axes [rad]."""
    t = data.turn_in[i]
    x, y, z = quat_log(t[0], t[1], t[2], t[3])
    return transposed_times(data.rot2[i], x, y, z)


@kernel
def maximal_state(model: Model, data: Data, h: float, x: Vector, out: Matrix) -> None:
    """out[i] = [x2, (x2 - x1)/h, q2, log(q1^* q2)/h].   out: (nbody, 13)."""
    node_poses(model, data, h, x)
    for i in range(model.body_parent.shape[0]):
        w = body_turn(data, i)
        for k in range(3):
            out[i, k] = data.pos2[i, k]
            out[i, 3 + k] = data.move_in[i, k] / h
            out[i, 10 + k] = w[k] / h
        for k in range(4):
            out[i, 6 + k] = data.quat2[i, k]


@kernel
def poses_of_maximal(data: Data, h: float, z: Matrix) -> None:
    """Configurations 2 and 1 of the bodies: x1 = x2 - h vel, q1 = q2 exp(-h omega)."""
    for i in range(z.shape[0]):
        for k in range(3):
            data.pos2[i, k] = z[i, k]
            data.pos1[i, k] = z[i, k] - h * z[i, 3 + k]
        e = quat_exp(-h * z[i, 10], -h * z[i, 11], -h * z[i, 12])
        r = quat_mul(z[i, 6], z[i, 7], z[i, 8], z[i, 9], e[0], e[1], e[2], e[3])
        R2 = quat_matrix(z[i, 6], z[i, 7], z[i, 8], z[i, 9])
        R1 = quat_matrix(r[0], r[1], r[2], r[3])
        for k in range(4):
            data.quat2[i, k] = z[i, 6 + k]
            data.quat1[i, k] = r[k]
        for k in range(9):
            data.rot2[i, k] = R2[k]
            data.rot1[i, k] = R1[k]


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
def minimal_state(model: Model, data: Data, h: float, z: Matrix, out: Vector) -> None:
    """out = x with maximal_state(x) = z; angles of one-axis joints in [-pi, pi].

        translations    q_k = R(Q) t_k . d                   v = (q2 - q1)/h
        one axis        angle of r2 = Q2^* quat2 about it    v = angle of r1^* r2 / h
        swing           log(r2), across the axis             v = (log(r2) - log(r1))/h
        quaternion      r2, with nonnegative scalar part     v = log(r1^* r2)/h

    d: from the joint frame on the parent to the joint point of the child. Of poses that violate a joint, the part along
    its free directions is kept.   z: (nbody, 13); out: (nq + nv,).
    """
    nq = out.shape[0] - model.dof_body.shape[0]
    poses_of_maximal(data, h, z)
    for i in range(model.body_parent.shape[0]):
        a = model.body_qadr[i]
        d = nq + model.body_vadr[i]
        d2, Q2, r2 = _relative(model, i, data.pos2, data.quat2, data.rot2)
        d1, Q1, r1 = _relative(model, i, data.pos1, data.quat1, data.rot1)
        for k in range(model.joint_ntrans[i]):
            t2 = translation_axis(model, i, k, Q2)
            t1 = translation_axis(model, i, k, Q1)
            out[a] = t2[0] * d2[0] + t2[1] * d2[1] + t2[2] * d2[2]
            out[d] = (out[a] - t1[0] * d1[0] - t1[1] * d1[1] - t1[2] * d1[2]) / h
            a += 1
            d += 1
        e = quat_mul(r1[0], -r1[1], -r1[2], -r1[3], r2[0], r2[1], r2[2], r2[3])
        if model.joint_nrot[i] == 1:
            out[a] = axis_angle(model, i, r2)
            out[d] = axis_angle(model, i, e) / h
        elif model.joint_nrot[i] == 2:
            s2 = quat_log(r2[0], r2[1], r2[2], r2[3])
            s1 = swing_of(r1, s2)
            for k in range(2):
                out[a + k] = swing_component(model, i, k, s2)
                out[d + k] = (out[a + k] - swing_component(model, i, k, s1)) / h
        elif model.joint_nrot[i] == 3:
            sign = 1.0 if r2[0] >= 0.0 else -1.0
            w = quat_log(e[0], e[1], e[2], e[3])
            for k in range(4):
                out[a + k] = sign * r2[k]
            for k in range(3):
                out[d + k] = w[k] / h


@kernel
def maximal_states(model_at: Table, data_at: Table, h: float, xs: Matrix, out: Matrix) -> None:
    """`maximal_state` row by row.   xs: (n, nx); out: (n * nbody, 13)."""
    model = model_view(model_at)
    data = data_view(data_at)
    nbody = model.body_parent.shape[0]
    for t in range(xs.shape[0]):
        maximal_state(model, data, h, xs[t], out[t * nbody : (t + 1) * nbody])


@kernel
def minimal_states(model_at: Table, data_at: Table, h: float, zs: Matrix, out: Matrix) -> None:
    """`minimal_state` row by row.   zs: (n * nbody, 13); out: (n, nx)."""
    model = model_view(model_at)
    data = data_view(data_at)
    nbody = model.body_parent.shape[0]
    for t in range(out.shape[0]):
        minimal_state(model, data, h, zs[t * nbody : (t + 1) * nbody], out[t])
