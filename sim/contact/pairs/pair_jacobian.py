"""Derivatives of gap, slip, frame and contact point of a pair by the twists of its bodies about O at configuration 3.

Everything moves with b, plus the effect of the motion of a relative to b:

    dn = phi_b x n + N zeta,   dp = v_b + phi_b x (p - O) + M zeta,   zeta = zeta_a - zeta_b
"""

from __future__ import annotations

from sim.contact.pairs.pair_contact import POLE, gap_normal, point_velocity, shape_b
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import PairFrame, Witness
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, three
from solvers.types import Vector


@kernel
def shape_to_world(X: Vector, first: int, data: Data, s: int, x: float, y: float, z: float, out: Vector) -> None:
    """out (3 x 6) = R X diag(R^T, R^T) shifted from the origin of shape s to O: rotation columns -= translation [c]."""
    R = data.shape_rot[s]
    for r in range(3):
        for k in range(6):
            q = 3 * (k // 3)
            c = k - q
            t = 0.0
            for i in range(3):
                row = X[first + 6 * i + q] * R[3 * c] + X[first + 6 * i + q + 1] * R[3 * c + 1]
                t += R[3 * r + i] * (row + X[first + 6 * i + q + 2] * R[3 * c + 2])
            out[6 * r + k] = t
        a, b, c3 = out[6 * r], out[6 * r + 1], out[6 * r + 2]
        out[6 * r + 3] -= b * z - c3 * y
        out[6 * r + 4] -= c3 * x - a * z
        out[6 * r + 5] -= a * y - b * x


@kernel
def frame_turn(g: Vector, out: Vector) -> None:
    """out (3 x 6): rotation of the contact frame, n x dn + n (spin of t1), both in the frame of shape b.

    t2.dt1 = (n x a).dn / (1 + a.n), a the pole of `tangents`
    """
    nx, ny, nz = three(g, Witness.NORMAL)
    spin = 1.0 / max(1.0 + POLE[0] * nx + POLE[1] * ny + POLE[2] * nz, 1e-12)
    sx, sy, sz = cross(nx, ny, nz, POLE[0], POLE[1], POLE[2])
    for k in range(6):
        x, y, z = g[Witness.NORMAL_RATE + k], g[Witness.NORMAL_RATE + 6 + k], g[Witness.NORMAL_RATE + 12 + k]
        a, b, c = cross(nx, ny, nz, x, y, z)
        s = spin * (sx * x + sy * y + sz * z)
        out[k] = a + nx * s
        out[6 + k] = b + ny * s
        out[12 + k] = c + nz * s


@kernel
def _slip_rows(data: Data, h: float, i: int, sign: float, r: Vec3, t: Vec3, row: Vector) -> None:
    """row (6,) = sign d(t.u_i)/d(twist of body i) at a fixed point p = x_i3 + r and direction t.

    u_i = (x3 - x2)/h + omega x (p - x3)    ->    t/h - t x omega on dx3,   (c y + s x y)/h on dphi,   y = r x t
    """
    w = data.turn[i]
    g = 2.0 / h
    ox, oy, oz = cross(t[0], t[1], t[2], g * w[1], g * w[2], g * w[3])
    vx, vy, vz = sign * (t[0] / h - ox), sign * (t[1] / h - oy), sign * (t[2] / h - oz)
    yx, yy, yz = cross(r[0], r[1], r[2], t[0], t[1], t[2])
    sx, sy, sz = cross(w[1], w[2], w[3], yx, yy, yz)
    dx, dy, dz = (
        data.pos3[i, 0] - data.origin[0],
        data.pos3[i, 1] - data.origin[1],
        data.pos3[i, 2] - data.origin[2],
    )
    mx, my, mz = cross(dx, dy, dz, vx, vy, vz)
    row[0] = vx
    row[1] = vy
    row[2] = vz
    row[3] = mx + sign * (w[0] * yx + sx) / h
    row[4] = my + sign * (w[0] * yy + sy) / h
    row[5] = mz + sign * (w[0] * yz + sz) / h


@kernel
def _arm(data: Data, i: int, F: Vector) -> Vec3:
    """The contact point of a pair from the centre of mass of body i."""
    p, x = three(F, PairFrame.POINT), data.pos3[i]
    return p[0] - x[0], p[1] - x[1], p[2] - x[2]


@kernel
def _pair_slip(data: Data, h: float, j: int, a: int, b: int, e: int, w: Vec3, v: Vec3) -> None:
    """Row e of pair_C, slip along t_e: at a fixed point and direction, and as both move by M and Omega.

    w, v: relative angular velocity and velocity of a against b at the point.
    """
    Omega, M, F, Ca, Cb = data.pair_turn[j], data.pair_shift[j], data.pair_frame[j], data.pair_Ca[j], data.pair_Cb[j]
    o, rows = data.origin, data.pair_rows
    t = (F[3 * e], F[3 * e + 1], F[3 * e + 2])
    _slip_rows(data, h, a, 1.0, _arm(data, a, F), t, rows[0])
    for k in range(6):
        rows[1, k] = 0.0
    if b >= 0:
        _slip_rows(data, h, b, -1.0, _arm(data, b, F), t, rows[1])
    gp = cross(t[0], t[1], t[2], w[0], w[1], w[2])
    px, py, pz = F[PairFrame.POINT] - o[0], F[PairFrame.POINT + 1] - o[1], F[PairFrame.POINT + 2] - o[2]
    gm = cross(px, py, pz, gp[0], gp[1], gp[2])
    ge = cross(t[0], t[1], t[2], v[0], v[1], v[2])
    for k in range(6):
        rel = 0.0
        for r in range(3):
            rel += M[6 * r + k] * gp[r] + Omega[6 * r + k] * ge[r]
        Ca[6 * e + k] = rows[0, k] + rel
        Cb[6 * e + k] = rows[1, k] - rel
    for k in range(3):
        Cb[6 * e + k] += gp[k]
        Cb[6 * e + 3 + k] += gm[k] + ge[k]


@kernel
def pair_jacobian(model: Model, data: Data, h: float, j: int) -> None:
    """pair_turn, pair_shift: Omega and M about O;  pair_C: d(gap, slip) by the twists of a, then of b."""
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    s = shape_b(model, j)
    o = data.origin
    x, y, z = data.shape_pos[s, 0] - o[0], data.shape_pos[s, 1] - o[1], data.shape_pos[s, 2] - o[2]
    g = data.pair_out[j]
    frame_turn(g, data.pair_scratch)
    shape_to_world(data.pair_scratch, 0, data, s, x, y, z, data.pair_turn[j])
    shape_to_world(g, Witness.POINT_RATE.value, data, s, x, y, z, data.pair_shift[j])
    F = data.pair_frame[j]
    px, py, pz = F[PairFrame.POINT] - o[0], F[PairFrame.POINT + 1] - o[1], F[PairFrame.POINT + 2] - o[2]
    Ca = data.pair_Ca[j]
    Cb = data.pair_Cb[j]
    n = gap_normal(model, data, j)
    m = cross(px, py, pz, n[0], n[1], n[2])
    for k in range(3):
        Ca[k] = n[k]
        Ca[3 + k] = m[k]
        Cb[k] = -n[k]
        Cb[3 + k] = -m[k]
    va = point_velocity(data, h, a, *three(F, PairFrame.POINT))
    vb = point_velocity(data, h, b, *three(F, PairFrame.POINT))
    q = 2.0 / h
    wx, wy, wz = q * data.turn[a, 1], q * data.turn[a, 2], q * data.turn[a, 3]
    if b >= 0:
        wx -= q * data.turn[b, 1]
        wy -= q * data.turn[b, 2]
        wz -= q * data.turn[b, 3]
    v = (va[0] - vb[0], va[1] - vb[1], va[2] - vb[2])
    for e in range(1, 3):
        _pair_slip(data, h, j, a, b, e, (wx, wy, wz), v)


@optional(Slot.PAIR_RATE, default=(0.0, 0.0, 0.0))
def pair_rate(model: Model, data: Data, c: int) -> Vec3:
    """d(gap, slip) of contact c, a pair, with the twists of the last solve."""
    j = c - model.contact_height.shape[0]
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    x, y, z = _row_product(data.pair_Ca[j], data.twist[a])
    if b >= 0:
        d = _row_product(data.pair_Cb[j], data.twist[b])
        return x + d[0], y + d[1], z + d[2]
    return x, y, z


@kernel
def _row_product(C: Vector, t: Vector) -> Vec3:
    """C t, C (3 x 6)."""
    return (
        C[0] * t[0] + C[1] * t[1] + C[2] * t[2] + C[3] * t[3] + C[4] * t[4] + C[5] * t[5],
        C[6] * t[0] + C[7] * t[1] + C[8] * t[2] + C[9] * t[3] + C[10] * t[4] + C[11] * t[5],
        C[12] * t[0] + C[13] * t[1] + C[14] * t[2] + C[15] * t[3] + C[16] * t[4] + C[17] * t[5],
    )
