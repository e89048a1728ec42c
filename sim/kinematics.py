"""Walk down the tree: poses of the bodies, and the joint columns that turn joint rates into body twists.

All twists are about one common point O in world axes, so that a body's twist is the plain sum of the columns of its
ancestors times their rates, and the wrench on a subtree the plain sum of the wrenches on its bodies: no transports.
"""

from __future__ import annotations

from math import cos, sin

from sim.model import Matrix, Model, Vector
from sim.rotation import cross, left_jacobian, quat_exp, quat_matrix, quat_mul, rotate
from sim.swing import swing_pose
from solvers.jit import kernel


@kernel
def displace(model: Model, q: Vector, v: Vector, h: float, out: Vector) -> None:
    """out = q (+) h v: the exponential map of the joint coordinates.

    scalar coordinates    out = q + h v
    quaternions           out = q exp(h w), normalised
    """
    for i in range(model.body_parent.shape[0]):
        a = model.body_qadr[i]
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        quaternion = model.joint_nrot[i] == 3
        if quaternion:
            n -= 3
        for _ in range(n):
            out[a] = q[a] + h * v[d]
            a += 1
            d += 1
        if quaternion:
            e = quat_exp(h * v[d], h * v[d + 1], h * v[d + 2])
            r = quat_mul(q[a], q[a + 1], q[a + 2], q[a + 3], e[0], e[1], e[2], e[3])
            n = 1.0 / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]) ** 0.5
            for k in range(4):
                out[a + k] = r[k] * n


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
def tree_poses(
    model: Model, q: Vector, q2: Vector, origin: Vector, pos: Matrix, quat: Matrix, rot: Matrix, S: Matrix
) -> None:
    """Poses of all bodies at the coordinates q, and unit joint columns S about `origin`.

        joint frame   Q = quat_parent offset,   o = pos_parent + R_parent p_parent + sum_k q_k R(Q) t_k
        body          quat = Q quat_joint(q),   pos = o - R p_child
        columns       translation (R(Q) t_k, 0);  axis ((o - O) x a, a), a = R(Q) axis, of a swing see swing.py;
                      quaternion: the three axes of Q quat_joint(q2)

    q2 are the coordinates at configuration 2, always: so the columns are derivatives with respect to a right
    perturbation of q2 at a constant increment (theory: the increment follows the perturbed quaternion).
    pos: (nbody, 3), quat: (nbody, 4), rot: (nbody, 9), S: (nv, 6); all overwritten.
    """
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        b = model.joint_parent_point[i]
        f = model.joint_offset[i]
        if p >= 0:
            ox, oy, oz = rotate(rot, p, b[0], b[1], b[2])
            ox += pos[p, 0]
            oy += pos[p, 1]
            oz += pos[p, 2]
            f0, f1, f2, f3 = quat_mul(quat[p, 0], quat[p, 1], quat[p, 2], quat[p, 3], f[0], f[1], f[2], f[3])
        else:
            ox, oy, oz = b[0], b[1], b[2]
            f0, f1, f2, f3 = f[0], f[1], f[2], f[3]
        a = model.body_qadr[i]
        d = model.body_vadr[i]
        if model.joint_ntrans[i] > 0:
            r = quat_matrix(f0, f1, f2, f3)
            for k in range(model.joint_ntrans[i]):
                e = model.joint_trans_axes[i, 3 * k : 3 * k + 3]
                tx = r[0] * e[0] + r[1] * e[1] + r[2] * e[2]
                ty = r[3] * e[0] + r[4] * e[1] + r[5] * e[2]
                tz = r[6] * e[0] + r[7] * e[1] + r[8] * e[2]
                ox += tx * q[a]
                oy += ty * q[a]
                oz += tz * q[a]
                S[d, 0] = tx
                S[d, 1] = ty
                S[d, 2] = tz
                S[d, 3] = 0.0
                S[d, 4] = 0.0
                S[d, 5] = 0.0
                a += 1
                d += 1
        if model.joint_nrot[i] == 1:
            cq = cos(0.5 * q[a])
            sq = sin(0.5 * q[a])
            t = model.joint_axis[i]
            g0, g1, g2, g3 = quat_mul(f0, f1, f2, f3, cq, sq * t[0], sq * t[1], sq * t[2])
        elif model.joint_nrot[i] == 3:
            g0, g1, g2, g3 = quat_mul(f0, f1, f2, f3, q[a], q[a + 1], q[a + 2], q[a + 3])
        elif model.joint_nrot[i] == 2:
            turn, first, second = swing_pose(model, i, q[a], q[a + 1])
            g0, g1, g2, g3 = quat_mul(f0, f1, f2, f3, turn[0], turn[1], turn[2], turn[3])
        else:
            g0, g1, g2, g3 = f0, f1, f2, f3
        quat[i, 0] = g0
        quat[i, 1] = g1
        quat[i, 2] = g2
        quat[i, 3] = g3
        r = quat_matrix(g0, g1, g2, g3)
        for k in range(9):
            rot[i, k] = r[k]
        if model.joint_nrot[i] == 1:  # the axis is the same before and after the rotation
            ax, ay, az = rotate(rot, i, t[0], t[1], t[2])
            axis_column(S, d, ax, ay, az, ox - origin[0], oy - origin[1], oz - origin[2])
        elif model.joint_nrot[i] == 3:
            g0, g1, g2, g3 = quat_mul(f0, f1, f2, f3, q2[a], q2[a + 1], q2[a + 2], q2[a + 3])
            r = quat_matrix(g0, g1, g2, g3)
            for k in range(3):
                axis_column(S, d + k, r[k], r[3 + k], r[6 + k], ox - origin[0], oy - origin[1], oz - origin[2])
        elif model.joint_nrot[i] == 2:
            ax, ay, az = rotate(rot, i, first[0], first[1], first[2])
            axis_column(S, d, ax, ay, az, ox - origin[0], oy - origin[1], oz - origin[2])
            ax, ay, az = rotate(rot, i, second[0], second[1], second[2])
            axis_column(S, d + 1, ax, ay, az, ox - origin[0], oy - origin[1], oz - origin[2])
        m = model.joint_child_point[i]
        cx, cy, cz = rotate(rot, i, m[0], m[1], m[2])
        pos[i, 0] = ox - cx
        pos[i, 1] = oy - cy
        pos[i, 2] = oz - cz


@kernel
def velocity_columns(model: Model, S: Matrix, v: Vector, h: float, out: Matrix) -> None:
    """out = d(pose)/d(v) at the end of a step: h S, and h S J(h w) for quaternion joints.  S, out: (nv, 6)."""
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        if model.joint_nrot[i] == 3:
            n -= 3
            e = d + n
            J = left_jacobian(h * v[e], h * v[e + 1], h * v[e + 2])
            for k in range(6):
                a = h * S[e, k]
                b = h * S[e + 1, k]
                c = h * S[e + 2, k]
                out[e, k] = a * J[0] + b * J[3] + c * J[6]
                out[e + 1, k] = a * J[1] + b * J[4] + c * J[7]
                out[e + 2, k] = a * J[2] + b * J[5] + c * J[8]
        for e in range(d, d + n):
            for k in range(6):
                out[e, k] = h * S[e, k]
