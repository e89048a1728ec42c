"""Stiffness of closed loops: the rotation of their wrenches with the bodies at configuration 2."""

from __future__ import annotations

from sim.contact.pairs.wrench_columns import add_wrench_column, point_shift, unit_vector
from sim.dynamics.loops.closure import child_point, loop_frame, relative_rotation
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, rotate, times
from solvers.types import Matrix


@optional(Slot.LOOP_STIFFNESS)
def loop_stiffness(model: Model, data: Data, m: int, K2: Matrix) -> Vec3:
    """K2 (2, 36) += d(G2^T f) by the twists of a and b at configuration 2; returns the force on a."""
    k = model.coupling_body.shape[0] - model.loop_ntrans.shape[0] + m
    a = model.coupling_body[k, 0]
    b = model.coupling_body[k, 1]
    row = model.coupling_row[k]
    loop_frame(model, data, m, b, data.pos2, data.rot2)
    A = child_point(model, m, a, data.pos2, data.rot2)
    o = data.origin
    P = (A[0] - o[0], A[1] - o[1], A[2] - o[2])
    fx, fy, fz = 0.0, 0.0, 0.0
    for _ in range(3 - model.loop_ntrans[m]):
        g = data.carry.couple_force[row]
        fx += g * data.couple_B[row, 0]
        fy += g * data.couple_B[row, 1]
        fz += g * data.couple_B[row, 2]
        row += 1
    f = (fx, fy, fz)
    zero = (0.0, 0.0, 0.0)
    for c in range(6):
        e = unit_vector(c - 3)
        add_wrench_column(K2[0], c, f, zero, P, point_shift(c, P[0], P[1], P[2]))
        add_wrench_column(K2[1], c, f, cross(e[0], e[1], e[2], fx, fy, fz), P, zero)
        if c < 3:
            continue
        for side in range(2):
            d = _torque_rate(model, data, m, a, row, e, side)
            for r in range(3):
                K2[side, 18 + 6 * r + c] += d[r]
    return f


@kernel
def _torque_rate(model: Model, data: Data, m: int, a: int, row: int, e: Vec3, side: int) -> Vec3:
    """Change of the constraint torque of loop m when a (side 0) or b (side 1) turns by e at configuration 2."""
    if model.loop_nrot[m] == 1:
        return _axis_torque_rate(model, data, m, a, row, e, side)
    if model.loop_nrot[m] == 0:
        return _weld_torque_rate(data, m, a, row, e, side)
    return 0.0, 0.0, 0.0


@kernel
def _axis_torque_rate(model: Model, data: Data, m: int, a: int, row: int, e: Vec3, side: int) -> Vec3:
    """`_torque_rate` of a loop about one axis: r x t turns with a by its axis r, with b by t, the rows times forces."""
    Q = data.loop_frame[m]
    s = model.loop_axis[m]
    r = rotate(data.rot2, a, s[6], s[7], s[8])
    x, y, z = 0.0, 0.0, 0.0
    for i in range(2):
        g = data.carry.couple_force[row + i]
        t = times(Q, g * s[3 * i], g * s[3 * i + 1], g * s[3 * i + 2])
        x += t[0]
        y += t[1]
        z += t[2]
    if side == 0:
        d = cross(e[0], e[1], e[2], r[0], r[1], r[2])
        return cross(d[0], d[1], d[2], x, y, z)
    d = cross(e[0], e[1], e[2], x, y, z)
    return cross(r[0], r[1], r[2], d[0], d[1], d[2])


@kernel
def _weld_torque_rate(data: Data, m: int, a: int, row: int, e: Vec3, side: int) -> Vec3:
    """`_torque_rate` of a loop without rotations: M = Q (tr E - E^T) f / 2 turns with b, and E changes by [p] E."""
    Q = data.loop_frame[m]
    E = data.loop_turn[m]
    relative_rotation(Q, data.rot2, a, E)
    f = (data.carry.couple_force[row], data.carry.couple_force[row + 1], data.carry.couple_force[row + 2])
    sign = 1.0 if side == 0 else -1.0
    p = (  # Q^T e
        sign * (Q[0] * e[0] + Q[3] * e[1] + Q[6] * e[2]),
        sign * (Q[1] * e[0] + Q[4] * e[1] + Q[7] * e[2]),
        sign * (Q[2] * e[0] + Q[5] * e[1] + Q[8] * e[2]),
    )
    dtrace = -(p[0] * (E[7] - E[5]) + p[1] * (E[2] - E[6]) + p[2] * (E[3] - E[1]))
    c = cross(p[0], p[1], p[2], f[0], f[1], f[2])
    x, y, z = times(
        Q,
        0.5 * (dtrace * f[0] + E[0] * c[0] + E[3] * c[1] + E[6] * c[2]),
        0.5 * (dtrace * f[1] + E[1] * c[0] + E[4] * c[1] + E[7] * c[2]),
        0.5 * (dtrace * f[2] + E[2] * c[0] + E[5] * c[1] + E[8] * c[2]),
    )
    if side == 1:
        trace = E[0] + E[4] + E[8]
        M = times(
            Q,
            0.5 * (trace * f[0] - E[0] * f[0] - E[3] * f[1] - E[6] * f[2]),
            0.5 * (trace * f[1] - E[1] * f[0] - E[4] * f[1] - E[7] * f[2]),
            0.5 * (trace * f[2] - E[2] * f[0] - E[5] * f[1] - E[8] * f[2]),
        )
        d = cross(e[0], e[1], e[2], M[0], M[1], M[2])
        return x + d[0], y + d[1], z + d[2]
    return x, y, z
