"""Contacts on terrain, a height field F of their own radius (terrain.py): gap, frame, and rotation of the frame.

    gap      phi = (z - F(x, y))/w of the centre (x, y, z) of the ball,    w = sqrt(1 + |grad F|^2)
    normal   n = (-F_x, -F_y, 1)/w
    frame    t1, t2: the x and y axes turned with z into n the shortest way, so that no normal is special

F is the lower bound of the centre of a ball of this radius, the surface at that distance: n is normal to the ground
where the ball touches it. On an inclined plane all terms are those of a half-space. Per displacement dc of the centre:

    dphi = m.dc,   m = n - (phi/w^2) (H grad F, 0),   dn = -(I - n n^T) H dc/w,   H the second derivatives of F
    the frame turns by  n x dn + n (n_y dn_x - n_x dn_y)/(1 + n_z)

Scenes without terrain do not compile these kernels.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.height_field import height_field
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bounce, Grid, Kin
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, rotate, three, transposed_times
from solvers.types import Matrix, Vector


@kernel
def upright_frame(x: float, y: float, z: float, out: Vector) -> None:
    """out (9,) = rows n, t1, t2 for the normal n = (x, y, z), z > -1."""
    i = 1.0 / (1.0 + z)
    out[0], out[1], out[2] = x, y, z
    out[3], out[4], out[5] = 1.0 - i * x * x, -i * x * y, -x
    out[6], out[7], out[8] = -i * x * y, 1.0 - i * y * y, -y


@kernel
def center(model: Model, c: int, pos: Matrix, rot: Matrix) -> Vec3:
    """Centre of the ball of contact c, world axes, at the poses pos (nbody, 3), rot (nbody, 9) of bodies."""
    i = model.contact_body[c]
    p = model.contact_point[c]
    x, y, z = rotate(rot, i, p[0], p[1], p[2])
    return x + pos[i, 0], y + pos[i, 1], z + pos[i, 2]


@optional(Slot.PLACE_ON_TERRAIN)
def place_on_terrain(model: Model, data: Data, c: int) -> None:
    """Gap and contact_frame of contact c at configuration 3."""
    x, y, z = center(model, c, data.pos3, data.rot3)
    F, Fx, Fy, _xx, _xy, _yy = height_field(model, model.contact_terrain[c] - 1, x, y)
    i = 1.0 / sqrt(1.0 + Fx * Fx + Fy * Fy)
    upright_frame(-i * Fx, -i * Fy, i, data.contact_frame[c])
    data.contact_kin[c, Kin.GAP] = i * (z - F - model.contact_height[c])


@optional(Slot.TERRAIN_GAP, default=0.0)
def terrain_gap(model: Model, data: Data, c: int, third: bool) -> float:
    """Lower bound of the distance of contact c at configuration 3 or 2."""
    k = model.contact_terrain[c] - 1
    x, y, z = center(model, c, data.pos3, data.rot3) if third else center(model, c, data.pos2, data.rot2)
    F = height_field(model, k, x, y)[0]
    return (z - F - model.contact_height[c]) / model.terrain_place[k, Grid.SLOPE]


@kernel
def turn_columns(n: Vector, Fxx: float, Fxy: float, Fyy: float) -> tuple[Vec3, Vec3]:
    """Rotation of the frame with the normal n per displacement of the centre along x, and along y."""
    ax, ay, az = frame_turn(n, -Fxx, -Fxy)
    bx, by, bz = frame_turn(n, -Fxy, -Fyy)
    return (ax, ay, az), (bx, by, bz)


@kernel
def frame_turn(n: Vector, gx: float, gy: float) -> Vec3:
    """Rotation of the frame with the normal n for the change (gx, gy, 0) of w n."""
    d = n[0] * gx + n[1] * gy
    x, y, z = n[2] * (gx - d * n[0]), n[2] * (gy - d * n[1]), -n[2] * d * n[2]
    s = (n[1] * x - n[0] * y) / (1.0 + n[2])
    a, b, c = cross(n[0], n[1], n[2], x, y, z)
    return a + s * n[0], b + s * n[1], c + s * n[2]


@optional(Slot.TURN_ON_TERRAIN)
def turn_on_terrain(model: Model, data: Data, h: float, c: int) -> None:
    """contact_turn = Omega, rotation of the frame by the twist about O; (gap, slip) rows of contact_kin on terrain.

    gap     m, (c - O) x m
    slip    those of a fixed frame, and  Omega^T (t x u - rho n x (t x omega))
    """
    i = model.contact_body[c]
    k = data.contact_kin[c]
    f = data.contact_frame[c]
    x, y, z = center(model, c, data.pos3, data.rot3)
    _F, Fx, Fy, Fxx, Fxy, Fyy = height_field(model, model.contact_terrain[c] - 1, x, y)
    e1, e2 = turn_columns(f[:3], Fxx, Fxy, Fyy)
    ax, ay, az = x - data.origin[0], y - data.origin[1], z - data.origin[2]
    W = data.contact_turn[c]
    for r in range(3):
        u, v = e1[r], e2[r]
        W[6 * r], W[6 * r + 1], W[6 * r + 2] = u, v, 0.0
        W[6 * r + 3], W[6 * r + 4], W[6 * r + 5] = -az * v, az * u, ax * v - ay * u
    g = (
        (k[Kin.GAP] + data.bounce[c, Bounce.FLOOR]) * f[2] * f[2]
    )  # contact_kin has the gap above the floor of an impact
    mx, my, mz = f[0] - g * (Fxx * Fx + Fxy * Fy), f[1] - g * (Fxy * Fx + Fyy * Fy), f[2]
    k[Kin.BY_TRANSLATION], k[Kin.BY_TRANSLATION + 1], k[Kin.BY_TRANSLATION + 2] = mx, my, mz
    k[Kin.BY_ROTATION], k[Kin.BY_ROTATION + 1], k[Kin.BY_ROTATION + 2] = cross(ax, ay, az, mx, my, mz)
    q = 2.0 / h
    o = (q * data.turn[i, 1], q * data.turn[i, 2], q * data.turn[i, 3])
    u0, u1, u2 = cross(o[0], o[1], o[2], *three(k, Kin.ARM))
    u0 += (data.pos3[i, 0] - data.pos2[i, 0]) / h
    u1 += (data.pos3[i, 1] - data.pos2[i, 1]) / h
    u2 += (data.pos3[i, 2] - data.pos2[i, 2]) / h
    rho = model.contact_radius[c]
    for e in range(1, 3):
        t0, t1, t2 = f[3 * e], f[3 * e + 1], f[3 * e + 2]
        a = cross(t0, t1, t2, u0, u1, u2)
        b = cross(t0, t1, t2, o[0], o[1], o[2])
        d = cross(f[0], f[1], f[2], b[0], b[1], b[2])
        s0, s1, s2 = a[0] - rho * d[0], a[1] - rho * d[1], a[2] - rho * d[2]
        for j in range(3):
            k[Kin.BY_TRANSLATION + 3 * e + j] += s0 * W[j] + s1 * W[6 + j] + s2 * W[12 + j]
            k[Kin.BY_ROTATION + 3 * e + j] += s0 * W[3 + j] + s1 * W[9 + j] + s2 * W[15 + j]


@optional(Slot.ADD_FRAME_MATRIX)
def add_frame_matrix(model: Model, data: Data, c: int, fn: float, f1: float, f2: float, out: Matrix) -> None:
    """out[body] -= d(wrench about O)/d(twist) by the turning of the frame, of the impulse f = n fn + t1 f1 + t2 f2:

    (Omega x f,  a x (Omega x f) - rho (Omega x n) x f),   a: from O to where the impulse acts
    """
    i = model.contact_body[c]
    k = data.contact_kin[c]
    F = data.contact_frame[c]
    W = data.contact_turn[c]
    A = out[i]
    x, y, z = transposed_times(F, fn, f1, f2)
    rho = model.contact_radius[c]
    ax = data.pos2[i, 0] - data.origin[0] + k[Kin.ARM]
    ay = data.pos2[i, 1] - data.origin[1] + k[Kin.ARM + 1]
    az = data.pos2[i, 2] - data.origin[2] + k[Kin.ARM + 2]
    for j in range(6):
        d = cross(W[j], W[6 + j], W[12 + j], x, y, z)
        n = cross(W[j], W[6 + j], W[12 + j], F[0], F[1], F[2])
        t = cross(ax, ay, az, d[0], d[1], d[2])
        s = cross(n[0], n[1], n[2], x, y, z)
        for r in range(3):
            A[6 * r + j] -= d[r]
            A[18 + 6 * r + j] -= t[r] - rho * s[r]
