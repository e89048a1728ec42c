"""Derivatives of Hamilton's equations of a tree (hamilton.py), for columns S_d and S_k of joints on one branch.

A displacement by S_k moves everything behind joint k rigidly, at fixed joint velocities against the twist V before k:
with a_k = S_k x V, composite inertias I and derivatives N of the wrenches from outside by a displacement, both of the
subtree, x the cross product of twists and * that of a twist and a wrench,

    of        by q_k, d behind k                             by q_k, k behind d             by v_k
    p_d       -I S_d . a_k                                   S_d . G_k                      S_d . I S_k
    p_d'      -(S_d*P + I S_d') . a_k + (S_d*F + N^T S_d) . S_k
                                                             S_d' . G_k + S_d . N S_k       (S_d*P + I S_d') . S_k
                                                                                            or  S_d' . I S_k

with G_k = S_k*P - I a_k, everything of the body that lies deeper. The momenta of a free root have S_d = 1, S_d' = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.dynamics.elimination import add_children, factor
from sim.dynamics.elimination_panel import solve_panel
from sim.dynamics.energy import armature_blocks, spatial_inertia
from sim.dynamics.external_forces import input_slopes, outer_slopes
from sim.dynamics.joints.ball_spring import relative_to_rest
from sim.integrators.hamilton import column_rate
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import ColumnVector
from solvers.compiler import kernel
from solvers.dense import dot
from solvers.rotation import cross
from solvers.types import Cube, Matrix, Vector

VECTORS = len(ColumnVector)  # of a column


class Slopes(NamedTuple):
    """Derivatives of momenta p and of their rates f by coordinates, velocities and inputs, in tangent coordinates."""

    p_q: Matrix  # (nv, nv)
    p_v: Matrix  # (nv, nv)
    f_q: Matrix  # (nv, nv)
    f_v: Matrix  # (nv, nv)
    f_u: Matrix  # (nv, nu)
    column: Cube  # (nv, 7, 6), see ColumnVector


def empty_slopes(nv: int, nu: int) -> Slopes:
    """Arrays for a call, of zeros."""
    p_q, p_v, f_q, f_v = np.zeros((4, nv, nv))
    return Slopes(p_q, p_v, f_q, f_v, np.zeros((nv, nu)), np.zeros((nv, VECTORS, 6)))


@kernel
def _star(S: Vector, f: Vector, out: Vector) -> None:
    """out[:6] = S* f = (w x f, w x n + v x f) of the twist S = (v, w) and the wrench f = (f, n)."""
    out[0], out[1], out[2] = cross(S[3], S[4], S[5], f[0], f[1], f[2])
    a, b, c = cross(S[3], S[4], S[5], f[3], f[4], f[5])
    x, y, z = cross(S[0], S[1], S[2], f[0], f[1], f[2])
    out[3], out[4], out[5] = a + x, b + y, c + z


@kernel
def _add_mul(A: Vector, x: Vector, sign: float, transposed: bool, out: Vector) -> None:
    """out[:6] += sign A x or A^T x, A 6 x 6 row-major."""
    for r in range(6):
        t = 0.0
        for k in range(6):
            t += A[6 * k + r if transposed else 6 * r + k] * x[k]
        out[r] += sign * t


@kernel
def _columns(model: Model, data: Data, out: Cube) -> None:
    """The vectors of every column, (nv, 7, 6).   data.A1, A2: I and N of the subtrees; data.balance: F."""
    for i in range(model.body_parent.shape[0]):
        V, p = data.wrench[0], model.body_parent[i]
        for k in range(6):
            V[k] = data.twist[p, k] if p >= 0 else 0.0
        J, N, P, F = data.A1[i], data.A2[i], data.subtree[i], data.balance[i]
        for d in range(model.body_vadr[i], model.body_vadr[i + 1]):
            S, c = data.S2[d], out[d]
            a, b = cross(S[3], S[4], S[5], V[0], V[1], V[2]), cross(S[0], S[1], S[2], V[3], V[4], V[5])
            w = cross(S[3], S[4], S[5], V[3], V[4], V[5])
            for k in range(3):
                c[ColumnVector.CONVECTION, k], c[ColumnVector.CONVECTION, 3 + k] = a[k] + b[k], w[k]
            rate = column_rate(model, data, i, d)
            for k in range(6):
                c[ColumnVector.RATE, k] = rate[k]
                for n in range(ColumnVector.MOMENTUM.value, VECTORS):
                    c[n, k] = 0.0
            _add_mul(J, S, 1.0, False, c[ColumnVector.MOMENTUM])
            _star(S, P, c[ColumnVector.MOMENTUM_RATE])
            _star(S, P, c[ColumnVector.GYROSCOPIC])
            _add_mul(J, c[ColumnVector.RATE], 1.0, False, c[ColumnVector.MOMENTUM_RATE])
            _star(S, F, c[ColumnVector.FORCE])
            _add_mul(N, S, 1.0, True, c[ColumnVector.FORCE])
            _add_mul(J, c[ColumnVector.CONVECTION], -1.0, False, c[ColumnVector.GYROSCOPIC])
            _add_mul(N, S, 1.0, False, c[ColumnVector.WRENCH])
            if d < model.body_vadr[i] + model.joint_ntrans[i]:  # columns before the rotations of a joint
                for k in range(6):
                    V[k] += S[k] * data.nu[d]


@kernel
def _pair(S: Matrix, slopes: Slopes, d: int, k: int, behind: bool) -> None:
    """Entry (d, k); behind: d moves with k."""
    a, b = slopes.column[d], slopes.column[k]
    if behind:
        slopes.p_q[d, k] = -dot(a[ColumnVector.MOMENTUM], b[ColumnVector.CONVECTION])
        slopes.f_q[d, k] = dot(a[ColumnVector.FORCE], S[k]) - dot(
            a[ColumnVector.MOMENTUM_RATE], b[ColumnVector.CONVECTION]
        )
        slopes.p_v[d, k] = dot(a[ColumnVector.MOMENTUM], S[k])
        slopes.f_v[d, k] = dot(a[ColumnVector.MOMENTUM_RATE], S[k])
    else:
        slopes.p_q[d, k] = dot(S[d], b[ColumnVector.GYROSCOPIC])
        slopes.f_q[d, k] = dot(a[ColumnVector.RATE], b[ColumnVector.GYROSCOPIC]) + dot(S[d], b[ColumnVector.WRENCH])
        slopes.p_v[d, k] = dot(S[d], b[ColumnVector.MOMENTUM])
        slopes.f_v[d, k] = dot(a[ColumnVector.RATE], b[ColumnVector.MOMENTUM])


@kernel
def _tree_pairs(model: Model, data: Data, slopes: Slopes) -> None:
    """p_q, p_v, f_q, f_v without joint forces."""
    S = data.S2
    for d in range(model.dof_body.shape[0]):
        i = model.dof_body[d]
        turns = model.body_vadr[i] + model.joint_ntrans[i]
        for k in range(model.body_vadr[i], model.body_vadr[i + 1]):
            _pair(S, slopes, d, k, k <= d or (d >= turns and model.joint_nrot[i] == 3))
        p = model.body_parent[i]
        while p >= 0:
            for k in range(model.body_vadr[p], model.body_vadr[p + 1]):
                _pair(S, slopes, d, k, True)
                _pair(S, slopes, k, d, False)
            p = model.body_parent[p]
    for d in range(model.dof_body.shape[0]):  # free roots have other rows
        root = model.dof_body[d]
        while model.body_parent[root] >= 0:
            root = model.body_parent[root]
        if model.root_free[root] == 1:
            c = slopes.column[d]
            for r in range(6):
                e = model.body_vadr[root] + r
                slopes.p_q[e, d], slopes.p_v[e, d] = c[ColumnVector.GYROSCOPIC, r], c[ColumnVector.MOMENTUM, r]
                slopes.f_q[e, d], slopes.f_v[e, d] = c[ColumnVector.WRENCH, r], 0.0


@kernel
def _add_joint_slopes(model: Model, q: Vector, slopes: Slopes) -> None:
    """f_q -= k, f_v -= d, p_v += armature; quaternions: -2 k c s with dc = -s.e/2, ds = (c e + s x e)/2."""
    for i in range(model.body_parent.shape[0]):
        stop = model.body_vadr[i + 1]
        if model.joint_nrot[i] == 3:
            stop -= 3
            r = relative_to_rest(model, i, q)
            g = model.dof_spring[stop]
            for a in range(3):
                for b in range(3):
                    slopes.f_q[stop + a, stop + b] += g * r[1 + a] * r[1 + b]
                b, c = (a + 1) % 3, (a + 2) % 3
                slopes.f_q[stop + a, stop + a] -= g * r[0] * r[0]
                slopes.f_q[stop + a, stop + c] -= g * r[0] * r[1 + b]
                slopes.f_q[stop + a, stop + b] += g * r[0] * r[1 + c]
        for d in range(model.body_vadr[i], stop):
            slopes.f_q[d, d] -= model.dof_spring[d]
    for d in range(slopes.p_v.shape[0]):
        slopes.f_v[d, d] -= model.dof_damper[d]
        slopes.p_v[d, d] += model.dof_armature[d]


@kernel
def slopes_at(model: Model, data: Data, u: Vector, out: Slopes) -> bool:
    """All derivatives at the evaluation that is in `data`, and the factors of M; False when that is singular."""
    spatial_inertia(model, data.origin, data.pos2, data.inertia_world, data.A1)
    spatial_inertia(model, data.origin, data.pos2, data.inertia_world, data.A)
    add_children(model, data.A1)
    outer_slopes(model, data, u, data.A2)
    _columns(model, data, out.column)
    for d in range(out.p_q.shape[0]):
        for k in range(out.p_q.shape[0]):
            out.p_q[d, k] = out.p_v[d, k] = out.f_q[d, k] = out.f_v[d, k] = 0.0
    _tree_pairs(model, data, out)
    _add_joint_slopes(model, data.theta1, out)
    input_slopes(model, data, out.f_u)
    for d in range(data.nu.shape[0]):
        for k in range(6):
            data.S3nu[d, k] = data.S2[d, k]
    armature_blocks(model, 1.0, 0.0, data.joint_block)
    return factor(model, data) != 0


@kernel
def velocity_slopes(model: Model, data: Data, slopes: Slopes, dq: Matrix, dp: Matrix) -> None:
    """data.columns = dv of every direction (dq, dp), p_v dv = dp - p_q dq.   dq: tangent; both (nv, n)."""
    X, n = data.columns, dq.shape[1]
    for d in range(X.shape[0]):
        for k in range(n):
            X[d, k] = dp[d, k]
        for e in range(X.shape[0]):
            c = slopes.p_q[d, e]
            if c != 0.0:
                for k in range(n):
                    X[d, k] -= c * dq[e, k]
    for i in range(model.root_free.shape[0]):
        if model.root_free[i] == 1:
            d, w = model.body_vadr[i], data.wrench[0]
            for k in range(n):
                for r in range(6):
                    w[r] = X[d + r, k]
                for r in range(6):
                    X[d + r, k] = dot(data.S2[d + r], w)
    solve_panel(model, data)
