"""Parameters of collisions: where their shapes sit in the bodies; columns[:, col] -= w dR/d(parameter)."""

from __future__ import annotations

from sim.effects import At
from sim.friction import contact_impulse
from sim.model import Model, Work
from sim.pairs import is_absent, pair_force
from sim.parameter_contacts import add_pair, floor_change, impulse_change, is_near, turning
from sim.rotation import Vec3, cross, rotate
from solvers.jit import kernel


@kernel
def _row_times(M: Vec3, v: Vec3) -> float:
    return M[0] * v[0] + M[1] * v[1] + M[2] * v[2]


@kernel
def shape_floor(work: Work, c: int, i: int, k: int) -> float:
    """Change of the floor that an impact raises when the shape of a (k < 3) or b on body i moves."""
    r = k % 3
    e = (1.0 if r == 0 else 0.0, 1.0 if r == 1 else 0.0, 1.0 if r == 2 else 0.0)
    e1 = rotate(work.rot1, i, e[0], e[1], e[2]) if i >= 0 else e
    e2 = rotate(work.rot2, i, e[0], e[1], e[2]) if i >= 0 else e
    b = work.bounce[c]
    d = floor_change(work, c, _row_times((b[2], b[3], b[4]), e1), _row_times((b[8], b[9], b[10]), e2))
    return d if k < 3 else -d


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
    v = turning(work, at.h, a, dp)
    if b >= 0:
        t = turning(work, at.h, b, dp)
        v = (v[0] - t[0], v[1] - t[1], v[2] - t[2])
    x = cross(u[0], u[1], u[2], turn[0], turn[1], turn[2])
    v = (v[0] + x[0], v[1] + x[1], v[2] + x[2])
    gap = _row_times((F[0], F[1], F[2]), z) - shape_floor(work, c, i, k)
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
    v = turning(work, h, a, (p[0] - x3[0], p[1] - x3[1], p[2] - x3[2]))
    v = (v[0] + (x3[0] - x2[0]) / h, v[1] + (x3[1] - x2[1]) / h, v[2] + (x3[2] - x2[2]) / h)
    if b < 0:
        return v
    x3, x2 = work.pos3[b], work.pos2[b]
    t = turning(work, h, b, (p[0] - x3[0], p[1] - x3[1], p[2] - x3[2]))
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
