"""Parameters of contacts and of collisions: dR/d(parameter) of the residual of a step, columns[:, col] -= w dR.

The impulse follows its law, W = d(impulse)/d(gap, slip) on the central path; its arm r and frame follow poses and
shapes. f = n gamma + T^T beta acts on the body, so dR_d = -S2_d.(df, (d2 + r) x df + dr x f).
"""

from __future__ import annotations

from sim.contact.collision.witness import dot
from sim.contact.contact_law import contact_impulse, law_of
from sim.contact.pairs.pair_contact import is_absent, pair_arm, pair_force
from sim.contact.pairs.wrench_columns import unit_vector
from sim.contact.terrain_contact import center
from sim.derivatives.parameters.body_columns import add_wrench, moment
from sim.derivatives.parameters.moment_columns import add_moment_change, add_moment_friction, add_moment_time_step
from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.record_columns import Bounce, Cone, ConeScale, Kin, Pyramid, PyramidScale
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross, rotate, three
from solvers.types import Vector


@kernel
def is_active(data: Data, c: int) -> bool:
    """Whether contact c was active in the step; inactive ones have no part in its derivatives either."""
    for m in range(data.active_count[0]):
        if data.active[m] == c:
            return True
    return False


@kernel
def impulse_change(data: Data, c: int, gap: float, s1: float, s2: float) -> Vec3:
    """W (gap, s1, s2)"""
    W = data.contact_W[c]
    return (
        W[0] * gap + W[1] * s1 + W[2] * s2,
        W[3] * gap + W[4] * s1 + W[5] * s2,
        W[6] * gap + W[7] * s1 + W[8] * s2,
    )


@kernel
def friction_change(model: Model, data: Data, c: int) -> Vec3:
    """d(impulse)/d(friction) at the present gap and slip: gamma d(beta)/d(mu gamma)."""
    q = data.contact_scale[c]
    gamma = data.cone[c, Cone.IMPULSE]
    law = law_of(model, c)
    if law == Law.NONLINEAR:
        return 0.0, gamma * q[ConeScale.GROWTH], gamma * q[ConeScale.GROWTH + 1]
    if law == Law.LINEAR:
        g = gamma * data.cone[c, Pyramid.SPEED] * q[PyramidScale.INVERSE]
        return 0.0, g * q[PyramidScale.SUM], g * q[PyramidScale.SUM + 1]
    return 0.0, 0.0, 0.0


@kernel
def ground_force(data: Data, c: int, p: Vec3) -> Vec3:
    """n p0 + t1 p1 + t2 p2"""
    F = data.contact_frame[c]
    return (
        F[0] * p[0] + F[3] * p[1] + F[6] * p[2],
        F[1] * p[0] + F[4] * p[1] + F[7] * p[2],
        F[2] * p[0] + F[5] * p[1] + F[8] * p[2],
    )


@kernel
def add_ground(model: Model, data: Data, c: int, df: Vec3, dr: Vec3, w: float, col: int) -> None:
    """The change df of the force, and dr of its arm, of contact c with the ground."""
    i = model.contact_body[c]
    k = data.contact_kin[c]
    f = ground_force(data, c, contact_impulse(model, data, c))
    a = cross(*three(k, Kin.ARM), df[0], df[1], df[2])
    b = cross(dr[0], dr[1], dr[2], f[0], f[1], f[2])
    add_wrench(model, data, i, df, moment(data, i, df, (a[0] + b[0], a[1] + b[1], a[2] + b[2])), -w, col)


@kernel
def add_pair(model: Model, data: Data, j: int, df: Vec3, dP: Vec3, w: float, col: int) -> None:
    """The change df of the force on a, and dP of the point where it acts, of pair j."""
    k = model.pair_coupling[j]
    P = pair_arm(model, data, j)
    p = contact_impulse(model, data, model.contact_height.shape[0] + j)
    f = pair_force(data, j, p[0], p[1], p[2])
    a = cross(P[0], P[1], P[2], df[0], df[1], df[2])
    b = cross(dP[0], dP[1], dP[2], f[0], f[1], f[2])
    m = (a[0] + b[0], a[1] + b[1], a[2] + b[2])
    add_wrench(model, data, model.coupling_body[k, 0], df, m, -w, col)
    add_wrench(model, data, model.coupling_body[k, 1], df, m, w, col)


@kernel
def add_impulse(model: Model, data: Data, c: int, p: Vec3, w: float, col: int) -> None:
    """The change p of the impulse (normal, t1, t2) of contact c, where it acts."""
    zero = (0.0, 0.0, 0.0)
    j = c - model.contact_height.shape[0]
    if j < 0:
        add_ground(model, data, c, ground_force(data, c, p), zero, w, col)
    elif not is_absent(data, j):
        add_pair(model, data, j, pair_force(data, j, p[0], p[1], p[2]), zero, w, col)


@kernel
def add_friction(model: Model, data: Data, c: int, w: float, col: int) -> None:
    """The friction coefficient of contact c."""
    if is_active(data, c):
        add_impulse(model, data, c, friction_change(model, data, c), w, col)


@kernel
def add_friction_against_turning(model: Model, data: Data, c: int, e: int, w: float, col: int) -> None:
    """Torsional (e = 0) or rolling friction of contact c."""
    if is_active(data, c):
        add_moment_friction(model, data, c, e, w, col)


@kernel
def add_slips_time_step(model: Model, data: Data, h: float, w: float, col: int) -> None:
    """The slips of all contacts, which are displacements over h: -slip/h."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        k = data.contact_kin[c]
        add_impulse(model, data, c, impulse_change(data, c, 0.0, -k[Kin.SLIP1] / h, -k[Kin.SLIP2] / h), w, col)
    add_moment_time_step(model, data, h, w, col)


@kernel
def turning(data: Data, h: float, i: int, r: Vec3) -> Vec3:
    """omega x r, omega = (2/h) s of body i"""
    t = data.turn[i]
    g = 2.0 / h
    return cross(g * t[1], g * t[2], g * t[3], r[0], r[1], r[2])


@kernel
def floor_change(data: Data, c: int, d1: float, d2: float) -> float:
    """Change of the floor of an impact (contact/restitution.py), of the gaps at 1 and 2; 0 where there is none."""
    e = data.bounce[c, Bounce.RESTITUTION]
    return (1.0 - e) * d2 + e * d1 if e > 0.0 else 0.0


@kernel
def add_restitution(model: Model, data: Data, h: float, c: int, w: float, col: int) -> None:
    """The restitution of contact c, in an impact: its floor rises by phi1 - phi2."""
    b = data.bounce[c]
    if is_active(data, c) and b[Bounce.RESTITUTION] > 0.0:
        rise = (b[Bounce.GAP1] - b[Bounce.GAP2]) * b[Bounce.RESTITUTION] / model.contact_restitution[c]
        add_impulse(model, data, c, impulse_change(data, c, -rise, 0.0, 0.0), w, col)
        add_moment_change(model, data, h, c, (0.0, -rise), (0.0, 0.0, 0.0), w, col)


@kernel
def _along(row: Vector, first: int, e: Vec3) -> float:
    return row[first] * e[0] + row[first + 1] * e[1] + row[first + 2] * e[2]


@kernel
def add_point(model: Model, data: Data, h: float, c: int, k: int, w: float, col: int) -> None:
    """The centre of contact c moves by e = R3 e_k, the frame of a terrain turns by a = Omega e:

    gap m.e    slip t.(omega x e) + a.(t x u - ..)    dr = e - rho a x n    df = F^T W d + a x f
    """
    if not is_active(data, c):
        return
    i = model.contact_body[c]
    F, kin = data.contact_frame[c], data.contact_kin[c]
    x, y, z = unit_vector(k)
    e = rotate(data.rot3, i, x, y, z)
    b = data.bounce[c]
    first = Kin.BY_TRANSLATION.value
    gap = _along(kin, first, e)
    before = _along(b, Bounce.ROW1.value, rotate(data.rot1, i, x, y, z))
    gap -= floor_change(data, c, before, _along(b, Bounce.ROW2.value, rotate(data.rot2, i, x, y, z)))
    v = turning(data, h, i, e)
    v = (v[0] - e[0] / h, v[1] - e[1] / h, v[2] - e[2] / h)  # rows of kin are of a moving body
    s1 = _along(F, 3, v) + _along(kin, first + 3, e)
    s2 = _along(F, 6, v) + _along(kin, first + 6, e)
    p = impulse_change(data, c, gap, s1, s2)
    df = ground_force(data, c, p)
    dr, a = e, (0.0, 0.0, 0.0)
    if model.contact_terrain[c] > 0:
        T = data.contact_turn[c]
        a = (_along(T, 0, e), _along(T, 6, e), _along(T, 12, e))
        n = cross(a[0], a[1], a[2], F[0], F[1], F[2])
        rho = model.contact_radius[c]
        dr = (e[0] - rho * n[0], e[1] - rho * n[1], e[2] - rho * n[2])
        f = ground_force(data, c, contact_impulse(model, data, c))
        g = cross(a[0], a[1], a[2], f[0], f[1], f[2])
        df = (df[0] + g[0], df[1] + g[1], df[2] + g[2])
    add_ground(model, data, c, df, dr, w, col)
    add_moment_change(model, data, h, c, (gap, gap), a, w, col)


@kernel
def add_radius(model: Model, data: Data, h: float, c: int, w: float, col: int) -> None:
    """dr = -n    gap n.dr = -1    slip T (omega x dr);  on terrain the gap is left to surface.py"""
    if not is_active(data, c):
        return
    F = data.contact_frame[c]
    dr = (-F[0], -F[1], -F[2])
    v = turning(data, h, model.contact_body[c], dr)
    gap = 0.0 if model.contact_terrain[c] > 0 else -1.0 - floor_change(data, c, -1.0, -1.0)
    p = impulse_change(data, c, gap, _along(F, 3, v), _along(F, 6, v))
    add_ground(model, data, c, ground_force(data, c, p), dr, w, col)
    add_moment_change(model, data, h, c, (gap, gap), (0.0, 0.0, 0.0), w, col)


@kernel
def add_height(model: Model, data: Data, h: float, c: int, w: float, col: int) -> None:
    """gap -1, -n_z on terrain"""
    if not is_active(data, c):
        return
    b = data.bounce[c]
    gap = -1.0 - floor_change(data, c, -1.0, -1.0)
    if model.contact_terrain[c] > 0:
        gap = -data.contact_frame[c, 2] - floor_change(data, c, -b[Bounce.ROW1 + 2], -b[Bounce.ROW2 + 2])
    add_impulse(model, data, c, impulse_change(data, c, gap, 0.0, 0.0), w, col)
    add_moment_change(model, data, h, c, (gap, gap), (0.0, 0.0, 0.0), w, col)


@kernel
def add_normal(model: Model, data: Data, h: float, c: int, k: int, w: float, col: int) -> None:
    """The half-space of contact c turns by e_k about the origin:  gap dn.(x3 + R3 p)"""
    if is_active(data, c):
        F = data.contact_frame[c]
        e = unit_vector(k)
        n = cross(e[0], e[1], e[2], F[0], F[1], F[2])
        gap = dot(n, center(model, c, data.pos3, data.rot3))
        before = dot(n, center(model, c, data.pos1, data.rot1)), dot(n, center(model, c, data.pos2, data.rot2))
        add_turn(model, data, h, c, e, gap - floor_change(data, c, before[0], before[1]), w, col)


@kernel
def add_turn(model: Model, data: Data, h: float, c: int, e: Vec3, gap: float, w: float, col: int) -> None:
    """The frame of contact c turns by e, and its gap grows by `gap`:

    dn = e x n, dt = e x t, dr = -radius dn    slip dt.u + t.(omega x dr)    df = F^T W d + e x f
    """
    i = model.contact_body[c]
    F = data.contact_frame[c]
    kin = data.contact_kin[c]
    n = cross(e[0], e[1], e[2], F[0], F[1], F[2])
    rho = model.contact_radius[c]
    dr = (-rho * n[0], -rho * n[1], -rho * n[2])
    p, q = data.pos3[i], data.pos2[i]
    u = turning(data, h, i, three(kin, Kin.ARM))
    u = (u[0] + (p[0] - q[0]) / h, u[1] + (p[1] - q[1]) / h, u[2] + (p[2] - q[2]) / h)
    eu = cross(u[0], u[1], u[2], e[0], e[1], e[2])  # (e x t).u = t.(u x e)
    v = turning(data, h, i, dr)
    v = (v[0] + eu[0], v[1] + eu[1], v[2] + eu[2])
    s1 = F[3] * v[0] + F[4] * v[1] + F[5] * v[2]
    s2 = F[6] * v[0] + F[7] * v[1] + F[8] * v[2]
    df = ground_force(data, c, impulse_change(data, c, gap, s1, s2))
    f = ground_force(data, c, contact_impulse(model, data, c))
    g = cross(e[0], e[1], e[2], f[0], f[1], f[2])
    add_ground(model, data, c, (df[0] + g[0], df[1] + g[1], df[2] + g[2]), dr, w, col)
    add_moment_change(model, data, h, c, (gap, gap), e, w, col)
