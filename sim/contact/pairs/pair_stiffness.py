"""Derivatives of the wrenches of pairs by the twists of their bodies, summed over the pairs of the same two bodies.

    F = (f, (P - O) x f),   f = n gamma + T^T beta        dF = K_a zeta_a + K_b zeta_b

with the impulses condensed, d(gamma, beta) = W (C_a zeta_a + C_b zeta_b). Rows of coupling_K: K_a, K_b, each 6 x 6.
"""

from __future__ import annotations

from sim.contact.contact_law import condense_contact, contact_constant, contact_error, contact_impulse
from sim.contact.pairs.inactive_pairs import add_inactive_pairs
from sim.contact.pairs.limited_reach import with_fade
from sim.contact.pairs.pair_contact import acts, add_pair_wrench, pair_arm, pair_force, shares
from sim.contact.pairs.pair_jacobian import pair_jacobian
from sim.contact.pairs.taut_string import is_taut
from sim.contact.pairs.taut_string_stiffness import add_string_stiffness, add_string_turn
from sim.contact.pairs.wrench_columns import add_wrench_column, center_shift, point_shift, unit_vector
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import NewtonTarget
from sim.model.record_columns import PairFrame
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross
from solvers.types import Matrix, Vector


@kernel
def impulse_rate(data: Data, c: int, j: int, C: Vector, k: int, p: Vec3) -> Vec3:
    """W times column k of C (3 x 6), and the change of the part that acts of the impulse p of pair j, contact c."""
    W = data.contact_W[c]
    x, y, z = C[k], C[6 + k], C[12 + k]
    rate = (
        W[0] * x + W[1] * y + W[2] * z,
        W[3] * x + W[4] * y + W[5] * z,
        W[6] * x + W[7] * y + W[8] * z,
    )
    return with_fade(data, j, x, rate, p)


@kernel
def add_pair_stiffness(model: Model, data: Data, j: int, indefinite: float) -> None:
    """coupling_K += pair j, condensed; indefinite: factor of the turning of its impulse."""
    if is_taut(model, data, j):
        add_string_stiffness(model, data, j)
        return
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    c = model.contact_height.shape[0] + j
    wa, wb = shares(model, j)
    p = contact_impulse(model, data, c)
    f = pair_force(data, j, indefinite * p[0], indefinite * p[1], indefinite * p[2])
    P = pair_arm(model, data, j)
    Ka = data.coupling_K[2 * model.pair_coupling[j]]
    Kb = data.coupling_K[2 * model.pair_coupling[j] + 1]
    Omega = data.pair_turn[j]
    M = data.pair_shift[j]
    F = data.pair_frame[j]
    o = data.origin
    for k in range(6):
        turn = (Omega[k], Omega[6 + k], Omega[12 + k])
        shift = (M[k], M[6 + k], M[12 + k])
        g = impulse_rate(data, c, j, data.pair_Ca[j], k, p)
        e = pair_force(data, j, g[0], g[1], g[2])
        r = cross(turn[0], turn[1], turn[2], f[0], f[1], f[2])
        x = center_shift(data, data.pos3, a, k)
        df = (e[0] + r[0], e[1] + r[1], e[2] + r[2])
        dP = (shift[0] - wa * x[0], shift[1] - wa * x[1], shift[2] - wa * x[2])
        add_wrench_column(Ka, k, f, df, P, dP)
        if b < 0:
            continue
        g = impulse_rate(data, c, j, data.pair_Cb[j], k, p)
        e = pair_force(data, j, g[0], g[1], g[2])
        u = unit_vector(k - 3)
        r = cross(u[0] - turn[0], u[1] - turn[1], u[2] - turn[2], f[0], f[1], f[2])
        s = point_shift(k, F[PairFrame.POINT] - o[0], F[PairFrame.POINT + 1] - o[1], F[PairFrame.POINT + 2] - o[2])
        x = center_shift(data, data.pos3, b, k)
        df = (e[0] + r[0], e[1] + r[1], e[2] + r[2])
        dP = (s[0] - shift[0] - wb * x[0], s[1] - shift[1] - wb * x[1], s[2] - shift[2] - wb * x[2])
        add_wrench_column(Kb, k, f, df, P, dP)


@optional(Slot.CONDENSE_PAIRS)
def condense_pairs(model: Model, data: Data, h: float, kappa: float, indefinite: float, form: int) -> None:
    """coupling_K of the active pairs, their laws linearised at kappa; overwritten.  See `condense_into`."""
    ground = model.contact_height.shape[0]
    for k in range(model.coupling_body.shape[0] - model.loop_ntrans.shape[0]):
        if data.coupling_live[k] == 1:
            for e in range(36):
                data.coupling_K[2 * k, e] = 0.0
                data.coupling_K[2 * k + 1, e] = 0.0
    for m in range(data.active_ground_count[0], data.active_count[0]):
        c = data.active[m]
        pair_jacobian(model, data, h, c - ground)
        condense_contact(model, data, h, c, kappa, indefinite, form)
        if acts(data, c - ground):
            add_pair_stiffness(model, data, c - ground, indefinite)


@optional(Slot.APPLY_PAIRS, default=0.0)
def apply_pairs(model: Model, data: Data) -> float:
    """wrench -= impulses of the pairs; returns the largest |gap - slack| of the active ones."""
    ground = model.contact_height.shape[0]
    r = 0.0
    for m in range(data.active_ground_count[0], data.active_count[0]):
        c = data.active[m]
        n, t1, t2 = contact_impulse(model, data, c)
        if acts(data, c - ground):
            add_pair_wrench(model, data, c - ground, n, t1, t2, data.wrench)
        r = max(r, contact_error(model, data, c))
    add_inactive_pairs(data)
    return r


@optional(Slot.PAIR_CONSTANTS)
def pair_constants(model: Model, data: Data, target: NewtonTarget) -> None:
    """wrench -= constant parts of the impulses of the active pairs, for the target of this Newton step."""
    ground = model.contact_height.shape[0]
    for m in range(data.active_ground_count[0], data.active_count[0]):
        c = data.active[m]
        contact_constant(model, data, c, target)
        w = data.contact_w[c]
        if acts(data, c - ground):
            add_pair_wrench(model, data, c - ground, w[0], w[1], w[2], data.wrench)


@kernel
def add_earlier_slip(model: Model, data: Data, h: float, j: int, K2: Matrix) -> None:
    """K2 (2, 36) += dF by the twists of a and b at configuration 2, of pair j.

    slip    -t/h on dx2,  (-c y + s x y)/h on dphi2,  y = r x t        P follows the centres of mass at 2
    """
    if is_taut(model, data, j):
        add_string_turn(model, data, j, K2)
        return
    c = model.contact_height.shape[0] + j
    weight = shares(model, j)
    n, t1, t2 = contact_impulse(model, data, c)
    f = pair_force(data, j, n, t1, t2)
    P = pair_arm(model, data, j)
    F = data.pair_frame[j]
    W = data.contact_W[c]
    for side in range(2):
        i = model.coupling_body[model.pair_coupling[j], side]
        if i < 0:
            continue
        sign = 1.0 if side == 0 else -1.0
        w = data.turn[i]
        r = (
            F[PairFrame.POINT] - data.pos3[i, 0],
            F[PairFrame.POINT + 1] - data.pos3[i, 1],
            F[PairFrame.POINT + 2] - data.pos3[i, 2],
        )
        for k in range(6):
            x = center_shift(data, data.pos2, i, k)
            e = unit_vector(k - 3)
            s1 = slip_rate(F[3], F[4], F[5], r, w, x, e) * sign / h
            s2 = slip_rate(F[6], F[7], F[8], r, w, x, e) * sign / h
            df = pair_force(data, j, W[1] * s1 + W[2] * s2, W[4] * s1 + W[5] * s2, W[7] * s1 + W[8] * s2)
            q = weight[0] if side == 0 else weight[1]
            add_wrench_column(K2[side], k, f, df, P, (q * x[0], q * x[1], q * x[2]))


@kernel
def slip_rate(tx: float, ty: float, tz: float, r: Vec3, w: Vector, x: Vec3, e: Vec3) -> float:
    """-t.x + (-c y + s x y).e"""
    yx, yy, yz = cross(r[0], r[1], r[2], tx, ty, tz)
    sx, sy, sz = cross(w[1], w[2], w[3], yx, yy, yz)
    along = tx * x[0] + ty * x[1] + tz * x[2]
    return (sx - w[0] * yx) * e[0] + (sy - w[0] * yy) * e[1] + (sz - w[0] * yz) * e[2] - along
