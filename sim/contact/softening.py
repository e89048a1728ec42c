"""The hardness of the contacts of a derivative, limited by rounding.

The condensed law df = W d(gap, slip) is added to the inertia of a body, and a hard impact has W/m up to 1e14: only two
digits of the inertia in the free directions of the contact would remain. A slightly compliant contact, of compliance
W^-1 - D, has nearly the same derivative. It differs by D/G, where G is the velocity per unit impulse at the contact;
rounding adds 1e-16 M/D, where M is that of a free body. So

    W' = (W^-1 - D)^-1 = (I - W D)^-1 W,      D = diag(h d, d, d),      d = 3e-8 sqrt(M G)

balances the two; a contact that gives more than D is not changed. 7e-14 M W' is an estimate of the loss
(Linearization.accuracy): 2e-6 where M = G, where A is off by 3e-8, and a B that is small beside A by more. M is 1/m of
the bodies that touch, with all parts fixed to them. G follows from the effect of the impulse gamma: it has stopped the
speed v of the contact point, or carried weight for h, so G = (v + |g| h)/gamma. A foot of 1 kg under a load of 1000 kg
has G = M/1000, and its impulses are not taken for those of a foot alone.
"""

from __future__ import annotations

from math import sqrt

from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.record_columns import Bounce, Cone, ConeScale, Kin, PairFrame, PyramidScale
from solvers.compiler import kernel
from solvers.rotation import Vec3, cross, three
from solvers.types import Vector

_PART = 3e-8
_PART_OF_IMPACTS = 1e-8  # with restitution, whose rates are summed first (restitution_gradient.py): less is rounded
_LEAST = 1e-6  # of M, which G is not taken to be below: forces between parts that hold one another stop no speed


@kernel
def free_response(model: Model, i: int) -> float:
    """1/m of body i and those it is fixed to; 0 for the world, 1/kg for bodies without mass."""
    m = 0.0
    while i >= 0:
        m += model.body_mass[i]
        if model.body_vadr[i + 1] > model.body_vadr[i]:
            return 1.0 / m if m > 0.0 else 1.0
        i = model.body_parent[i]
    return 0.0


@kernel
def speed_before(data: Data, h: float, i: int, x: float, y: float, z: float) -> Vec3:
    """Velocity over interval 1-2 of the point of body i at the arm (x, y, z) from its centre of mass; 0: the world."""
    if i < 0:
        return 0.0, 0.0, 0.0
    s, d = data.turn_in[i], data.move_in[i]
    u, v, w = cross(2.0 * s[1], 2.0 * s[2], 2.0 * s[3], x, y, z)
    return (d[0] + u) / h, (d[1] + v) / h, (d[2] + w) / h


@kernel
def contact_response(model: Model, c: int) -> float:
    """M of contact c [m/s per N s]."""
    M = free_response(model, model.contact_body[c])
    j = c - model.contact_height.shape[0]
    if j >= 0:
        b = model.coupling_body[model.pair_coupling[j], 1]
        if b >= 0:
            M += free_response(model, b)
    return M


@kernel
def loaded_response(model: Model, data: Data, h: float, c: int, M: float) -> float:
    """G of contact c [m/s per N s]."""
    k = data.contact_kin[c]
    x, y, z = speed_before(data, h, model.contact_body[c], *three(k, Kin.ARM))
    j = c - model.contact_height.shape[0]
    if j >= 0:
        b = model.coupling_body[model.pair_coupling[j], 1]
        if b >= 0:
            p, o = data.pair_frame[j], data.pos3[b]
            u, v, w = speed_before(
                data, h, b, p[PairFrame.POINT] - o[0], p[PairFrame.POINT + 1] - o[1], p[PairFrame.POINT + 2] - o[2]
            )
            x, y, z = x - u, y - v, z - w
    g = model.gravity
    speed = sqrt(x * x + y * y + z * z) + h * sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    return max(min(M, speed / data.cone[c, Cone.IMPULSE]), _LEAST * M)


@kernel
def hardness_part(data: Data, c: int) -> float:
    """Factor of sqrt(M G) in d of contact c."""
    return _PART if data.bounce[c, Bounce.RESTITUTION] == 0.0 else _PART_OF_IMPACTS


@kernel
def soften(model: Model, data: Data, h: float, c: int) -> None:
    """W of contact c becomes W'; its derivative by friction (contact_scale) changes with it; contact_hard: M W'.

    D is evaluated only where a contact gives less than the largest, that of G = M.
    """
    W = data.contact_W[c]
    M = contact_response(model, c)
    part = hardness_part(data, c)
    hard = max(-h * W[0], -W[4], -W[8])
    if part * M * hard > 1.0 - 1e-12:
        d = part * sqrt(M * loaded_response(model, data, h, c, M))
        q = (
            data.contact_scale[c, PyramidScale.SUM : PyramidScale.INVERSE]
            if model.contact_law[c] == Law.LINEAR
            else data.contact_scale[c, ConeScale.GROWTH : ConeScale.RESIDUAL]
        )
        compose(W, q, h * d if -h * d * W[0] > 1.0 else 0.0, d if -d * min(W[4], W[8]) > 1.0 else 0.0)
        hard = max(-h * W[0], -W[4], -W[8])
    data.contact_hard[0] = max(data.contact_hard[0], M * hard)


@kernel
def compose(W: Vector, q: Vector, normal: float, along: float) -> None:
    """W = (I - W D)^-1 W and q likewise, D = diag(normal, along, along); the normal impulse does not depend on slip."""
    n = 1.0 / (1.0 - W[0] * normal)
    a, b, c, d = 1.0 - W[4] * along, -W[5] * along, -W[7] * along, 1.0 - W[8] * along
    i = 1.0 / (a * d - b * c)
    a, b, c, d = i * d, -i * b, -i * c, i * a
    W[0] *= n
    q[0], q[1] = a * q[0] + b * q[1], c * q[0] + d * q[1]
    x, y = n * W[3], n * W[6]
    W[3], W[6] = a * x + b * y, c * x + d * y
    x, y = W[4], W[7]
    W[4], W[7] = a * x + b * y, c * x + d * y
    x, y = W[5], W[8]
    W[5], W[8] = a * x + b * y, c * x + d * y
