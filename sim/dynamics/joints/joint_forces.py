"""Joint-space terms of a step: springs, dampers and inputs, in the generalized residual and on the joint blocks.

A spring is integrated at the midpoint of each interval, V_d = (h/2) k |(r(2) + r(3))/2|^2: as implicit as the
trapezoidal rule, so stable for every k, and as conservative, so that a vibration keeps its amplitude. A damper acts on
the mean of both velocities where it is not stiff, on the unknown one where it is, and is dissipative for every
coefficient (damper.py). An armature adds I (q2 - q1)^2/(2 h) to the discrete Lagrangian, the energy of a rotor that
turns with the coordinate and carries no momentum elsewhere.
"""

from __future__ import annotations

from sim.dynamics.joints.ball_spring import add_ball_spring_derivatives, add_spring_block, spring_impulse
from sim.dynamics.joints.swing import swing_curvature
from sim.model.data import Data
from sim.model.model import InputKind, Model
from solvers.compiler import kernel
from solvers.types import Vector


@kernel
def joint_impulses(model: Model, data: Data, h: float, q: Vector, v: Vector, u: Vector) -> None:
    """residual += h d nu + I (nu - v) + h k (q + h (nu - v)/4 - rest) - h g u, and the analogue of quaternion joints.

    I: armature less lag;  g: 1 of forces, the gain of servos.
    """
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        end = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            end -= 3
            if model.dof_spring[end] > 0.0:
                t = spring_impulse(model, data, h, q, v, i)
                for k in range(3):
                    data.residual[end + k] += t[k]
            for k in range(end, end + 3):
                data.residual[k] += h * model.dof_damper[k] * data.nu[k] + data.rotor[k] * (data.nu[k] - v[k])
        for e in range(d, end):
            r = h * model.dof_damper[e] * data.nu[e] + data.rotor[e] * (data.nu[e] - v[e])
            if model.dof_spring[e] > 0.0:
                mid = q[model.dof_qadr[e]] + 0.25 * h * (data.nu[e] - v[e]) - model.dof_rest[e]
                r += h * model.dof_spring[e] * mid
            data.residual[e] += r
    for j in range(u.shape[0]):
        if model.input_kind[j] == InputKind.JOINT:
            data.residual[model.input_index[j]] -= h * model.input_wrench[j, 0] * u[j]


@kernel
def joint_blocks(model: Model, data: Data, h: float, q: Vector, v: Vector) -> None:
    """joint_block[i] = d(joint impulses)/d(nu), n x n row-major.

    I + h d + h^2 k/4 on the diagonal, I the armature less the lag, and the springs of quaternion joints.
    """
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.body_vadr[i + 1] - d
        B = data.joint_block[i]
        for k in range(n * n):
            B[k] = 0.0
        for k in range(n):
            B[k * n + k] = h * model.dof_damper[d + k] + data.rotor[d + k]
            if model.joint_nrot[i] < 3 or k < n - 3:
                B[k * n + k] += 0.25 * h * h * model.dof_spring[d + k]
        if model.joint_nrot[i] == 3 and model.dof_spring[d + n - 3] > 0.0:
            add_spring_block(model, data, h, q, v, i)


@kernel
def add_spring_derivatives(model: Model, data: Data, h: float, q: Vector, v: Vector) -> None:
    """dR_dq, dR_dv += springs; dR_dv in unit columns, to be multiplied by -h and -h J(h v)^T like all others.

    scalar        h k and h k/4 + I/h, I the armature less the lag
    quaternion    with M = c2 I - [s2], y = s1 + 2 s2 + s3 and ds = (c I + [s])/2 (right rotation) for each s,
                  d(M y) = M dy - (s2.e) y/2 + y x ds2; the turns R1, R3 carry a rotation e of q2 to configurations 1, 3
    """
    for i in range(model.body_parent.shape[0]):
        d = model.body_vadr[i]
        n = model.joint_ntrans[i] if model.joint_nrot[i] == 3 else model.body_vadr[i + 1] - d
        for e in range(d, d + n):
            data.dR_dq[e, e] += h * model.dof_spring[e]
            data.dR_dv[e, e] += 0.25 * h * model.dof_spring[e] + data.rotor[e] / h
        if model.joint_nrot[i] == 3 and model.dof_spring[d + n] > 0.0:
            add_ball_spring_derivatives(model, data, h, q, v, i)


@kernel
def add_swing_curvature(model: Model, data: Data, q: Vector) -> None:
    """dR_dq += the change of the test directions of joints with two rotations, beyond their rotation (swing.py)."""
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 2:
            a = model.body_qadr[i + 1] - 2
            swing_curvature(model, data, i, q[a], q[a + 1])


@kernel
def add_limit_impulse(model: Model, data: Data, k: int, size: float, out: Vector) -> None:
    """out += the generalized impulse of limit k.   out: (nv,)."""
    d = model.limit_dof[k]
    if model.limit_cone[k]:
        for j in range(3):
            out[d + j] += data.bound_row[k, j] * size
    else:
        out[d] += model.limit_sign[k] * size
