"""Centre of mass, and momentum of all bodies about it, by state.

    c = sum m_i x_i / m,   P = sum m_i v_i,   L = sum J_i w_i + (x_i - c) x m_i v_i

with the mean velocities of the last interval: v_i = (x_i2 - x_i1)/h, w_i = log(q2 q1^*)/h, world axes.
"""

from __future__ import annotations

from sim.dynamics.coordinates import node_poses
from sim.dynamics.kinematics import velocity_columns
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.simulator.task_space.knot_rows import (
    Rows,
    add_column,
    body_rotation,
    carried,
    move_rates,
    point_at,
    rotation_rates,
)
from solvers.compiler import Table, kernel
from solvers.dense import clear
from solvers.rotation import Vec3, cross, rows_of, times, transposed_times
from solvers.types import Matrix, Vector


@kernel
def total_mass(model: Model) -> float:
    """Mass of all bodies [kg]."""
    m = 0.0
    for i in range(model.body_mass.shape[0]):
        m += model.body_mass[i]
    return m


@kernel
def _spun(model: Model, data: Data, i: int, w: Vec3) -> Vec3:
    """J_i w, world axes."""
    R = rows_of(data.rot2, i)
    x, y, z = transposed_times(R, w[0], w[1], w[2])
    x, y, z = times(model.body_inertia[i], x, y, z)
    return times(R, x, y, z)


@kernel
def momentum(model: Model, data: Data, h: float, out: Vector) -> None:
    """out = [c (3), P (3), L (3)]."""
    for k in range(9):
        out[k] = 0.0
    mass = total_mass(model)
    for i in range(model.body_mass.shape[0]):
        for k in range(3):
            out[k] += model.body_mass[i] * data.pos2[i, k] / mass
    for i in range(model.body_mass.shape[0]):
        m, v, x = model.body_mass[i] / h, data.move_in[i], data.pos2[i]
        t = body_rotation(data, i)
        s = _spun(model, data, i, (t[0] / h, t[1] / h, t[2] / h))
        o = cross(x[0] - out[0], x[1] - out[1], x[2] - out[2], m * v[0], m * v[1], m * v[2])
        for k in range(3):
            out[3 + k] += m * v[k]
            out[6 + k] += s[k] + o[k]


@kernel
def momentum_jacobian(model: Model, data: Data, h: float, out: Vector, J: Matrix) -> None:
    """J = d(momentum)/d(dq, dv), out as `momentum` leaves it."""
    mass = total_mass(model)
    for i in range(model.body_mass.shape[0]):
        b = i
        while b >= 0:
            for d in range(model.body_vadr[b], model.body_vadr[b + 1]):
                _add_body(model, data, h, i, d, out, J)
            b = model.body_parent[b]
    for d in range(data.S2.shape[0]):  # c moves: -dc x P
        x, y, z = cross(J[0, d], J[1, d], J[2, d], out[3] / mass, out[4] / mass, out[5] / mass)
        add_column((x, y, z), -1.0, 6, d, J)
        for k in range(3):
            J[k, d] /= mass


@kernel
def _add_body(model: Model, data: Data, h: float, i: int, d: int, out: Vector, J: Matrix) -> None:
    """Part of body i in the columns of dof d; rows of the centre of mass times the mass, and without -dc x P."""
    nv = data.S2.shape[0]
    m = model.body_mass[i]
    here, before = point_at(data, i, (0.0, 0.0, 0.0), True), point_at(data, i, (0.0, 0.0, 0.0), False)
    arm = (here[0] - out[0], here[1] - out[1], here[2] - out[2])
    dx = carried(data.S2, d, here)
    by_q, by_v = move_rates(data, d, here, before)
    v = data.move_in[i]
    add_column(dx, m, 0, d, J)
    add_column(by_q, m / h, 3, d, J)
    add_column(by_v, m / h, 3, nv + d, J)
    add_column(cross(dx[0], dx[1], dx[2], v[0], v[1], v[2]), m / h, 6, d, J)
    add_column(cross(*arm, *by_q), m / h, 6, d, J)
    add_column(cross(*arm, *by_v), m / h, 6, nv + d, J)
    t = body_rotation(data, i)
    a = (data.S2[d, 3], data.S2[d, 4], data.S2[d, 5])
    spin_q, spin_v = rotation_rates(data, t, d)
    turned = cross(*a, *t)
    add_column(cross(*a, *_spun(model, data, i, t)), 1.0 / h, 6, d, J)
    rate = (spin_q[0] - turned[0], spin_q[1] - turned[1], spin_q[2] - turned[2])
    add_column(_spun(model, data, i, rate), 1.0 / h, 6, d, J)
    add_column(_spun(model, data, i, spin_v), 1.0 / h, 6, nv + d, J)


@kernel
def momenta(model_at: Table, data_at: Table, h: float, rows: Rows) -> None:
    """`momentum` and its Jacobian at all knots.   values: (m, 9)."""
    model = model_view(model_at)
    data = data_view(data_at)
    nq = data.theta1.shape[0]
    for row in range(rows.knots.shape[0]):
        x = rows.xs[rows.knots[row]]
        node_poses(model, data, h, x)
        momentum(model, data, h, rows.values[row])
        if rows.jacobians.shape[0] > 0:
            velocity_columns(model, data.S1, x[nq:], -h, data.S3nu)
            clear(rows.jacobians[row])
            momentum_jacobian(model, data, h, rows.values[row], rows.jacobians[row])
