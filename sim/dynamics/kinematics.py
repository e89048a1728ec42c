"""Walk down the tree: poses of the bodies, and the joint columns that turn joint rates into body twists.

All twists are about one common point O in world axes, so that a body's twist is the plain sum of the columns of its
ancestors times their rates, and the wrench on a subtree the plain sum of the wrenches on its bodies: no transports.
"""

from __future__ import annotations

from sim.dynamics.joints.joint_motion import joint_rotation, lead_along, rotation_columns, translate
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.rotation import left_jacobian, quat_exp, quat_matrix, quat_mul, rotate, times
from solvers.types import Matrix, Vector


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
def tree_poses(model: Model, data: Data, q: Vector) -> None:
    """Poses of all bodies at configuration 2, whose coordinates are q, and unit joint columns about O.

        joint frame   Q = quat_parent offset,   o = pos_parent + R_parent p_parent + displacement of the joint
        body          quat = Q quat_joint(q),   pos = o - R p_child
        columns       see joints/joint_motion.py

    Fills pos2, quat2, rot2, S2, and arm = (R_parent p_parent, R p_child), without R_parent where that is the world.
    """
    pos, quat, rot, S, O = data.pos2, data.quat2, data.rot2, data.S2, data.origin
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        b = model.joint_parent_point[i]
        f = model.joint_offset[i]
        r = (b[0], b[1], b[2])
        Q = (f[0], f[1], f[2], f[3])
        o = r
        if p >= 0:
            r = rotate(rot, p, b[0], b[1], b[2])
            Q = quat_mul(quat[p, 0], quat[p, 1], quat[p, 2], quat[p, 3], f[0], f[1], f[2], f[3])
            o = (pos[p, 0] + r[0], pos[p, 1] + r[1], pos[p, 2] + r[2])
        if model.joint_ntrans[i] > 0:
            o = translate(model, q, i, o, Q, S)
        g = Q
        if model.joint_nrot[i] > 0:
            t = joint_rotation(model, q, i)
            g = quat_mul(Q[0], Q[1], Q[2], Q[3], t[0], t[1], t[2], t[3])
        R = quat_matrix(g[0], g[1], g[2], g[3])
        o = lead_along(model, q, i, o, R)
        for k in range(4):
            quat[i, k] = g[k]
        for k in range(9):
            rot[i, k] = R[k]
        rotation_columns(model, q, i, R, (o[0] - O[0], o[1] - O[1], o[2] - O[2]), S)
        c = model.joint_child_point[i]
        e = times(R, c[0], c[1], c[2])
        for k in range(3):
            data.arm[i, k] = r[k]
            data.arm[i, 3 + k] = e[k]
            pos[i, k] = o[k] - e[k]


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
