"""Derivatives of the coordinates of a joint by the poses of its two bodies: rows of the minimal Jacobian."""

from __future__ import annotations

from sim.dynamics.joints.coordinates import joint_frame, translation_axis
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.rotation import (
    Quat,
    Vec3,
    cross,
    inverse_right_jacobian,
    quat_log,
    quat_matrix,
    quat_mul,
    rotate,
    times,
)
from solvers.types import Matrix, Vector


@kernel
def joint_rows(model: Model, i: int, pos: Matrix, quat: Matrix, rot: Matrix, out: Matrix) -> None:
    """out[d] = d(coordinate d)/d(pose) of joint i: (child position, child rotation, parent position, parent rotation).

        translation     a . (dx_c - dx_p) + ((R c) x a) . phi_c - ((R c + x_c - x_p) x a) . phi_p,   a = R(Q) t_k
        one axis        a . (phi_c - phi_p)
        swing           a . (phi_c - phi_p),   a = R(Q) J(t)^-T V_k
        quaternion      R_c^T (phi_c - phi_p)

    World rotations; consistent poses.   out: (nv, 12 or more).
    """
    d, p = model.body_vadr[i], model.body_parent[i]
    for e in range(d, model.body_vadr[i + 1]):
        for k in range(12):
            out[e, k] = 0.0
    _, Q = joint_frame(model, i, pos, quat, rot)
    c = model.joint_child_point[i]
    cx, cy, cz = rotate(rot, i, c[0], c[1], c[2])
    px, py, pz = cx, cy, cz
    if p >= 0:
        px, py, pz = px + pos[i, 0] - pos[p, 0], py + pos[i, 1] - pos[p, 1], pz + pos[i, 2] - pos[p, 2]
    for k in range(model.joint_ntrans[i]):
        a = translation_axis(model, i, k, Q)
        mc = cross(cx, cy, cz, a[0], a[1], a[2])
        mp = cross(px, py, pz, a[0], a[1], a[2])
        for j in range(3):
            out[d, j] = a[j]
            out[d, 3 + j] = mc[j]
            out[d, 6 + j] = -a[j]
            out[d, 9 + j] = -mp[j]
        d += 1
    if model.joint_nrot[i] == 1:
        t = model.joint_axis[i]
        _turn_row(rotate(rot, i, t[0], t[1], t[2]), out[d])
    elif model.joint_nrot[i] == 2:
        t = joint_swing(i, Q, quat)
        J = inverse_right_jacobian(t[0], t[1], t[2])
        R = quat_matrix(Q[0], Q[1], Q[2], Q[3])
        for k in range(2):
            V = model.joint_swing_axes[i, 3 * k : 3 * k + 3]
            b = times(J, V[0], V[1], V[2])
            _turn_row(times(R, b[0], b[1], b[2]), out[d + k])
    elif model.joint_nrot[i] == 3:
        for k in range(3):
            _turn_row((rot[i, k], rot[i, 3 + k], rot[i, 6 + k]), out[d + k])


@kernel
def _turn_row(a: Vec3, out: Vector) -> None:
    """a . (phi_c - phi_p)"""
    for j in range(3):
        out[3 + j] = a[j]
        out[9 + j] = -a[j]


@kernel
def joint_swing(i: int, Q: Quat, quat: Matrix) -> Vec3:
    """log(Q^* quat): rotation vector of a swing, from the frame Q of its joint."""
    r = quat_mul(Q[0], -Q[1], -Q[2], -Q[3], quat[i, 0], quat[i, 1], quat[i, 2], quat[i, 3])
    return quat_log(r[0], r[1], r[2], r[3])
