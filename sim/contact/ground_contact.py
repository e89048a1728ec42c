"""Geometry of a sphere or point against the ground at configuration 3, and its part of the Newton matrix.

    gap   phi = n.(x3 + R3 p) - radius - height
    slip  v_t = T ((x3 - x2)/h + omega x r),   r = R3 p - radius n,   omega = (2/h) s   with (c, s) the turn from 2 to 3

The impulse f = n gamma + T^T beta acts at r from the centre of mass, as the wrench (f, r x f) in world axes (expressing
the torque in the frame of configuration 3, as Dojo does, breaks angular momentum at O(h |omega|)).

Columns of contact_kin: sim/model/record_columns.py. Of a half-space, the rows of the Jacobian by the
translation are n, T/h.

contact_frame holds the rows n, T: those of the half-space, or on terrain those of the place (terrain_contact.py).
"""

from __future__ import annotations

from sim.contact.terrain_contact import place_on_terrain, turn_on_terrain
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Kin
from solvers.compiler import kernel
from solvers.rotation import cross, put_three, rotate, three, transposed_times
from solvers.types import Matrix, Vector


@kernel
def contact_kinematics(model: Model, data: Data, h: float, c: int) -> None:
    """Gap, slip and arms at configuration 3 of contact c."""
    g = 2.0 / h
    i = model.contact_body[c]
    k = data.contact_kin[c]
    f = data.contact_frame[c]
    curved = model.contact_terrain[c] > 0
    if curved:
        place_on_terrain(model, data, c)
    point = model.contact_point[c]
    px, py, pz = rotate(data.rot3, i, point[0], point[1], point[2])
    rho = model.contact_radius[c]
    x, y, z = px - rho * f[0], py - rho * f[1], pz - rho * f[2]
    ox, oy, oz = g * data.turn[i, 1], g * data.turn[i, 2], g * data.turn[i, 3]
    vx, vy, vz = cross(ox, oy, oz, x, y, z)
    vx += (data.pos3[i, 0] - data.pos2[i, 0]) / h
    vy += (data.pos3[i, 1] - data.pos2[i, 1]) / h
    vz += (data.pos3[i, 2] - data.pos2[i, 2]) / h
    if not curved:
        X, Y, Z = data.pos3[i, 0] + x, data.pos3[i, 1] + y, data.pos3[i, 2] + z
        k[Kin.GAP] = f[0] * X + f[1] * Y + f[2] * Z - model.contact_height[c]
    k[Kin.SLIP1] = f[3] * vx + f[4] * vy + f[5] * vz
    k[Kin.SLIP2] = f[6] * vx + f[7] * vy + f[8] * vz
    k[Kin.ARM], k[Kin.ARM + 1], k[Kin.ARM + 2] = x, y, z
    k[Kin.POINT], k[Kin.POINT + 1], k[Kin.POINT + 2] = px, py, pz


@kernel
def contact_jacobian(model: Model, data: Data, h: float, c: int) -> None:
    """d(gap, slip)/d(twist of configuration 3), about O: by the translation, and by the rotation

    gap     n        (d3 + R3 p) x n
    slip    t/h      (d3 x t + c y + s x y)/h - R3 p x (omega x t),   y = r x t

    and the terms of a terrain whose frame changes from place to place.
    """
    i = model.contact_body[c]
    k = data.contact_kin[c]
    f = data.contact_frame[c]
    dx = data.pos3[i, 0] - data.origin[0]
    dy = data.pos3[i, 1] - data.origin[1]
    dz = data.pos3[i, 2] - data.origin[2]
    px, py, pz = three(k, Kin.POINT)
    put_three(cross(dx + px, dy + py, dz + pz, f[0], f[1], f[2]), Kin.BY_ROTATION, k)
    w, sx, sy, sz = data.turn[i, 0], data.turn[i, 1], data.turn[i, 2], data.turn[i, 3]
    g = 2.0 / h
    for e in range(3):
        k[Kin.BY_TRANSLATION + e] = f[e]
        k[Kin.BY_TRANSLATION + 3 + e] = f[3 + e] / h
        k[Kin.BY_TRANSLATION + 6 + e] = f[6 + e] / h
    for e in range(1, 3):
        tx, ty, tz = f[3 * e], f[3 * e + 1], f[3 * e + 2]
        ax, ay, az = cross(dx, dy, dz, tx, ty, tz)
        yx, yy, yz = cross(*three(k, Kin.ARM), tx, ty, tz)
        bx, by, bz = cross(sx, sy, sz, yx, yy, yz)
        ux, uy, uz = cross(sx, sy, sz, tx, ty, tz)
        mx, my, mz = cross(*three(k, Kin.POINT), ux, uy, uz)
        k[Kin.BY_ROTATION + 3 * e] = (ax + w * yx + bx) / h - g * mx
        k[Kin.BY_ROTATION + 1 + 3 * e] = (ay + w * yy + by) / h - g * my
        k[Kin.BY_ROTATION + 2 + 3 * e] = (az + w * yz + bz) / h - g * mz
    if model.contact_terrain[c] > 0:
        turn_on_terrain(model, data, h, c)


@kernel
def add_contact_wrench(model: Model, data: Data, c: int, fn: float, f1: float, f2: float, out: Matrix) -> None:
    """out[body] -= wrench about O of the impulse n fn + t1 f1 + t2 f2 at contact c (accumulated)."""
    i = model.contact_body[c]
    k = data.contact_kin[c]
    x, y, z = transposed_times(data.contact_frame[c], fn, f1, f2)
    ax = data.pos2[i, 0] - data.origin[0] + k[Kin.ARM]
    ay = data.pos2[i, 1] - data.origin[1] + k[Kin.ARM + 1]
    az = data.pos2[i, 2] - data.origin[2] + k[Kin.ARM + 2]
    tx, ty, tz = cross(ax, ay, az, x, y, z)
    out[i, 0] -= x
    out[i, 1] -= y
    out[i, 2] -= z
    out[i, 3] -= tx
    out[i, 4] -= ty
    out[i, 5] -= tz


@kernel
def add_contact_law(model: Model, data: Data, c: int, out: Matrix) -> None:
    """out[body] -= B^T W C, about O (accumulated):

    C = d(gap, slip)/d(twist), W = d(impulse)/d(gap, slip), B^T the map from impulse to wrench.
    """
    i = model.contact_body[c]
    k = data.contact_kin[c]
    F = data.contact_frame[c]
    W = data.contact_W[c]
    A = out[i]
    ax = data.pos2[i, 0] - data.origin[0] + k[Kin.ARM]
    ay = data.pos2[i, 1] - data.origin[1] + k[Kin.ARM + 1]
    az = data.pos2[i, 2] - data.origin[2] + k[Kin.ARM + 2]
    x0, y0, z0 = transposed_times(F, W[0], W[3], W[6])  # columns of F^T W
    x1, y1, z1 = transposed_times(F, W[1], W[4], W[7])
    x2, y2, z2 = transposed_times(F, W[2], W[5], W[8])
    for j in range(6):
        q = Kin.BY_TRANSLATION + j if j < 3 else Kin.BY_ROTATION + j - 3
        c0, c1, c2 = k[q], k[q + 3], k[q + 6]
        x = x0 * c0 + x1 * c1 + x2 * c2
        y = y0 * c0 + y1 * c1 + y2 * c2
        z = z0 * c0 + z1 * c1 + z2 * c2
        A[j] -= x
        A[6 + j] -= y
        A[12 + j] -= z
        A[18 + j] -= ay * z - az * y
        A[24 + j] -= az * x - ax * z
        A[30 + j] -= ax * y - ay * x


@kernel
def add_contact_turn(model: Model, data: Data, c: int, fn: float, f1: float, f2: float, out: Matrix) -> None:
    """out[body] -= [f] [R3 p] on rotations: the arm of the impulse turns with the body, d(r x f) = [f] [R3 p] dphi."""
    k = data.contact_kin[c]
    A = out[model.contact_body[c]]
    x, y, z = transposed_times(data.contact_frame[c], fn, f1, f2)
    px, py, pz = three(k, Kin.POINT)
    dot = x * px + y * py + z * pz
    A[21] -= px * x - dot
    A[22] -= px * y
    A[23] -= px * z
    A[27] -= py * x
    A[28] -= py * y - dot
    A[29] -= py * z
    A[33] -= pz * x
    A[34] -= pz * y
    A[35] -= pz * z - dot


@kernel
def _rate(k: Vector, row: int, t: Vector) -> float:
    """Row of C times the twist t."""
    v, w = Kin.BY_TRANSLATION + 3 * row, Kin.BY_ROTATION + 3 * row
    return k[v] * t[0] + k[v + 1] * t[1] + k[v + 2] * t[2] + k[w] * t[3] + k[w + 1] * t[4] + k[w + 2] * t[5]


@kernel
def contact_rate(model: Model, data: Data, c: int) -> tuple[float, float, float]:
    """d(gap, slip) = C twist, with the twists of the last solve."""
    k = data.contact_kin[c]
    t = data.twist[model.contact_body[c]]
    return _rate(k, 0, t), _rate(k, 1, t), _rate(k, 2, t)
