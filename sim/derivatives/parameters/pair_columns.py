"""Parameters of collisions: where their shapes sit in the bodies; columns[:, col] -= w dR/d(parameter)."""

from __future__ import annotations

from sim.contact.collision.witness import NOWHERE, dot
from sim.contact.contact_law import contact_impulse
from sim.contact.pairs.limited_reach import with_fade
from sim.contact.pairs.pair_contact import POLE, is_absent, pair_force, shape_b
from sim.contact.pairs.taut_string import is_taut
from sim.contact.pairs.wrench_columns import unit_vector
from sim.derivatives.parameters.contact_columns import add_pair, floor_change, impulse_change, is_active, turning
from sim.derivatives.parameters.moment_columns import add_moment_change
from sim.derivatives.parameters.taut_string_columns import add_moved_end
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bounce, PairFrame
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross, rotate
from solvers.types import Vector

Moved = tuple[Vec3, Vec3, Vec3]  # a shape at a contact: displacement, rotation, and the place of both from O


@kernel
def row(X: Vector, first: int) -> Vec3:
    """Three numbers of a vector."""
    return X[first], X[first + 1], X[first + 2]


@kernel
def pair_floor(data: Data, c: int, side: int, e1: Vec3, e2: Vec3) -> float:
    """Change of the floor that an impact raises when the shape of a (0) or b (1) is moved by e1, e2 at 1 and 2."""
    b = data.bounce[c]
    d = floor_change(data, c, dot(row(b, Bounce.ROW1.value), e1), dot(row(b, Bounce.ROW2.value), e2))
    return d if side == 0 else -d


@kernel
def _moved_frame(model: Model, data: Data, j: int, side: int, e: Vec3, turn: Vec3, arm: Vec3) -> tuple[Vec3, Vec3]:
    """Rotation of the frame and motion of the point of pair j where the shape of a (side 0) or b (1) moves by e and
    turns by `turn` at the place `arm` from O; a relative to b, and b with all that moves with it.

    Omega zeta and M zeta (pair_jacobian.py). The tangents follow the normal in the frame of b, which does not turn.
    """
    Omega, M, F = data.pair_turn[j], data.pair_shift[j], data.pair_frame[j]
    x = cross(turn[0], turn[1], turn[2], arm[0], arm[1], arm[2])
    v = (e[0] - x[0], e[1] - x[1], e[2] - x[2])
    s = 1.0 if side == 0 else -1.0
    z, w = (s * v[0], s * v[1], s * v[2]), (s * turn[0], s * turn[1], s * turn[2])
    dt = (
        dot(row(Omega, 0), z) + dot(row(Omega, 3), w),
        dot(row(Omega, 6), z) + dot(row(Omega, 9), w),
        dot(row(Omega, 12), z) + dot(row(Omega, 15), w),
    )
    dp = (
        dot(row(M, 0), z) + dot(row(M, 3), w),
        dot(row(M, 6), z) + dot(row(M, 9), w),
        dot(row(M, 12), z) + dot(row(M, 15), w),
    )
    if side == 0:
        return dt, dp
    p, o, n = row(F, PairFrame.POINT), data.origin, row(F, 0)
    x = cross(turn[0], turn[1], turn[2], p[0] - o[0], p[1] - o[1], p[2] - o[2])
    a = rotate(data.shape_rot, shape_b(model, j), POLE[0], POLE[1], POLE[2])
    b = cross(n[0], n[1], n[2], a[0], a[1], a[2])
    dn = cross(turn[0], turn[1], turn[2], n[0], n[1], n[2])
    spin = dot(b, dn) / max(1.0 + dot(a, n), 1e-12)
    dt = (dt[0] + turn[0] + spin * n[0], dt[1] + turn[1] + spin * n[1], dt[2] + turn[2] + spin * n[2])
    return dt, (dp[0] + v[0] + x[0], dp[1] + v[1] + x[1], dp[2] + v[2] + x[2])


@kernel
def add_moved_shape(
    model: Model, data: Data, h: float, end: tuple[int, int], moved: Moved, floor: float, w: float, col: int
) -> None:
    """The shape of a (side 0) or b (1) of pair j moves, the floor of an impact rises by `floor`.   end: (j, side).

    gap n.e, of a relative to b       frame and point as in _moved_frame, slip as in pair_jacobian
    """
    j, side = end
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    c = model.contact_height.shape[0] + j
    e = moved[0]
    z = e if side == 0 else (-e[0], -e[1], -e[2])
    F = data.pair_frame[j]
    turn, dp = _moved_frame(model, data, j, side, *moved)
    u = _relative_velocity(data, h, a, b, row(F, 9))
    v = turning(data, h, a, dp)
    if b >= 0:
        t = turning(data, h, b, dp)
        v = (v[0] - t[0], v[1] - t[1], v[2] - t[2])
    x = cross(u[0], u[1], u[2], turn[0], turn[1], turn[2])
    v = (v[0] + x[0], v[1] + x[1], v[2] + x[2])
    gap = dot(row(F, 0), z)
    q = contact_impulse(model, data, c)
    g = impulse_change(data, c, gap - floor, dot(row(F, 3), v), dot(row(F, 6), v))
    g = with_fade(data, j, gap, g, q)
    df = pair_force(data, j, g[0], g[1], g[2])
    f = pair_force(data, j, q[0], q[1], q[2])
    x = cross(turn[0], turn[1], turn[2], f[0], f[1], f[2])
    add_pair(model, data, j, (df[0] + x[0], df[1] + x[1], df[2] + x[2]), dp, w, col)
    add_moment_change(model, data, h, c, (gap, gap - floor), turn, w, col)


@kernel
def _relative_velocity(data: Data, h: float, a: int, b: int, p: Vec3) -> Vec3:
    """Velocity over the interval of the point p of a relative to that of b."""
    x3, x2 = data.pos3[a], data.pos2[a]
    v = turning(data, h, a, (p[0] - x3[0], p[1] - x3[1], p[2] - x3[2]))
    v = (v[0] + (x3[0] - x2[0]) / h, v[1] + (x3[1] - x2[1]) / h, v[2] + (x3[2] - x2[2]) / h)
    if b < 0:
        return v
    x3, x2 = data.pos3[b], data.pos2[b]
    t = turning(data, h, b, (p[0] - x3[0], p[1] - x3[1], p[2] - x3[2]))
    return (
        v[0] - t[0] - (x3[0] - x2[0]) / h,
        v[1] - t[1] - (x3[1] - x2[1]) / h,
        v[2] - t[2] - (x3[2] - x2[2]) / h,
    )


@kernel
def is_felt(model: Model, data: Data, j: int) -> bool:
    """Whether pair j had a part in the step."""
    return not is_absent(data, j) and is_active(data, model.contact_height.shape[0] + j)


@kernel
def add_pairs_mass(model: Model, data: Data, i: int, w: float, col: int) -> None:
    """Where the forces of collisions act follows the mass of body i: dP = m_b/m^2 (dx_a - dx_b) for a, m = m_a + m_b.

    dx = x3 - x2; for b, -m_a/m^2 instead.
    """
    for j in range(model.pair_kind.shape[0]):
        a = model.coupling_body[model.pair_coupling[j], 0]
        b = model.coupling_body[model.pair_coupling[j], 1]
        if b < 0 or (i != a and i != b) or not is_felt(model, data, j):
            continue
        if is_taut(model, data, j):
            continue
        m = model.body_mass[a] + model.body_mass[b]
        r = (model.body_mass[b] if i == a else -model.body_mass[a]) / (m * m)
        x3, x2, y3, y2 = data.pos3[a], data.pos2[a], data.pos3[b], data.pos2[b]
        x, y, z = x3[0] - x2[0] - y3[0] + y2[0], x3[1] - x2[1] - y3[1] + y2[1], x3[2] - x2[2] - y3[2] + y2[2]
        add_pair(model, data, j, (0.0, 0.0, 0.0), (r * x, r * y, r * z), w, col)


@kernel
def add_shapes_shift(model: Model, data: Data, h: float, first: int, k: int, w: float, col: int) -> None:
    """The shape of a (k < 3) or b of the collision whose first pair this is moves along axis k % 3 of its body."""
    side, e = k // 3, unit_vector(k % 3)
    i = model.coupling_body[model.pair_coupling[first], side]
    e1, e2, e3 = e, e, e
    if i >= 0:
        e1 = rotate(data.rot1, i, e[0], e[1], e[2])
        e2 = rotate(data.rot2, i, e[0], e[1], e[2])
        e3 = rotate(data.rot3, i, e[0], e[1], e[2])
    j = first
    while j < model.pair_kind.shape[0] and (j == first or model.pair_feature[j] > 0):
        if is_felt(model, data, j):
            floor = pair_floor(data, model.contact_height.shape[0] + j, side, e1, e2)
            if is_taut(model, data, j):
                add_moved_end(model, data, (j, side), e2, e3, floor, w, col)
            else:
                add_moved_shape(model, data, h, (j, side), (e3, NOWHERE, NOWHERE), floor, w, col)
        j += 1
