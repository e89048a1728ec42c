"""The exact friction cone on the central path, as a law of the slip.

    mu gamma v_t + psi beta = 0,      psi = a + sqrt(a^2 + |v_t|^2),   a = kappa / (2 mu gamma)

is (mu gamma, beta) o (psi, v_t) = kappa e after elimination of psi. It implies |beta| < mu gamma, so the
cone is not a constraint of the iteration and cannot jam it. beta is solved for by Newton's method.

With b = mu gamma the same path is also

    (b^2 - |beta|^2) v_t + kappa beta = 0

which is linear in v_t: of a contact that sticks Newton's method finds the slip by this form in one step, by the other
in several.
"""

from __future__ import annotations

from math import sqrt

from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Cone, ConeScale, Kin
from solvers.compiler import kernel
from solvers.types import Vector

_INSIDE = 0.1  # least share of b^2 that b^2 - |beta|^2 has of a contact that sticks


@kernel
def cone_slip(b0: float, x: float, y: float, kappa: float) -> tuple[float, float]:
    """psi = a + r and r = sqrt(a^2 + |v_t|^2), a = kappa/(2 b0): the smoothed slip speed of the central path."""
    a = 0.5 * kappa / b0
    r = sqrt(a * a + x * x + y * y)
    return a + r, r


@kernel
def start_cone(model: Model, data: Data, c: int, kappa: float) -> None:
    """beta on the central path of kappa at the present slip and normal impulse."""
    z = data.cone[c]
    put_on_path(z, data.contact_kin[c], model.contact_friction[c] * z[Cone.IMPULSE], kappa)


@kernel
def put_on_path(z: Vector, k: Vector, b0: float, kappa: float) -> None:
    """beta in z on the central path of kappa at the slip in k and the bound b0."""
    psi, _ = cone_slip(b0, k[Kin.SLIP1], k[Kin.SLIP2], kappa)
    z[Cone.FRICTION1] = -b0 * k[Kin.SLIP1] / psi
    z[Cone.FRICTION2] = -b0 * k[Kin.SLIP2] / psi


@kernel
def cone_violation(model: Model, data: Data, c: int, kappa: float) -> float:
    """|mu gamma v_t + psi beta|, in units of kappa."""
    z = data.cone[c]
    return distance_from_path(z, data.contact_kin[c], model.contact_friction[c] * z[Cone.IMPULSE], kappa)


@kernel
def distance_from_path(z: Vector, k: Vector, b0: float, kappa: float) -> float:
    """Largest component of |b0 v_t + psi beta|."""
    psi, _ = cone_slip(b0, k[Kin.SLIP1], k[Kin.SLIP2], kappa)
    return max(abs(b0 * k[Kin.SLIP1] + psi * z[Cone.FRICTION1]), abs(b0 * k[Kin.SLIP2] + psi * z[Cone.FRICTION2]))


@kernel
def within_cone(b0: float, x: float, y: float) -> tuple[float, float]:
    """(x, y) shortened to b0: after a shortened Newton step the friction may stick out of its cone."""
    n = sqrt(x * x + y * y)
    if n > b0:
        return x * b0 / n, y * b0 / n
    return x, y


@kernel
def condense_cone(model: Model, data: Data, c: int, kappa: float, indefinite: float, linear: bool) -> None:
    """d(beta)/d(gap, slip) by the law linearised at kappa, in the form that suits the contact.

    Far from the solution the violation that the line search looks at, that of the first form, may grow along a step of
    the other.
    """
    W = data.contact_W[c]
    q = data.contact_scale[c]
    mu = model.contact_friction[c]
    z = data.cone[c]
    condense_bounded(z, data.contact_kin[c], mu * z[Cone.IMPULSE], kappa, indefinite, linear, W, q)
    W[3] = mu * W[0] * q[ConeScale.GROWTH]
    W[6] = mu * W[0] * q[ConeScale.GROWTH + 1]


@kernel
def condense_bounded(
    z: Vector, k: Vector, b0: float, kappa: float, indefinite: float, linear: bool, W: Vector, q: Vector
) -> None:
    """d(beta)/d(slip) and d(beta)/d(b) in W and q: of the beta in z at the slip in k, with the bound b0."""
    room = b0 * b0 - z[Cone.FRICTION1] * z[Cone.FRICTION1] - z[Cone.FRICTION2] * z[Cone.FRICTION2]
    if linear and room > _INSIDE * b0 * b0:
        condense_sticking(z, k, b0, kappa, indefinite, W, q)
    else:
        condense_sliding(z, k, b0, kappa, indefinite, W, q)


@kernel
def condense_sliding(z: Vector, k: Vector, b0: float, kappa: float, indefinite: float, W: Vector, q: Vector) -> None:
    """psi dbeta = -(b I + beta v_t^T/r) dv_t - indefinite (v_t + beta dpsi/db) db - residual,   r = psi - a"""
    psi, r = cone_slip(b0, k[Kin.SLIP1], k[Kin.SLIP2], kappa)
    a = psi - r
    b1, b2 = within_cone(b0, z[Cone.FRICTION1], z[Cone.FRICTION2])
    i = 1.0 / psi
    W[4] = -i * (b0 + b1 * k[Kin.SLIP1] / r)
    W[5] = -i * b1 * k[Kin.SLIP2] / r
    W[7] = -i * b2 * k[Kin.SLIP1] / r
    W[8] = -i * (b0 + b2 * k[Kin.SLIP2] / r)
    g = -(a / b0) * (1.0 + a / r)  # dpsi/db
    q[ConeScale.GROWTH] = -i * indefinite * (k[Kin.SLIP1] + b1 * g)
    q[ConeScale.GROWTH + 1] = -i * indefinite * (k[Kin.SLIP2] + b2 * g)
    q[ConeScale.RESIDUAL] = i * (b0 * k[Kin.SLIP1] + psi * z[Cone.FRICTION1])
    q[ConeScale.RESIDUAL + 1] = i * (b0 * k[Kin.SLIP2] + psi * z[Cone.FRICTION2])


@kernel
def condense_sticking(z: Vector, k: Vector, b0: float, kappa: float, indefinite: float, W: Vector, q: Vector) -> None:
    """(kappa I - 2 s beta^T) dbeta = -c dv_t - indefinite 2 b s db - (c v_t + kappa beta),   c = b^2 - |beta|^2

    by the inverse  (I + e s beta^T)/kappa,   e = 2/(kappa - 2 s.beta).   s is the slip v_t if that is near the
    law, against beta and at most twice as fast, and otherwise that of the law, -kappa beta/c: the matrix is definite.
    """
    x, y, b1, b2 = k[Kin.SLIP1], k[Kin.SLIP2], z[Cone.FRICTION1], z[Cone.FRICTION2]
    n = b1 * b1 + b2 * b2
    c = b0 * b0 - n
    r1, r2 = c * x + kappa * b1, c * y + kappa * b2
    s1, s2 = x, y
    f = kappa / c
    if x * b1 + y * b2 > 0.0 or x * x + y * y > 4.0 * f * f * n:
        s1, s2 = -f * b1, -f * b2
    e = 2.0 / (kappa - 2.0 * (s1 * b1 + s2 * b2))
    g = -c / kappa
    W[4] = g * (1.0 + e * s1 * b1)
    W[5] = g * e * s1 * b2
    W[7] = g * e * s2 * b1
    W[8] = g * (1.0 + e * s2 * b2)
    q[ConeScale.GROWTH] = -indefinite * b0 * e * s1
    q[ConeScale.GROWTH + 1] = -indefinite * b0 * e * s2
    d = e * (b1 * r1 + b2 * r2)
    q[ConeScale.RESIDUAL] = (r1 + s1 * d) / kappa
    q[ConeScale.RESIDUAL + 1] = (r2 + s2 * d) / kappa


@kernel
def cone_constant(model: Model, data: Data, c: int) -> None:
    """Friction part of contact_w, after its normal part."""
    w = data.contact_w[c]
    q = data.contact_scale[c]
    b = model.contact_friction[c] * w[0]
    w[1] = b * q[ConeScale.GROWTH] - q[ConeScale.RESIDUAL]
    w[2] = b * q[ConeScale.GROWTH + 1] - q[ConeScale.RESIDUAL + 1]


@kernel
def recover_cone(data: Data, c: int, a: float, x: float, y: float) -> None:
    """Step of beta from the rates (a, x, y) of gap and slip."""
    d = data.carry.cone_step[c]
    W = data.contact_W[c]
    w = data.contact_w[c]
    d[Cone.FRICTION1] = W[3] * a + W[4] * x + W[5] * y + w[1]
    d[Cone.FRICTION2] = W[6] * a + W[7] * x + W[8] * y + w[2]
