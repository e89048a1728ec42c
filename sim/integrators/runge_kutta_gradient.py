"""Directions of change carried through the stages of a Runge-Kutta step: the derivative of the step, exact.

columns    d(.)/d(q0, v0, u) in tangent coordinates, n = 2 nv + nu of them
"""

from __future__ import annotations

from math import cos, sqrt
from typing import NamedTuple

from sim.integrators.hamilton_gradient import VECTORS, Slopes, slopes_at, velocity_slopes
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import inlined, kernel
from solvers.rotation import (
    cross,
    inverse_right_jacobian,
    left_jacobian,
    quat_exp,
    quat_matrix,
    so3_coefficients,
)
from solvers.types import Matrix, Vector


class Tangents(NamedTuple):
    """Directions at the node and at the stages of a step."""

    slopes: Slopes
    node_q: Matrix  # (nv, n) of the coordinates
    node_p: Matrix  # (nv, n) of the momenta
    shift: Matrix  # (nv, n) of the shift from the node to the stage
    stage_q: Matrix  # (nv, n)
    stage_p: Matrix  # (nv, n)
    rates_r: Matrix  # (s nv, n) of the shift, stage by stage
    rates_p: Matrix  # (s nv, n) of the momenta


@inlined
def tangents_of(data: Data) -> Tangents:
    """Tangents with the arrays of `data`."""
    return Tangents(
        Slopes(
            data.slope_p_q,
            data.slope_p_v,
            data.slope_f_q,
            data.slope_f_v,
            data.slope_f_u,
            data.slope_column.reshape((-1, VECTORS, 6)),
        ),
        data.tangent_q,
        data.tangent_p,
        data.tangent_shift,
        data.tangent_stage_q,
        data.tangent_stage_p,
        data.tangent_dr,
        data.tangent_dp,
    )


@kernel
def move_tangents(model: Model, r: Vector, tangents: Tangents, h: float, weights: Vector, count: int) -> None:
    """Directions of shift and momenta, + h sum of weights[j] times the rates of stage j, j < count; of coordinates

    scalars        dq0 + dr
    quaternions    R(r)^T dq0 + J(r) dr        for q0 exp(r), J the right Jacobian
    """
    dr, dq, dp = tangents.shift, tangents.stage_q, tangents.stage_p
    for d in range(dr.shape[0]):
        for k in range(dr.shape[1]):
            dr[d, k] = 0.0
            dp[d, k] = tangents.node_p[d, k]
        for j in range(count):
            c, row = h * weights[j], j * dr.shape[0] + d
            if c != 0.0:
                for k in range(dr.shape[1]):
                    dr[d, k] += c * tangents.rates_r[row, k]
                    dp[d, k] += c * tangents.rates_p[row, k]
        for k in range(dr.shape[1]):
            dq[d, k] = tangents.node_q[d, k] + dr[d, k]
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 3:
            d = model.body_vadr[i + 1] - 3
            e = quat_exp(r[d], r[d + 1], r[d + 2])
            R = quat_matrix(e[0], e[1], e[2], e[3])
            J = left_jacobian(r[d], r[d + 1], r[d + 2])
            for k in range(dr.shape[1]):
                x, y, z = tangents.node_q[d, k], tangents.node_q[d + 1, k], tangents.node_q[d + 2, k]
                for a in range(3):
                    t = R[a] * x + R[3 + a] * y + R[6 + a] * z
                    dq[d + a, k] = t + J[a] * dr[d, k] + J[3 + a] * dr[d + 1, k] + J[6 + a] * dr[d + 2, k]


@kernel
def tangent_rates(model: Model, data: Data, u: Vector, r: Vector, tangents: Tangents, stage: int) -> bool:
    """Rates of the directions at the evaluation in `data`:  dp' = f_q dq + f_v dv + f_u du,  and dr'."""
    slopes, dq = tangents.slopes, tangents.stage_q
    if not slopes_at(model, data, u, slopes):
        return False
    velocity_slopes(model, data, slopes, dq, tangents.stage_p)
    nv, n = dq.shape
    dv, rows = data.columns, slice(stage * nv, (stage + 1) * nv)
    rates, out = tangents.rates_r[rows], tangents.rates_p[rows]
    for d in range(nv):
        for k in range(n):
            out[d, k] = 0.0
            rates[d, k] = dv[d, k]
        for k in range(u.shape[0]):
            out[d, 2 * nv + k] = slopes.f_u[d, k]
        for e in range(nv):
            a, b = slopes.f_q[d, e], slopes.f_v[d, e]
            if a != 0.0 or b != 0.0:
                for k in range(n):
                    out[d, k] += a * dq[e, k] + b * dv[e, k]
    for i in range(model.body_parent.shape[0]):
        if model.joint_nrot[i] == 3:
            _turn_rates(data, model.body_vadr[i + 1] - 3, r, tangents.shift, rates)
    return True


@kernel
def _turn_coefficient(t2: float) -> tuple[float, float]:
    """e = (1 - a/(2 b))/t^2, a = sin t/t, b = (1 - cos t)/t^2, as in `inverse_right_jacobian`; and de/d(t^2)."""
    if t2 < 0.1:
        return (
            1 / 12 + t2 * (1 / 720 + t2 * (1 / 30240 + t2 * (1 / 1209600 + t2 / 47900160))),
            1 / 720 + t2 * (1 / 15120 + t2 * (1 / 403200 + t2 * (1 / 11975040 + t2 * 691 / 261534873600))),
        )
    a, b, _ = so3_coefficients(t2)
    e = (1.0 - 0.5 * a / b) / t2
    da, db = 0.5 * (cos(sqrt(t2)) - a) / t2, 0.5 * (a - 2.0 * b) / t2
    return e, -(0.5 * (da * b - a * db) / (b * b) + e) / t2


@kernel
def _turn_rates(data: Data, d: int, r: Vector, dr: Matrix, out: Matrix) -> None:
    """out = d(J^-1(r) w), J^-1 w = w + r x w/2 + e(r.r) r x (r x w):

    J^-1 dw + dr x w/2 + 2 e' (r.dr) r x (r x w) + e (dr x (r x w) + r x (dr x w))
    """
    x, y, z = r[d], r[d + 1], r[d + 2]
    v, dv = data.nu, data.columns
    J = inverse_right_jacobian(x, y, z)
    e, slope = _turn_coefficient(x * x + y * y + z * z)
    a = cross(x, y, z, v[d], v[d + 1], v[d + 2])
    b = cross(x, y, z, a[0], a[1], a[2])
    for k in range(out.shape[1]):
        s, t, w = dr[d, k], dr[d + 1, k], dr[d + 2, k]
        c = cross(s, t, w, v[d], v[d + 1], v[d + 2])
        f = cross(s, t, w, a[0], a[1], a[2])
        g = cross(x, y, z, c[0], c[1], c[2])
        m = 2.0 * slope * (x * s + y * t + z * w)
        for j in range(3):
            turn = J[3 * j] * dv[d, k] + J[3 * j + 1] * dv[d + 1, k] + J[3 * j + 2] * dv[d + 2, k]
            out[d + j, k] = turn + 0.5 * c[j] + m * b[j] + e * (f[j] + g[j])


@kernel
def keep_tangents(tangents: Tangents) -> None:
    """The directions of the stage become those of the node."""
    for d in range(tangents.node_p.shape[0]):
        for k in range(tangents.node_p.shape[1]):
            tangents.node_q[d, k] = tangents.stage_q[d, k]
            tangents.node_p[d, k] = tangents.stage_p[d, k]


@kernel
def first_tangents(model: Model, data: Data, u: Vector, tangents: Tangents) -> bool:
    """Directions of the state that is in `data`: those of q and v themselves; none of u yet."""
    slopes = tangents.slopes
    if not slopes_at(model, data, u, slopes):
        return False
    nv = tangents.node_q.shape[0]
    for d in range(nv):
        for k in range(tangents.node_q.shape[1]):
            tangents.node_q[d, k] = tangents.node_p[d, k] = 0.0
        tangents.node_q[d, d] = 1.0
        for k in range(nv):
            tangents.node_p[d, k], tangents.node_p[d, nv + k] = slopes.p_q[d, k], slopes.p_v[d, k]
    return True


@kernel
def last_tangents(model: Model, data: Data, u: Vector, tangents: Tangents) -> bool:
    """data.columns = dv of the node in `data`."""
    if not slopes_at(model, data, u, tangents.slopes):
        return False
    velocity_slopes(model, data, tangents.slopes, tangents.node_q, tangents.node_p)
    return True
