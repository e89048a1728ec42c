"""Derivatives of the node's momentum of a state by the discrete Legendre transform, p(q2, v15).

    p = S2^T W + springs and rotors,    W = momenta of the bodies at the end of the interval 1-2 (energy.py)

The momentum balance of a step is -W plus terms of the next interval, so its composites give dp (residual_gradient.py).
"""

from __future__ import annotations

from sim.derivatives.residual_gradient import residual_derivatives
from sim.dynamics.angular_momentum import angular_momentum, angular_momentum_jacobian
from sim.dynamics.elimination import subtree_sums
from sim.dynamics.energy import node_momentum
from sim.dynamics.joints.ball_spring import spring_turns, turn_product
from sim.dynamics.joints.joint_forces import add_swing_curvature
from sim.dynamics.pose_jacobians import add_skew, columns_to_origin, pose2_to_origin, rows_to_origin, sum_composites
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.rotation import left_jacobian, quat_exp, quat_matrix
from solvers.types import Matrix, Vector


@kernel
def _momentum_jacobians(model: Model, data: Data, h: float) -> None:
    """A1, A2 = d(-W)/d(pose 1), d(-W)/d(pose 2) about O, the latter at the centre of mass; A3 = 0."""
    J = data.inertia_world
    for i in range(model.body_parent.shape[0]):
        e, u, v, w = data.turn_in[i, 0], data.turn_in[i, 1], data.turn_in[i, 2], data.turn_in[i, 3]
        minus = angular_momentum_jacobian(J, i, h, e, -u, -v, -w)
        px, py, pz = angular_momentum(J, i, h, e, -u, -v, -w)
        A1, A2, m = data.A1[i], data.A2[i], model.body_mass[i] / h
        for k in range(36):
            A1[k] = A2[k] = data.A3[i, k] = 0.0
        for k in range(3):
            A1[7 * k] = m
            A2[7 * k] = -m
            for j in range(3):
                A1[6 * (3 + k) + 3 + j] = minus[3 * k + j]
                A2[6 * (3 + k) + 3 + j] = -minus[3 * k + j]
        add_skew(A2, 3, 3, -px, -py, -pz)
        o = data.origin
        rows_to_origin(A1, data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2])
        columns_to_origin(A1, data.pos1[i, 0] - o[0], data.pos1[i, 1] - o[1], data.pos1[i, 2] - o[2])


@kernel
def _add_ball_spring(model: Model, data: Data, h: float, q: Vector, v: Vector, i: int) -> None:
    """dR_dq, dR_dv += d((h k/2) (c2 I - [s2]) (s1 + s2)) of quaternion joint i, as in joints/ball_spring.py."""
    e = model.body_vadr[i + 1] - 3
    r1, r2, _ = spring_turns(model, data, h, q, v, i)
    g = h * model.dof_spring[e]
    y = (r1[1] + r2[1], r1[2] + r2[2], r1[3] + r2[3])
    c, s = r2[0], (r2[1], r2[2], r2[3])
    P1, P2 = turn_product(r2, r1), turn_product(r2, r2)
    t1 = quat_exp(-h * v[e], -h * v[e + 1], -h * v[e + 2])
    R1 = quat_matrix(t1[0], t1[1], t1[2], t1[3])
    Y = (0.0, -y[2], y[1], y[2], 0.0, -y[0], -y[1], y[0], 0.0)
    dot = y[0] * s[0] + y[1] * s[1] + y[2] * s[2]
    for a in range(3):
        for b in range(3):
            w = P1[3 * a] * R1[3 * b] + P1[3 * a + 1] * R1[3 * b + 1] + P1[3 * a + 2] * R1[3 * b + 2]
            t = P2[3 * a + b] + 0.25 * (c * Y[3 * a + b] + s[a] * y[b] - y[a] * s[b])
            if a == b:
                t -= 0.25 * dot
            data.dR_dq[e + a, e + b] += g * (t + w)
            data.dR_dv[e + a, e + b] += g * w


@kernel
def _add_springs(model: Model, data: Data, h: float, q: Vector, v: Vector) -> None:
    """dR_dq, dR_dv += springs and rotors of -p: h k/2, and in unit columns h k/4 + I/h."""
    for i in range(model.body_parent.shape[0]):
        end = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            end -= 3
            if model.dof_spring[end] > 0.0:
                _add_ball_spring(model, data, h, q, v, i)
        for d in range(model.body_vadr[i], end):
            data.dR_dq[d, d] += 0.5 * h * model.dof_spring[d]
            data.dR_dv[d, d] += 0.25 * h * model.dof_spring[d] + model.dof_armature[d] / h


@kernel
def momentum_slopes(model: Model, data: Data, h: float, q: Vector, v: Vector, p_q: Matrix, p_v: Matrix) -> None:
    """dp by q2 at constant v15, and by v15: unit columns times -(-h), of quaternions -(-h J(h w)^T).

    After `node_momentum` of the state (q, v), which leaves W in data.wrench.   p_q, p_v: (nv, nv).
    """
    for i in range(data.wrench.shape[0]):
        for k in range(6):
            data.wrench[i, k] = -data.wrench[i, k]
    subtree_sums(model, data.wrench, data.subtree)
    _momentum_jacobians(model, data, h)
    pose2_to_origin(data)
    sum_composites(model, data)
    residual_derivatives(model, data)
    add_swing_curvature(model, data, q)
    _add_springs(model, data, h, q, v)
    nv = v.shape[0]
    R = data.dR_dv
    for d in range(nv):
        for k in range(nv):
            p_q[d, k] = -data.dR_dq[d, k]
            p_v[d, k] = h * R[d, k]
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 3:
            e = model.body_vadr[i + 1] - 3
            J = left_jacobian(h * v[e], h * v[e + 1], h * v[e + 2])
            for d in range(nv):
                for k in range(3):
                    p_v[d, e + k] = h * (J[3 * k] * R[d, e] + J[3 * k + 1] * R[d, e + 1] + J[3 * k + 2] * R[d, e + 2])


@kernel
def momentum_jacobian(model_at: Table, data_at: Table, h: float, x: Vector, p_q: Matrix, p_v: Matrix) -> None:
    """`momentum_slopes` of the state x = (q, v15), from tables."""
    model = model_view(model_at)
    data = data_view(data_at)
    nq = data.theta1.shape[0]
    node_momentum(model, data, h, x, data.wrench)
    momentum_slopes(model, data, h, x[:nq], x[nq:], p_q, p_v)
