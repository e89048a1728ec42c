"""Maximal states z (nbody, 13) = [position, velocity, quaternion, angular velocity] from states x, and back.

Velocities are the mean ones of the interval that led to the node, vel = (x2 - x1)/h in world and omega = log(q1^* q2)/h
in body axes, so that
both states describe the same pair of configurations and the maps are inverse to each other exactly.
"""

from __future__ import annotations

from sim.dynamics.displacements import previous_displacements
from sim.dynamics.joints.coordinates import joint_coordinates
from sim.dynamics.kinematics import tree_poses
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.state_columns import BodyColumn
from solvers.compiler import Table, kernel
from solvers.rotation import Vec3, quat_exp, quat_log, quat_matrix, quat_mul, transposed_times
from solvers.types import Matrix, Vector


@kernel
def node_poses(model: Model, data: Data, h: float, x: Vector) -> None:
    """Poses and joint columns at configurations 2 and 1 of a state, about the origin of the world, and moves."""
    nv = model.dof_body.shape[0]
    nq = x.shape[0] - nv
    for k in range(3):
        data.origin[k] = 0.0
    tree_poses(model, data, x[:nq])
    previous_displacements(model, data, h, x[:nq], x[nq:])


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
            data.pos1[i, k] = z[i, k] - h * z[i, BodyColumn.VELOCITY + k]
        q, w = z[i, BodyColumn.QUATERNION : BodyColumn.SPIN], z[i, BodyColumn.SPIN :]
        e = quat_exp(-h * w[0], -h * w[1], -h * w[2])
        r = quat_mul(q[0], q[1], q[2], q[3], e[0], e[1], e[2], e[3])
        R2 = quat_matrix(q[0], q[1], q[2], q[3])
        R1 = quat_matrix(r[0], r[1], r[2], r[3])
        for k in range(4):
            data.quat2[i, k] = q[k]
            data.quat1[i, k] = r[k]
        for k in range(9):
            data.rot2[i, k] = R2[k]
            data.rot1[i, k] = R1[k]


@kernel
def minimal_state(model: Model, data: Data, h: float, z: Matrix, out: Vector) -> None:
    """out = x with maximal_state(x) = z, joint by joint: see joints/coordinates.py.

    Of poses that violate a joint, the part along its free directions is kept.   z: (nbody, 13); out: (nq + nv,).
    """
    nq = out.shape[0] - model.dof_body.shape[0]
    poses_of_maximal(data, h, z)
    for i in range(model.body_parent.shape[0]):
        joint_coordinates(model, data, h, i, out[:nq], out[nq:])


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
