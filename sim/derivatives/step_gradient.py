"""Derivatives of a step by the implicit function theorem: d(next state)/d(state, input) in tangent coordinates.

The residual R(q2, v15, u, v25) = 0 of a converged step gives  dv25 = -H^-1 (R_q dq2 + R_v dv15 + R_u du).  On the
central path the condensed contact matrices W are the exact derivatives of the impulses: nothing but W is needed.
"""

from __future__ import annotations

from sim.contact.pairs.inactive_pairs import all_near
from sim.contact.stiff_contacts import all_stiff
from sim.derivatives.coupling_gradient import add_coupling_composites, add_coupling_derivatives
from sim.derivatives.residual_gradient import residual_derivatives
from sim.derivatives.restitution_gradient import add_bounce_composites, add_bounce_derivatives
from sim.dynamics.elimination import factor_of
from sim.dynamics.elimination_panel import solve_panel
from sim.dynamics.external_forces import input_wrench
from sim.dynamics.joints.joint_forces import add_spring_derivatives, add_swing_curvature, joint_blocks
from sim.dynamics.joints.limits import add_limit_derivatives
from sim.dynamics.joints.servo_gradient import add_drive_derivatives, add_drive_inputs
from sim.dynamics.kinematics import velocity_columns
from sim.dynamics.loops.coupling_system import factor_coupling, solve_coupling_panel
from sim.dynamics.pose_jacobians import inertial_jacobians, pose2_to_origin, sum_composites
from sim.model.data import Data
from sim.model.model import InputKind, Model
from sim.model.slots import Slot
from sim.solve.inequalities import add_stiffness
from solvers.compiler import kernel, optional
from solvers.lanes import LANES, load, spread, store
from solvers.rotation import Vec3, left_jacobian, quat_exp, quat_matrix
from solvers.types import Matrix, Vector


@optional(Slot.GRADIENT, default=False)
def gradient(model: Model, data: Data, h: float, kappa: float, q: Vector, v: Vector, A: Matrix, B: Matrix) -> bool:
    """A = dx3/dx2 (2 nv, 2 nv), B = dx3/du (2 nv, nu) of the step now in `data`, solved at kappa.  False if singular.

    Needs the Data as a step leaves it: configurations, residual wrenches and cone variables at the solution.
    """
    inertial_jacobians(model, data, h)
    velocity_columns(model, data.S3, data.nu, h, data.S3nu)
    joint_blocks(model, data, h, q, v)
    all_near(model, data)
    all_stiff(model, data, h)
    add_stiffness(model, data, h, kappa)
    pose2_to_origin(data)
    bounces = add_bounce_composites(model, data)
    if not factor_of(model, data, data.A if bounces else data.A3):
        return False
    add_coupling_composites(model, data, h)
    sum_composites(model, data)
    residual_derivatives(model, data)
    add_swing_curvature(model, data, q)  # before `factor_coupling`, whose solves use up data.subtree
    add_bounce_derivatives(model, data, h)
    add_coupling_derivatives(model, data)
    if not factor_coupling(model, data):
        return False
    add_spring_derivatives(model, data, h, q, v)
    add_drive_derivatives(model, data, h)
    _joint_columns(model, data, h, v)
    _input_columns(model, data, h)
    add_drive_inputs(model, data, h)
    solve_panel(model, data)
    solve_coupling_panel(model, data)
    _next_state(model, data, h, A, B)
    return True


@kernel
def _joint_columns(model: Model, data: Data, h: float, v: Vector) -> None:
    """columns[:, :2 nv] = -(dR_dq, dR_dv): limits added, dR_dv from unit columns to velocities (-h, -h J(h w)^T).

    To those of quaternions come the lags of their dampers. Lanes of dR_dq and dR_dv write beyond their columns, into
    the places of dR_dv and of the inputs.
    """
    nv = v.shape[0]
    add_limit_derivatives(model, data, h)
    for d in range(nv):
        for k in range(0, nv, LANES):
            store(data.columns, d, k, -1.0 * load(data.dR_dq, d, k))
        for k in range(0, nv, LANES):
            store(data.columns, d, nv + k, h * load(data.dR_dv, d, k))
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 3:
            e = model.body_vadr[i + 1] - 3
            J = left_jacobian(h * v[e], h * v[e + 1], h * v[e + 2])
            for d in range(nv):
                x = data.columns[d, nv + e : nv + e + 3]
                a, b, c = x[0], x[1], x[2]
                for r in range(3):
                    x[r] = a * J[3 * r] + b * J[3 * r + 1] + c * J[3 * r + 2]
            for r in range(e, e + 3):
                data.columns[r, nv + r] += data.rotor[r]


@kernel
def _input_columns(model: Model, data: Data, h: float) -> None:
    """columns[:, 2 nv:] = -dR/du: h g at the dof of a joint input, h S2^T wrench above the body of the others."""
    nv = data.columns.shape[0]
    nu = model.input_kind.shape[0]
    for d in range(nv):
        for k in range(0, nu, LANES):
            store(data.columns, d, 2 * nv + k, spread(0.0))
    for j in range(nu):
        col = 2 * nv + j
        if model.input_kind[j] == InputKind.JOINT:
            data.columns[model.input_index[j], col] = h * model.input_wrench[j, 0]
            continue
        w = data.couple_wrench
        input_wrench(model, data, j, w)
        i = model.input_index[j]
        while i >= 0:
            for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
                s = data.S2[d]
                data.columns[d, col] = h * (
                    s[0] * w[0] + s[1] * w[1] + s[2] * w[2] + s[3] * w[3] + s[4] * w[4] + s[5] * w[5]
                )
            i = model.body_parent[i]


@kernel
def _next_state(model: Model, data: Data, h: float, A: Matrix, B: Matrix) -> None:
    """A, B from dv25 = columns:  dq3 = dq2 + h dv25, and R(h w)^T dphi2 + h J(h w)^T dw for quaternion joints."""
    nv = data.columns.shape[0]
    for d in range(nv):
        _combine(data.columns, d, 0, (h, 0.0, 0.0), 1, A, d)
        _combine(data.columns, d, 2 * nv, (h, 0.0, 0.0), 1, B, d)
        A[d, d] += 1.0
    for d in range(nv):
        _combine(data.columns, d, 0, (1.0, 0.0, 0.0), 1, A, nv + d)
        _combine(data.columns, d, 2 * nv, (1.0, 0.0, 0.0), 1, B, nv + d)
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] != 3:
            continue
        d = model.body_vadr[i + 1] - 3
        x, y, z = h * data.nu[d], h * data.nu[d + 1], h * data.nu[d + 2]
        J = left_jacobian(x, y, z)
        e = quat_exp(x, y, z)
        R = quat_matrix(e[0], e[1], e[2], e[3])
        for r in range(3):
            f = (h * J[r], h * J[3 + r], h * J[6 + r])
            _combine(data.columns, d, 0, f, 3, A, d + r)
            _combine(data.columns, d, 2 * nv, f, 3, B, d + r)
            for k in range(3):
                A[d + r, d + k] += R[3 * k + r]


@kernel
def _combine(X: Matrix, d: int, first: int, f: Vec3, rows: int, out: Matrix, row: int) -> None:
    """out[row] = f . X[d : d + rows], 1 row or 3, columns from `first` on. The last lanes may repeat some before."""
    n = out.shape[1]
    for c in range(0, n, LANES):
        if n < LANES:
            for k in range(n):
                m = first + k
                out[row, k] = f[0] * X[d, m]
                if rows == 3:
                    out[row, k] += f[1] * X[d + 1, m] + f[2] * X[d + 2, m]
        else:
            k = min(c, n - LANES)
            m = first + k
            x = f[0] * load(X, d, m)
            if rows == 3:
                x = x + f[1] * load(X, d + 1, m) + f[2] * load(X, d + 2, m)
            store(out, row, k, x)
