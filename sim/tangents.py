"""Directions of change carried through the stages of a Runge-Kutta step: the derivative of the step, exact.

columns    d(.)/d(q0, v0, u), 2 nv + nu of them
dq         of coordinates as they are: four numbers of a quaternion, for stages are not of length one
turn       the same in tangent coordinates: q^* dq = (., turn/2) |q|^2
"""

from __future__ import annotations

from typing import NamedTuple

from sim.hamilton_gradient import Slopes, slopes_at, velocity_slopes
from sim.model import Integers, Matrix, Model, Vector, Work
from sim.rollout import Cube
from sim.rotation import quat_mul
from solvers.jit import kernel


class Tangents(NamedTuple):
    """Directions at the node and at the stages of a step; n = 2 nv + nu."""

    slopes: Slopes
    node_q: Matrix  # (nq, n)
    node_p: Matrix  # (nv, n)
    stage_q: Matrix  # (nq, n)
    stage_p: Matrix  # (nv, n)
    turn: Matrix  # (nv, n)
    rates_q: Cube  # (s, nq, n)
    rates_p: Cube  # (s, nv, n)


@kernel
def _to_turn(model: Model, q: Vector, dq: Matrix, out: Matrix) -> None:
    """out = tangent coordinates of the directions dq at q, whose quaternions may have any length."""
    for i in range(model.body_parent.shape[0]):
        a, d = model.body_qadr[i], model.body_vadr[i]
        n = model.body_vadr[i + 1] - d - (3 if model.joint_nrot[i] == 3 else 0)
        for j in range(n):
            for k in range(out.shape[1]):
                out[d + j, k] = dq[a + j, k]
        if model.joint_nrot[i] == 3:
            a, d = a + n, d + n
            s = 2.0 / (q[a] * q[a] + q[a + 1] * q[a + 1] + q[a + 2] * q[a + 2] + q[a + 3] * q[a + 3])
            for k in range(out.shape[1]):
                r = quat_mul(q[a], -q[a + 1], -q[a + 2], -q[a + 3], dq[a, k], dq[a + 1, k], dq[a + 2, k], dq[a + 3, k])
                out[d, k], out[d + 1, k], out[d + 2, k] = s * r[1], s * r[2], s * r[3]


@kernel
def _from_turn(model: Model, q: Vector, turn: Matrix, out: Matrix) -> None:
    """out = dq of the tangent directions `turn` at q: q (0, turn)/2 for quaternions."""
    for i in range(model.body_parent.shape[0]):
        a, d = model.body_qadr[i], model.body_vadr[i]
        n = model.body_vadr[i + 1] - d - (3 if model.joint_nrot[i] == 3 else 0)
        for j in range(n):
            for k in range(out.shape[1]):
                out[a + j, k] = turn[d + j, k]
        if model.joint_nrot[i] == 3:
            a, d = a + n, d + n
            for k in range(out.shape[1]):
                x, y, z = 0.5 * turn[d, k], 0.5 * turn[d + 1, k], 0.5 * turn[d + 2, k]
                r = quat_mul(q[a], q[a + 1], q[a + 2], q[a + 3], 0.0, x, y, z)
                for j in range(4):
                    out[a + j, k] = r[j]


@kernel
def move_tangents(tangents: Tangents, h: float, weights: Vector, count: int) -> None:
    """stage = node + h sum of weights[j] times the rates of stage j, j < count."""
    _move(tangents.node_q, tangents.rates_q, h, weights, count, tangents.stage_q)
    _move(tangents.node_p, tangents.rates_p, h, weights, count, tangents.stage_p)


@kernel
def _move(node: Matrix, rates: Cube, h: float, weights: Vector, count: int, out: Matrix) -> None:
    for r in range(out.shape[0]):
        for k in range(out.shape[1]):
            out[r, k] = node[r, k]
        for j in range(count):
            c = h * weights[j]
            if c != 0.0:
                for k in range(out.shape[1]):
                    out[r, k] += c * rates[j, r, k]


@kernel
def tangent_rates(
    model: Model, work: Work, free: Integers, u: Vector, q: Vector, tangents: Tangents, stage: int
) -> bool:
    """Rates of the directions at the evaluation in `work`, coordinates q: dq', and dp' = f_q dq + f_v dv + f_u du."""
    slopes, dq, turn = tangents.slopes, tangents.stage_q, tangents.turn
    if not slopes_at(model, work, free, u, slopes):
        return False
    _to_turn(model, q, dq, turn)
    velocity_slopes(model, work, free, slopes, turn, tangents.stage_p)
    dv, out = work.columns, tangents.rates_p[stage]
    nv, n = out.shape
    for d in range(nv):
        for k in range(n):
            out[d, k] = 0.0
        for k in range(u.shape[0]):
            out[d, 2 * nv + k] = slopes.f_u[d, k]
        for e in range(nv):
            a, b = slopes.f_q[d, e], slopes.f_v[d, e]
            if a != 0.0 or b != 0.0:
                for k in range(n):
                    out[d, k] += a * turn[e, k] + b * dv[e, k]
    v, rates = work.nu, tangents.rates_q[stage]
    _from_turn(model, q, dv, rates)
    for i in range(model.body_parent.shape[0]):  # (q (0, w)/2)' = q (0, dw)/2 + dq (0, w)/2
        if model.joint_nrot[i] == 3:
            a, d = model.body_qadr[i + 1] - 4, model.body_vadr[i + 1] - 3
            for k in range(n):
                x, y, z = 0.5 * v[d], 0.5 * v[d + 1], 0.5 * v[d + 2]
                r = quat_mul(dq[a, k], dq[a + 1, k], dq[a + 2, k], dq[a + 3, k], 0.0, x, y, z)
                for j in range(4):
                    rates[a + j, k] += r[j]
    return True


@kernel
def keep_tangents(model: Model, stage_q: Vector, q: Vector, tangents: Tangents) -> None:
    """The directions of the stage become those of the node, whose quaternions q are those of the stage normalised."""
    _to_turn(model, stage_q, tangents.stage_q, tangents.turn)
    _from_turn(model, q, tangents.turn, tangents.node_q)
    for d in range(tangents.node_p.shape[0]):
        for k in range(tangents.node_p.shape[1]):
            tangents.node_p[d, k] = tangents.stage_p[d, k]


@kernel
def first_tangents(model: Model, work: Work, free: Integers, u: Vector, q: Vector, tangents: Tangents) -> bool:
    """Directions of the state that is in `work`: those of q and v themselves; none of u yet."""
    slopes = tangents.slopes
    if not slopes_at(model, work, free, u, slopes):
        return False
    nv = tangents.turn.shape[0]
    for d in range(nv):
        for k in range(tangents.turn.shape[1]):
            tangents.turn[d, k] = tangents.node_p[d, k] = 0.0
        tangents.turn[d, d] = 1.0
        for k in range(nv):
            tangents.node_p[d, k], tangents.node_p[d, nv + k] = slopes.p_q[d, k], slopes.p_v[d, k]
    _from_turn(model, q, tangents.turn, tangents.node_q)
    return True


@kernel
def last_tangents(model: Model, work: Work, free: Integers, u: Vector, tangents: Tangents) -> bool:
    """work.columns = dv of the node in `work`; tangents.turn holds its dq."""
    if not slopes_at(model, work, free, u, tangents.slopes):
        return False
    velocity_slopes(model, work, free, tangents.slopes, tangents.turn, tangents.node_p)
    return True
