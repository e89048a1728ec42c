"""Parameters of contacts and of collisions: dR/d(parameter) of the residual of a step, columns[:, col] -= w dR.

The impulse follows its law, W = d(impulse)/d(gap, slip) on the central path, and its arm r and frame what they are
made of; f = n gamma + T^T beta acts on the body, so dR_d = -S2_d.(df, (d2 + r) x df + dr x f).
"""

from __future__ import annotations

from sim.contact.collision.witness import dot
from sim.contact.contact_law import contact_impulse, law_of
from sim.contact.pairs.pair_contact import is_absent, pair_arm, pair_force
from sim.contact.pairs.wrench_columns import unit_vector
from sim.contact.terrain_contact import centre
from sim.derivatives.parameters.body_columns import add_wrench, moment
from sim.model.columns import Bounce, Cone, ConeScale, Kin
from sim.model.data import Work
from sim.model.model import Law, Model
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross, rotate, three
from solvers.types import Vector


@kernel
def is_active(work: Work, c: int) -> bool:
    """Whether contact c was active in the step; inactive ones have no part in its derivatives either."""
    for m in range(work.active_count[0]):
        if work.active[m] == c:
            return True
    return False


@kernel
def impulse_change(work: Work, c: int, gap: float, s1: float, s2: float) -> Vec3:
    """W (gap, s1, s2)"""
    W = work.contact_W[c]
    return (
        W[0] * gap + W[1] * s1 + W[2] * s2,
        W[3] * gap + W[4] * s1 + W[5] * s2,
        W[6] * gap + W[7] * s1 + W[8] * s2,
    )


@kernel
def friction_change(model: Model, work: Work, c: int) -> Vec3:
    """d(impulse)/d(friction) at the present gap and slip: gamma d(beta)/d(mu gamma)."""
    q = work.contact_scale[c]
    gamma = work.cone[c, Cone.IMPULSE]
    law = law_of(model, c)
    if law == Law.NONLINEAR:
        return 0.0, gamma * q[ConeScale.GROWTH], gamma * q[ConeScale.GROWTH + 1]
    if law == Law.LINEAR:
        g = gamma * work.cone[c, Cone.FRICTION1] * q[ConeScale.RESIDUAL + 4]
        return 0.0, g * q[ConeScale.RESIDUAL + 2], g * q[ConeScale.RESIDUAL + 3]
    return 0.0, 0.0, 0.0


@kernel
def ground_force(work: Work, c: int, p: Vec3) -> Vec3:
    """n p0 + t1 p1 + t2 p2"""
    F = work.contact_frame[c]
    return (
        F[0] * p[0] + F[3] * p[1] + F[6] * p[2],
        F[1] * p[0] + F[4] * p[1] + F[7] * p[2],
        F[2] * p[0] + F[5] * p[1] + F[8] * p[2],
    )


@kernel
def add_ground(model: Model, work: Work, c: int, df: Vec3, dr: Vec3, w: float, col: int) -> None:
    """The change df of the force, and dr of its arm, of contact c with the ground."""
    i = model.contact_body[c]
    k = work.contact_kin[c]
    f = ground_force(work, c, contact_impulse(model, work, c))
    a = cross(*three(k, Kin.ARM), df[0], df[1], df[2])
    b = cross(dr[0], dr[1], dr[2], f[0], f[1], f[2])
    add_wrench(model, work, i, df, moment(work, i, df, (a[0] + b[0], a[1] + b[1], a[2] + b[2])), -w, col)


@kernel
def add_pair(model: Model, work: Work, j: int, df: Vec3, dP: Vec3, w: float, col: int) -> None:
    """The change df of the force on a, and dP of the point where it acts, of pair j."""
    k = model.pair_coupling[j]
    P = pair_arm(model, work, j)
    p = contact_impulse(model, work, model.contact_height.shape[0] + j)
    f = pair_force(work, j, p[0], p[1], p[2])
    a = cross(P[0], P[1], P[2], df[0], df[1], df[2])
    b = cross(dP[0], dP[1], dP[2], f[0], f[1], f[2])
    m = (a[0] + b[0], a[1] + b[1], a[2] + b[2])
    add_wrench(model, work, model.coupling_body[k, 0], df, m, -w, col)
    add_wrench(model, work, model.coupling_body[k, 1], df, m, w, col)


@kernel
def add_impulse(model: Model, work: Work, c: int, p: Vec3, w: float, col: int) -> None:
    """The change p of the impulse (normal, t1, t2) of contact c, where it acts."""
    zero = (0.0, 0.0, 0.0)
    j = c - model.contact_height.shape[0]
    if j < 0:
        add_ground(model, work, c, ground_force(work, c, p), zero, w, col)
    elif not is_absent(work, j):
        add_pair(model, work, j, pair_force(work, j, p[0], p[1], p[2]), zero, w, col)


@kernel
def add_friction(model: Model, work: Work, c: int, w: float, col: int) -> None:
    """The friction coefficient of contact c."""
    if is_active(work, c):
        add_impulse(model, work, c, friction_change(model, work, c), w, col)


@kernel
def add_slips_time_step(model: Model, work: Work, h: float, w: float, col: int) -> None:
    """The slips of all contacts, which are displacements over h: -slip/h."""
    for m in range(work.active_count[0]):
        c = work.active[m]
        k = work.contact_kin[c]
        add_impulse(model, work, c, impulse_change(work, c, 0.0, -k[Kin.SLIP1] / h, -k[Kin.SLIP2] / h), w, col)


@kernel
def turning(work: Work, h: float, i: int, r: Vec3) -> Vec3:
    """omega x r, omega = (2/h) s of body i"""
    t = work.turn[i]
    g = 2.0 / h
    return cross(g * t[1], g * t[2], g * t[3], r[0], r[1], r[2])


@kernel
def floor_change(work: Work, c: int, d1: float, d2: float) -> float:
    """Change of the floor of an impact (contacts/restitution.py), of the gaps at 1 and 2; 0 where there is none."""
    e = work.bounce[c, Bounce.RESTITUTION]
    return (1.0 - e) * d2 + e * d1 if e > 0.0 else 0.0


@kernel
def add_restitution(model: Model, work: Work, c: int, w: float, col: int) -> None:
    """The restitution of contact c, in an impact: its floor rises by phi1 - phi2."""
    b = work.bounce[c]
    if is_active(work, c) and b[Bounce.RESTITUTION] > 0.0:
        rise = (b[Bounce.GAP1] - b[Bounce.GAP2]) * b[Bounce.RESTITUTION] / model.contact_restitution[c]
        add_impulse(model, work, c, impulse_change(work, c, -rise, 0.0, 0.0), w, col)


@kernel
def _along(row: Vector, first: int, e: Vec3) -> float:
    return row[first] * e[0] + row[first + 1] * e[1] + row[first + 2] * e[2]


@kernel
def add_point(model: Model, work: Work, h: float, c: int, k: int, w: float, col: int) -> None:
    """The centre of contact c moves by e = R3 e_k, the frame of a terrain turns by a = Omega e:

    gap m.e    slip t.(omega x e) + a.(t x u - ..)    dr = e - rho a x n    df = F^T W d + a x f
    """
    if not is_active(work, c):
        return
    i = model.contact_body[c]
    F, kin = work.contact_frame[c], work.contact_kin[c]
    x, y, z = unit_vector(k)
    e = rotate(work.rot3, i, x, y, z)
    b = work.bounce[c]
    gap = _along(kin, 18, e)
    gap -= floor_change(
        work, c, _along(b, 2, rotate(work.rot1, i, x, y, z)), _along(b, 8, rotate(work.rot2, i, x, y, z))
    )
    v = turning(work, h, i, e)
    v = (v[0] - e[0] / h, v[1] - e[1] / h, v[2] - e[2] / h)  # rows of kin are of a moving body
    p = impulse_change(work, c, gap, _along(F, 3, v) + _along(kin, 21, e), _along(F, 6, v) + _along(kin, 24, e))
    df = ground_force(work, c, p)
    dr = e
    if model.contact_terrain[c] > 0:
        T = work.contact_turn[c]
        a = (_along(T, 0, e), _along(T, 6, e), _along(T, 12, e))
        n = cross(a[0], a[1], a[2], F[0], F[1], F[2])
        rho = model.contact_radius[c]
        dr = (e[0] - rho * n[0], e[1] - rho * n[1], e[2] - rho * n[2])
        f = ground_force(work, c, contact_impulse(model, work, c))
        g = cross(a[0], a[1], a[2], f[0], f[1], f[2])
        df = (df[0] + g[0], df[1] + g[1], df[2] + g[2])
    add_ground(model, work, c, df, dr, w, col)


@kernel
def add_radius(model: Model, work: Work, h: float, c: int, w: float, col: int) -> None:
    """dr = -n    gap n.dr = -1    slip T (omega x dr);  on terrain the gap is left to surface.py"""
    if not is_active(work, c):
        return
    F = work.contact_frame[c]
    dr = (-F[0], -F[1], -F[2])
    v = turning(work, h, model.contact_body[c], dr)
    gap = 0.0 if model.contact_terrain[c] > 0 else -1.0 - floor_change(work, c, -1.0, -1.0)
    p = impulse_change(work, c, gap, _along(F, 3, v), _along(F, 6, v))
    add_ground(model, work, c, ground_force(work, c, p), dr, w, col)


@kernel
def add_height(model: Model, work: Work, c: int, w: float, col: int) -> None:
    """gap -1, -n_z on terrain"""
    if not is_active(work, c):
        return
    b = work.bounce[c]
    gap = -1.0 - floor_change(work, c, -1.0, -1.0)
    if model.contact_terrain[c] > 0:
        gap = -work.contact_frame[c, 2] - floor_change(work, c, -b[Bounce.ROW1 + 2], -b[Bounce.ROW2 + 2])
    add_impulse(model, work, c, impulse_change(work, c, gap, 0.0, 0.0), w, col)


@kernel
def add_normal(model: Model, work: Work, h: float, c: int, k: int, w: float, col: int) -> None:
    """The half-space of contact c turns by e_k about the origin:  gap dn.(x3 + R3 p)"""
    if is_active(work, c):
        F = work.contact_frame[c]
        e = unit_vector(k)
        n = cross(e[0], e[1], e[2], F[0], F[1], F[2])
        gap = dot(n, centre(model, c, work.pos3, work.rot3))
        before = dot(n, centre(model, c, work.pos1, work.rot1)), dot(n, centre(model, c, work.pos2, work.rot2))
        add_turn(model, work, h, c, e, gap - floor_change(work, c, before[0], before[1]), w, col)


@kernel
def add_turn(model: Model, work: Work, h: float, c: int, e: Vec3, gap: float, w: float, col: int) -> None:
    """The frame of contact c turns by e, and its gap grows by `gap`:

    dn = e x n, dt = e x t, dr = -radius dn    slip dt.u + t.(omega x dr)    df = F^T W d + e x f
    """
    i = model.contact_body[c]
    F = work.contact_frame[c]
    kin = work.contact_kin[c]
    n = cross(e[0], e[1], e[2], F[0], F[1], F[2])
    rho = model.contact_radius[c]
    dr = (-rho * n[0], -rho * n[1], -rho * n[2])
    p, q = work.pos3[i], work.pos2[i]
    u = turning(work, h, i, three(kin, Kin.ARM))
    u = (u[0] + (p[0] - q[0]) / h, u[1] + (p[1] - q[1]) / h, u[2] + (p[2] - q[2]) / h)
    eu = cross(u[0], u[1], u[2], e[0], e[1], e[2])  # (e x t).u = t.(u x e)
    v = turning(work, h, i, dr)
    v = (v[0] + eu[0], v[1] + eu[1], v[2] + eu[2])
    s1 = F[3] * v[0] + F[4] * v[1] + F[5] * v[2]
    s2 = F[6] * v[0] + F[7] * v[1] + F[8] * v[2]
    df = ground_force(work, c, impulse_change(work, c, gap, s1, s2))
    f = ground_force(work, c, contact_impulse(model, work, c))
    g = cross(e[0], e[1], e[2], f[0], f[1], f[2])
    add_ground(model, work, c, (df[0] + g[0], df[1] + g[1], df[2] + g[2]), dr, w, col)
