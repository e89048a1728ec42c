"""Parameters of contacts and of collisions: dR/d(parameter) of the residual of a step, columns[:, col] -= w dR.

The impulse follows its law, W = d(impulse)/d(gap, slip) on the central path, and its arm r and frame what they are
made of; f = n gamma + T^T beta acts on the body, so dR_d = -S2_d.(df, (d2 + r) x df + dr x f).
"""

from __future__ import annotations

from sim.effects import At, Effect
from sim.friction import contact_impulse, law_of
from sim.model import Law, Model, Work
from sim.pairs import is_absent, pair_arm, pair_force
from sim.parameter_effects import add_wrench, moment
from sim.rotation import Vec3, cross, rotate
from solvers.jit import kernel

_POINT, _RADIUS, _HEIGHT = int(Effect.POINT), int(Effect.RADIUS), int(Effect.HEIGHT)
_NONLINEAR, _LINEAR = int(Law.NONLINEAR), int(Law.LINEAR)


@kernel
def is_near(work: Work, c: int) -> bool:
    """Whether contact c had a part in the step; those too far to matter have none in its derivatives either."""
    for m in range(work.counts[2]):
        if work.near[m, 0] <= c < work.near[m, 1]:
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
    gamma = work.cone[c, 1]
    law = law_of(model, c)
    if law == _NONLINEAR:
        return 0.0, gamma * q[0], gamma * q[1]
    if law == _LINEAR:
        g = gamma * work.cone[c, 2] * q[6]
        return 0.0, g * q[4], g * q[5]
    return 0.0, 0.0, 0.0


@kernel
def ground_force(model: Model, c: int, p: Vec3) -> Vec3:
    """n p0 + t1 p1 + t2 p2"""
    F = model.contact_frame[c]
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
    f = ground_force(model, c, contact_impulse(model, work, c))
    a = cross(k[3], k[4], k[5], df[0], df[1], df[2])
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
        add_ground(model, work, c, ground_force(model, c, p), zero, w, col)
    elif not is_absent(work, j):
        add_pair(model, work, j, pair_force(work, j, p[0], p[1], p[2]), zero, w, col)


@kernel
def add_friction(model: Model, work: Work, c: int, w: float, col: int) -> None:
    """The friction coefficient of contact c."""
    if is_near(work, c):
        add_impulse(model, work, c, friction_change(model, work, c), w, col)


@kernel
def add_slips_time_step(model: Model, work: Work, h: float, w: float, col: int) -> None:
    """The slips of all contacts, which are displacements over h: -slip/h."""
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            k = work.contact_kin[c]
            add_impulse(model, work, c, impulse_change(work, c, 0.0, -k[1] / h, -k[2] / h), w, col)


@kernel
def _turning(work: Work, h: float, i: int, r: Vec3) -> Vec3:
    """omega x r, omega = (2/h) s of body i"""
    t = work.turn[i]
    g = 2.0 / h
    return cross(g * t[1], g * t[2], g * t[3], r[0], r[1], r[2])


@kernel
def add_ground_geometry(model: Model, work: Work, h: float, effect: int, c: int, k: int, w: float, col: int) -> None:
    """Contact c with the ground:

    point     dr = R3 e_k           gap n.dr          slip T (omega x dr)
    radius    dr = -n               the same
    height    dr = 0                gap -1
    """
    if not is_near(work, c):
        return
    i = model.contact_body[c]
    F = model.contact_frame[c]
    dr = (0.0, 0.0, 0.0)
    if effect == _POINT:
        dr = rotate(work.rot3, i, 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
    elif effect == _RADIUS:
        dr = (-F[0], -F[1], -F[2])
    gap = -1.0 if effect == _HEIGHT else F[0] * dr[0] + F[1] * dr[1] + F[2] * dr[2]
    v = _turning(work, h, i, dr)
    s1 = F[3] * v[0] + F[4] * v[1] + F[5] * v[2]
    s2 = F[6] * v[0] + F[7] * v[1] + F[8] * v[2]
    add_ground(model, work, c, ground_force(model, c, impulse_change(work, c, gap, s1, s2)), dr, w, col)


@kernel
def add_normal(model: Model, work: Work, h: float, c: int, k: int, w: float, col: int) -> None:
    """The half-space of contact c turns by e = e_k about the origin:

    dn = e x n, dt = e x t, dr = -radius dn    gap dn.(x3 + R3 p)    slip dt.u + t.(omega x dr)    df = F^T W d + e x f
    """
    if not is_near(work, c):
        return
    i = model.contact_body[c]
    F = model.contact_frame[c]
    kin = work.contact_kin[c]
    e = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
    n = cross(e[0], e[1], e[2], F[0], F[1], F[2])
    rho = model.contact_radius[c]
    dr = (-rho * n[0], -rho * n[1], -rho * n[2])
    p, q = work.pos3[i], work.pos2[i]
    gap = n[0] * (p[0] + kin[6]) + n[1] * (p[1] + kin[7]) + n[2] * (p[2] + kin[8])
    u = _turning(work, h, i, (kin[3], kin[4], kin[5]))
    u = (u[0] + (p[0] - q[0]) / h, u[1] + (p[1] - q[1]) / h, u[2] + (p[2] - q[2]) / h)
    eu = cross(u[0], u[1], u[2], e[0], e[1], e[2])  # (e x t).u = t.(u x e)
    v = _turning(work, h, i, dr)
    v = (v[0] + eu[0], v[1] + eu[1], v[2] + eu[2])
    s1 = F[3] * v[0] + F[4] * v[1] + F[5] * v[2]
    s2 = F[6] * v[0] + F[7] * v[1] + F[8] * v[2]
    df = ground_force(model, c, impulse_change(work, c, gap, s1, s2))
    f = ground_force(model, c, contact_impulse(model, work, c))
    g = cross(e[0], e[1], e[2], f[0], f[1], f[2])
    add_ground(model, work, c, (df[0] + g[0], df[1] + g[1], df[2] + g[2]), dr, w, col)


@kernel
def _row_times(M: Vec3, v: Vec3) -> float:
    return M[0] * v[0] + M[1] * v[1] + M[2] * v[2]


@kernel
def add_shape_shift(model: Model, work: Work, at: At, j: int, k: int, w: float, col: int) -> None:
    """The shape of a (k < 3) or b of pair j moves by e along an axis of its body; a relative to b:

    frame turns by Omega e, the point moves by M e, gap n.e       slip as in pair_jacobian
    """
    c = model.contact_height.shape[0] + j
    if is_absent(work, j) or not is_near(work, c):
        return
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    i = a if k < 3 else b
    r = k % 3
    e = (1.0 if r == 0 else 0.0, 1.0 if r == 1 else 0.0, 1.0 if r == 2 else 0.0)
    if i >= 0:
        e = rotate(work.rot3, i, e[0], e[1], e[2])
    z = e if k < 3 else (-e[0], -e[1], -e[2])  # of a relative to b
    Omega, M, F = work.pair_turn[j], work.pair_shift[j], work.pair_frame[j]
    turn = (_row_times((Omega[0], Omega[1], Omega[2]), z), _row_times((Omega[6], Omega[7], Omega[8]), z),
            _row_times((Omega[12], Omega[13], Omega[14]), z))  # fmt: skip
    dp = (_row_times((M[0], M[1], M[2]), z), _row_times((M[6], M[7], M[8]), z),
          _row_times((M[12], M[13], M[14]), z))  # fmt: skip
    if k >= 3:
        dp = (dp[0] + e[0], dp[1] + e[1], dp[2] + e[2])
    p = (F[9], F[10], F[11])
    u = _relative_velocity(work, at.h, a, b, p)
    v = _turning(work, at.h, a, dp)
    if b >= 0:
        t = _turning(work, at.h, b, dp)
        v = (v[0] - t[0], v[1] - t[1], v[2] - t[2])
    x = cross(u[0], u[1], u[2], turn[0], turn[1], turn[2])
    v = (v[0] + x[0], v[1] + x[1], v[2] + x[2])
    gap = _row_times((F[0], F[1], F[2]), z)
    g = impulse_change(work, c, gap, _row_times((F[3], F[4], F[5]), v), _row_times((F[6], F[7], F[8]), v))
    df = pair_force(work, j, g[0], g[1], g[2])
    q = contact_impulse(model, work, c)
    f = pair_force(work, j, q[0], q[1], q[2])
    x = cross(turn[0], turn[1], turn[2], f[0], f[1], f[2])
    add_pair(model, work, j, (df[0] + x[0], df[1] + x[1], df[2] + x[2]), dp, w, col)


@kernel
def _relative_velocity(work: Work, h: float, a: int, b: int, p: Vec3) -> Vec3:
    """Velocity over the interval of the point p of a relative to that of b."""
    x3, x2 = work.pos3[a], work.pos2[a]
    v = _turning(work, h, a, (p[0] - x3[0], p[1] - x3[1], p[2] - x3[2]))
    v = (v[0] + (x3[0] - x2[0]) / h, v[1] + (x3[1] - x2[1]) / h, v[2] + (x3[2] - x2[2]) / h)
    if b < 0:
        return v
    x3, x2 = work.pos3[b], work.pos2[b]
    t = _turning(work, h, b, (p[0] - x3[0], p[1] - x3[1], p[2] - x3[2]))
    return (
        v[0] - t[0] - (x3[0] - x2[0]) / h,
        v[1] - t[1] - (x3[1] - x2[1]) / h,
        v[2] - t[2] - (x3[2] - x2[2]) / h,
    )


@kernel
def add_shapes_shift(model: Model, work: Work, at: At, first: int, k: int, w: float, col: int) -> None:
    """`add_shape_shift` for all points of the collision whose first pair this is."""
    j = first
    while j < model.pair_kind.shape[0] and (j == first or model.pair_feature[j] > 0):
        add_shape_shift(model, work, at, j, k, w, col)
        j += 1
