"""Jacobians of the maximal state by the state, and back, in tangent coordinates.

dx    [dq; dv], (2 nv,): quaternions by right perturbation
dz    per body [position, velocity, rotation, angular velocity], (12 nbody,): rotation by right perturbation
"""

from __future__ import annotations

from sim.dynamics.coordinates import body_turn, node_poses, poses_of_maximal
from sim.dynamics.joints.coordinate_rows import joint_rows
from sim.dynamics.joints.coordinates import joint_frame
from sim.dynamics.kinematics import velocity_columns
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.state_columns import BodyColumn
from solvers.compiler import Table, kernel
from solvers.rotation import (
    Mat3,
    Vec3,
    cross,
    inverse_right_jacobian,
    left_jacobian,
    quat_exp,
    quat_log,
    quat_matrix,
    quat_mul,
    rows_of,
    times,
    transposed_times,
)
from solvers.types import Matrix, Vector


@kernel
def _moved(S: Matrix, d: int, pos: Matrix, i: int) -> Vec3:
    """Velocity of the centre of mass of body i under column d: v + a x pos, for twists about the world's origin."""
    x, y, z = cross(S[d, 3], S[d, 4], S[d, 5], pos[i, 0], pos[i, 1], pos[i, 2])
    return S[d, 0] + x, S[d, 1] + y, S[d, 2] + z


@kernel
def maximal_jacobian(model: Model, data: Data, h: float, x: Vector, out: Matrix) -> None:
    """out = dz/dx, with the columns S of the joints above each body:

        position            S2_v + S2_a x x2                  0
        velocity            (dx2 - dx1)/h                     -dx1/h
        rotation            R2^T S2_a                         0
        angular velocity    J^-1 R2^T (S2_a - S1_a)/h         -J^-1 R2^T S1nu_a/h

    J: right Jacobian of exp at h omega.   out: (12 nbody, 2 nv).
    """
    node_poses(model, data, h, x)
    nv = model.dof_body.shape[0]
    nq = x.shape[0] - nv
    velocity_columns(model, data.S1, x[nq:], -h, data.S3nu)
    for r in range(out.shape[0]):
        for c in range(2 * nv):
            out[r, c] = 0.0
    for i in range(model.body_parent.shape[0]):
        t = body_turn(data, i)
        J = inverse_right_jacobian(t[0], t[1], t[2])
        R = rows_of(data.rot2, i)
        b = i
        while b >= 0:
            for d in range(model.body_vadr[b], model.body_vadr[b + 1]):
                _maximal_column(data, h, i, d, J, R, out)
            b = model.body_parent[b]


@kernel
def _maximal_column(data: Data, h: float, i: int, d: int, J: Mat3, R: Mat3, out: Matrix) -> None:
    """Entries of body i in the columns of dof d (configuration and velocity) of dz/dx."""
    nv = data.S1.shape[0]
    r = 12 * i
    p2 = _moved(data.S2, d, data.pos2, i)
    p1 = _moved(data.S1, d, data.pos1, i)
    n1 = _moved(data.S3nu, d, data.pos1, i)
    a2, a1, an = data.S2[d], data.S1[d], data.S3nu[d]
    turn = transposed_times(R, a2[3], a2[4], a2[5])
    spin = transposed_times(R, a2[3] - a1[3], a2[4] - a1[4], a2[5] - a1[5])
    spin = times(J, spin[0], spin[1], spin[2])
    rate = transposed_times(R, an[3], an[4], an[5])
    rate = times(J, rate[0], rate[1], rate[2])
    for k in range(3):
        out[r + k, d] = p2[k]
        out[r + 3 + k, d] = (p2[k] - p1[k]) / h
        out[r + 3 + k, nv + d] = -n1[k] / h
        out[r + 6 + k, d] = turn[k]
        out[r + 9 + k, d] = spin[k] / h
        out[r + 9 + k, nv + d] = -rate[k] / h


@kernel
def _difference_rows(model: Model, data: Data, i: int, w: Vec3) -> None:
    """Rows of the quaternion of joint i turned into those of its rotation vector over the interval, w = log(r1^* r2).

    dw = J^-1 (psi2 - R(exp w)^T psi1), psi the right perturbations of r:   F <- J^-1 F,  G <- J^-1 R^T G
    """
    d = model.body_vadr[i + 1] - 3
    J = inverse_right_jacobian(w[0], w[1], w[2])
    e = quat_exp(w[0], w[1], w[2])
    R = quat_matrix(e[0], e[1], e[2], e[3])
    for k in range(12):
        f = times(J, data.F[d, k], data.F[d + 1, k], data.F[d + 2, k])
        g = transposed_times(R, data.G[d, k], data.G[d + 1, k], data.G[d + 2, k])
        g = times(J, g[0], g[1], g[2])
        for j in range(3):
            data.F[d + j, k] = f[j]
            data.G[d + j, k] = g[j]


@kernel
def _minimal_row(data: Data, h: float, z: Matrix, d: int, first: int, b: int, out: Matrix) -> None:
    """Entries of body b in the rows of dof d of dx/dz, from its columns of F and G at `first`.

    Of a perturbed body, x1 moves by dx - h dvel, and its world rotation at 1 by R2 (phi - h J domega), J the right
    Jacobian of exp at h omega. Here the velocity row only; F and G give (q2 - q1)/h.
    """
    nv = data.F.shape[0]
    R = rows_of(data.rot2, b)
    w = z[b, BodyColumn.SPIN :]
    L = left_jacobian(h * w[0], h * w[1], h * w[2])
    f, g, o = data.F[d], data.G[d], first
    turn = transposed_times(R, f[o + 3] - g[o + 3], f[o + 4] - g[o + 4], f[o + 5] - g[o + 5])
    spin = transposed_times(R, g[o + 3], g[o + 4], g[o + 5])
    spin = times(L, spin[0], spin[1], spin[2])  # the right Jacobian is the transpose of the left one
    for k in range(3):
        out[nv + d, 12 * b + k] = (f[o + k] - g[o + k]) / h
        out[nv + d, 12 * b + 3 + k] = g[o + k]
        out[nv + d, 12 * b + 6 + k] = turn[k] / h
        out[nv + d, 12 * b + 9 + k] = spin[k]


@kernel
def minimal_jacobian(model: Model, data: Data, h: float, z: Matrix, out: Matrix) -> None:
    """out = dx/dz at a maximal state that satisfies its joints.   out: (2 nv, 12 nbody)."""
    poses_of_maximal(data, h, z)
    for r in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[r, c] = 0.0
    for i in range(model.body_parent.shape[0]):
        p = model.body_parent[i]
        joint_rows(model, i, data.pos2, data.quat2, data.rot2, data.F)
        joint_rows(model, i, data.pos1, data.quat1, data.rot1, data.G)
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            _configuration_row(data, d, 0, i, out)
            if p >= 0:
                _configuration_row(data, d, 6, p, out)
        if model.joint_nrot[i] == 3:
            _difference_rows(model, data, i, _joint_turn(model, data, i))
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            _minimal_row(data, h, z, d, 0, i, out)
            if p >= 0:
                _minimal_row(data, h, z, d, 6, p, out)


@kernel
def _configuration_row(data: Data, d: int, first: int, b: int, out: Matrix) -> None:
    """Entries of body b in the configuration row of dof d of dx/dz."""
    f = data.F[d]
    turn = transposed_times(rows_of(data.rot2, b), f[first + 3], f[first + 4], f[first + 5])
    for k in range(3):
        out[d, 12 * b + k] = f[first + k]
        out[d, 12 * b + 6 + k] = turn[k]


@kernel
def _joint_turn(model: Model, data: Data, i: int) -> Vec3:
    """log(r1^* r2) of the quaternion joint i."""
    _, Q2 = joint_frame(model, i, data.pos2, data.quat2, data.rot2)
    _, Q1 = joint_frame(model, i, data.pos1, data.quat1, data.rot1)
    a, b = data.quat1[i], data.quat2[i]
    r1 = quat_mul(Q1[0], -Q1[1], -Q1[2], -Q1[3], a[0], a[1], a[2], a[3])
    r2 = quat_mul(Q2[0], -Q2[1], -Q2[2], -Q2[3], b[0], b[1], b[2], b[3])
    e = quat_mul(r1[0], -r1[1], -r1[2], -r1[3], r2[0], r2[1], r2[2], r2[3])
    return quat_log(e[0], e[1], e[2], e[3])


@kernel
def maximal_jacobian_at(model_at: Table, data_at: Table, h: float, x: Vector, out: Matrix) -> None:
    """`maximal_jacobian` from tables."""
    maximal_jacobian(model_view(model_at), data_view(data_at), h, x, out)


@kernel
def minimal_jacobian_at(model_at: Table, data_at: Table, h: float, z: Matrix, out: Matrix) -> None:
    """`minimal_jacobian` from tables; z: (nbody, 13)."""
    minimal_jacobian(model_view(model_at), data_view(data_at), h, z, out)
