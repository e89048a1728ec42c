"""Frames on bodies: place, orientation relative to an aim, and velocity, by state.

place         x2 + R2 p                                     dplace = S2_v + S2_a x place
orientation   r = log(aim^* q2 f), f the frame in its body  dr = Jr^-1(r) (R2 F)^T S2_a
velocity      displacement of the place over the last interval, divided by h
spin          log(q2 q1^*)/h, world axes
"""

from __future__ import annotations

from sim.dynamics.coordinates import node_poses
from sim.dynamics.kinematics import velocity_columns
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.simulator.task_space.knot_rows import (
    Rows,
    body_rotation,
    carried,
    move_rates,
    place_of,
    point_at,
    point_move,
    put_column,
    rotation_rates,
)
from solvers.compiler import Table, kernel
from solvers.dense import clear
from solvers.rotation import (
    Quat,
    inverse_right_jacobian,
    put_three,
    quat_log,
    quat_matrix,
    quat_mul,
    times,
    transposed_times,
)
from solvers.types import Matrix, Vector


@kernel
def _orientation(data: Data, i: int, place: Vector) -> Quat:
    """q2 f"""
    q = data.quat2[i]
    return quat_mul(q[0], q[1], q[2], q[3], place[3], place[4], place[5], place[6])


@kernel
def frame_pose(data: Data, i: int, place: Vector, aim: Vector, out: Vector) -> None:
    """out = [place (3), rotation vector from the aim (3)] of a frame of body i, in the axes of the aim."""
    put_three(point_at(data, i, place_of(place), True), 0, out)
    Q = _orientation(data, i, place)
    E = quat_mul(aim[0], -aim[1], -aim[2], -aim[3], Q[0], Q[1], Q[2], Q[3])
    put_three(quat_log(E[0], E[1], E[2], E[3]), 3, out)


@kernel
def frame_pose_jacobian(model: Model, data: Data, i: int, place: Vector, out: Vector, J: Matrix) -> None:
    """J = d(out)/d(dq), out as `frame_pose` leaves it."""
    at = (out[0], out[1], out[2])
    inverse = inverse_right_jacobian(out[3], out[4], out[5])
    Q = _orientation(data, i, place)
    R = quat_matrix(Q[0], Q[1], Q[2], Q[3])
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            put_column(carried(data.S2, d, at), 1.0, 0, d, J)
            a = transposed_times(R, data.S2[d, 3], data.S2[d, 4], data.S2[d, 5])
            put_column(times(inverse, a[0], a[1], a[2]), 1.0, 3, d, J)
        i = model.body_parent[i]


@kernel
def frame_poses(model_at: Table, data_at: Table, h: float, body: int, place: Vector, aims: Matrix, rows: Rows) -> None:
    """`frame_pose` and its Jacobian at all knots.   place: (7,) point and quaternion; aims: (m, 4); values: (m, 6)."""
    model = model_view(model_at)
    data = data_view(data_at)
    for row in range(rows.knots.shape[0]):
        node_poses(model, data, h, rows.xs[rows.knots[row]])
        frame_pose(data, body, place, aims[row], rows.values[row])
        if rows.jacobians.shape[0] > 0:
            clear(rows.jacobians[row])
            frame_pose_jacobian(model, data, body, place, rows.values[row], rows.jacobians[row])


@kernel
def frame_velocity(data: Data, h: float, i: int, place: Vector, out: Vector) -> None:
    """out = [velocity of the place (3), angular velocity (3)] of a frame of body i, world axes."""
    m = point_move(data, i, place_of(place))
    t = body_rotation(data, i)
    for k in range(3):
        out[k] = m[k] / h
        out[3 + k] = t[k] / h


@kernel
def frame_velocity_jacobian(model: Model, data: Data, h: float, i: int, place: Vector, J: Matrix) -> None:
    """J = d(frame_velocity)/d(dq, dv)."""
    nv = data.S2.shape[0]
    here, before = point_at(data, i, place_of(place), True), point_at(data, i, place_of(place), False)
    t = body_rotation(data, i)
    while i >= 0:
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            by_q, by_v = move_rates(data, d, here, before)
            put_column(by_q, 1.0 / h, 0, d, J)
            put_column(by_v, 1.0 / h, 0, nv + d, J)
            by_q, by_v = rotation_rates(data, t, d)
            put_column(by_q, 1.0 / h, 3, d, J)
            put_column(by_v, 1.0 / h, 3, nv + d, J)
        i = model.body_parent[i]


@kernel
def frame_velocities(model_at: Table, data_at: Table, h: float, body: int, place: Vector, rows: Rows) -> None:
    """`frame_velocity` and its Jacobian at all knots.   place: (7,); values: (m, 6)."""
    model = model_view(model_at)
    data = data_view(data_at)
    nq = data.theta1.shape[0]
    for row in range(rows.knots.shape[0]):
        x = rows.xs[rows.knots[row]]
        node_poses(model, data, h, x)
        frame_velocity(data, h, body, place, rows.values[row])
        if rows.jacobians.shape[0] > 0:
            velocity_columns(model, data.S1, x[nq:], -h, data.S3nu)
            clear(rows.jacobians[row])
            frame_velocity_jacobian(model, data, h, body, place, rows.jacobians[row])
