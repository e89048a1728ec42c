"""Relative angular velocity of the two bodies of a contact, and the moment of its friction on them.

    omega = omega_a - omega_b,   omega_i = (2/h) s,   (c, s) the turn of body i from configuration 2 to 3

    rates   about the rows e of the frame: n, t1, t2        e.omega
    by the rotation of a at 3   (c e + s x e)/h,   at 2   -(c e - s x e)/h;   of b with the other sign
    by the turning Omega of the frame   Omega^T (e x omega)

The moment acts on a and its opposite on b, whatever their places, so that momentum is exact.
"""

from __future__ import annotations

from sim.contact.pairs.limited_reach import with_fade
from sim.contact.pairs.pair_contact import acts
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Kin, PairFade
from solvers.compiler import kernel
from solvers.rotation import Mat3, Vec3, cross, times, transposed_times
from solvers.types import Matrix, Vector


@kernel
def bodies_of(model: Model, c: int) -> tuple[int, int]:
    """Both bodies of contact c, -1 for the world."""
    j = c - model.contact_height.shape[0]
    return model.contact_body[c], -1 if j < 0 else model.coupling_body[model.pair_coupling[j], 1]


@kernel
def frame_of(model: Model, data: Data, c: int) -> Mat3:
    """Rows n, t1, t2 of contact c."""
    j = c - model.contact_height.shape[0]
    if j < 0:
        F = data.contact_frame[c]
        return F[0], F[1], F[2], F[3], F[4], F[5], F[6], F[7], F[8]
    G = data.pair_frame[j]
    return G[0], G[1], G[2], G[3], G[4], G[5], G[6], G[7], G[8]


@kernel
def is_felt(model: Model, data: Data, c: int) -> bool:
    """Whether contact c acts on its bodies: a pair has that point now, within its reach."""
    j = c - model.contact_height.shape[0]
    return j < 0 or acts(data, j)


@kernel
def _angular(data: Data, h: float, i: int) -> Vec3:
    """omega_i, 0 of the world."""
    if i < 0:
        return 0.0, 0.0, 0.0
    g = 2.0 / h
    return g * data.turn[i, 1], g * data.turn[i, 2], g * data.turn[i, 3]


@kernel
def relative_turning(model: Model, data: Data, h: float, c: int) -> Vec3:
    """omega of contact c."""
    a, b = bodies_of(model, c)
    x, y, z = _angular(data, h, a)
    u, v, w = _angular(data, h, b)
    return x - u, y - v, z - w


@kernel
def put_rates(model: Model, data: Data, h: float, c: int) -> None:
    """moment_kin of contact c."""
    s, x, y = times(frame_of(model, data, c), *relative_turning(model, data, h, c))
    k, m = data.moment_kin[2 * c], data.moment_kin[2 * c + 1]
    k[Kin.SLIP1], k[Kin.SLIP2] = s, 0.0
    m[Kin.SLIP1], m[Kin.SLIP2] = x, y


@kernel
def turned_row(data: Data, h: float, i: int, e: Vec3, at: float) -> Vec3:
    """d(e.omega_i)/d(rotation of body i) at configuration 3 (at = 1) or 2 (at = -1), e fixed."""
    t, g = data.turn[i], 1.0 / h
    x, y, z = cross(t[1], t[2], t[3], e[0], e[1], e[2])
    c = at * t[0]
    return g * (c * e[0] + x), g * (c * e[1] + y), g * (c * e[2] + z)


@kernel
def earlier_turning(data: Data, h: float, i: int, s: Vector) -> Vec3:
    """Change of omega_i by the twist s of body i at configuration 2."""
    t, g = data.turn[i], 1.0 / h
    x, y, z = cross(s[3], s[4], s[5], t[1], t[2], t[3])
    return g * (x - t[0] * s[3]), g * (y - t[0] * s[4]), g * (z - t[0] * s[5])


@kernel
def row_of(F: Mat3, e: int) -> Vec3:
    """Row e of a frame."""
    if e == 0:
        return F[0], F[1], F[2]
    return (F[3], F[4], F[5]) if e == 1 else (F[6], F[7], F[8])


@kernel
def moment_jacobian(model: Model, data: Data, h: float, c: int) -> None:
    """moment_Ca and moment_Cb: d(rates about n, t1, t2)/d(twists of a and b at configuration 3), about O."""
    ground = model.contact_height.shape[0]
    Ca, Cb = data.moment_Ca[c], data.moment_Cb[c]
    F, w = frame_of(model, data, c), relative_turning(model, data, h, c)
    a, b = bodies_of(model, c)
    for e in range(3):
        t = row_of(F, e)
        g = cross(t[0], t[1], t[2], w[0], w[1], w[2])
        one = turned_row(data, h, a, t, 1.0)
        two = turned_row(data, h, b, t, 1.0) if b >= 0 else (0.0, 0.0, 0.0)
        for k in range(3):
            Ca[6 * e + k] = Cb[6 * e + k] = 0.0
            Ca[6 * e + 3 + k] = one[k]
            Cb[6 * e + 3 + k] = g[k] - two[k]
        if c >= ground:
            Omega = data.pair_turn[c - ground]
            for k in range(6):
                r = Omega[k] * g[0] + Omega[6 + k] * g[1] + Omega[12 + k] * g[2]
                Ca[6 * e + k] += r
                Cb[6 * e + k] -= r
        elif model.contact_terrain[c] > 0:
            T = data.contact_turn[c]
            for k in range(6):
                Ca[6 * e + k] += T[k] * g[0] + T[6 + k] * g[1] + T[12 + k] * g[2]


@kernel
def rates_of(C: Vector, k: int) -> Vec3:
    """Column k of rates (3 x 6)."""
    return C[k], C[6 + k], C[12 + k]


@kernel
def rates_by(C: Vector, t: Vector) -> Vec3:
    """Rates (3 x 6) times a twist."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(6):
        x, y, z = x + C[k] * t[k], y + C[6 + k] * t[k], z + C[12 + k] * t[k]
    return x, y, z


@kernel
def world_moment(model: Model, data: Data, c: int, m: Vec3) -> Vec3:
    """w (n tau + T^T rho) in world axes, w the part that acts within the reach of a collision."""
    j = c - model.contact_height.shape[0]
    w = 1.0 if j < 0 else data.pair_fade[j, PairFade.PART]
    return transposed_times(frame_of(model, data, c), w * m[0], w * m[1], w * m[2])


@kernel
def faded(model: Model, data: Data, c: int, gap: float, rate: Vec3, m: Vec3) -> Vec3:
    """`with_fade` of a moment m of contact c whose gap changes."""
    j = c - model.contact_height.shape[0]
    return rate if j < 0 else with_fade(data, j, gap, rate, m)


@kernel
def add_moment(model: Model, data: Data, c: int, m: Vec3, out: Matrix) -> None:
    """out[a] -= the moment m = (tau, rho) of contact c, out[b] += it."""
    if not is_felt(model, data, c):
        return
    a, b = bodies_of(model, c)
    x = world_moment(model, data, c, m)
    for k in range(3):
        out[a, 3 + k] -= x[k]
        if b >= 0:
            out[b, 3 + k] += x[k]


@kernel
def frame_turning(model: Model, data: Data, c: int, side: int, k: int) -> Vec3:
    """Rotation of the frame of contact c by the unit twist k of body a (side 0) or b, about O."""
    j = c - model.contact_height.shape[0]
    if j < 0:
        if model.contact_terrain[c] == 0:
            return 0.0, 0.0, 0.0
        T = data.contact_turn[c]
        return T[k], T[6 + k], T[12 + k]
    Omega = data.pair_turn[j]
    if side == 0:
        return Omega[k], Omega[6 + k], Omega[12 + k]
    e = (1.0 if k == 3 else 0.0, 1.0 if k == 4 else 0.0, 1.0 if k == 5 else 0.0)
    return e[0] - Omega[k], e[1] - Omega[6 + k], e[2] - Omega[12 + k]


@kernel
def gap_row(model: Model, data: Data, c: int, side: int, k: int) -> float:
    """d(gap) of contact c by the unit twist k of body a (side 0) or b at configuration 3, about O."""
    j = c - model.contact_height.shape[0]
    if j >= 0:
        return data.pair_Ca[j, k] if side == 0 else data.pair_Cb[j, k]
    first = Kin.BY_TRANSLATION + k if k < 3 else Kin.BY_ROTATION + k - 3
    return data.contact_kin[c, first]
