"""Friction of a contact against spinning and rolling, on the central path: laws of the friction cone (cone.py).

The impulse of a contact comes with a moment  m = n tau + T^T rho  that takes the most power from the relative angular
velocity omega of its two bodies:

    |tau| <= mu_t gamma,    |rho| <= mu_r gamma       mu_t, mu_r: torsional and rolling friction [m]

    mu_t gamma omega_n + psi tau = 0,    mu_r gamma omega_t + psi' rho = 0        psi: cone.py

Each is the law of cone.py with another bound, and an angular velocity in the place of the slip; tau is one of which the
second component is zero. Bounds and sliding friction are independent: a ball that rolls need not slip for its rolling
friction, as it would on one cone of all five components. docs/theory/interior_point.md has the reasons.

Rows 2 c + MomentRow of moment_kin, moment_W, moment_scale and moment_w are as those of the slip, contact_W,
contact_scale and contact_w; the variables are behind those of the other laws in `cone`, Moment.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.cone import condense_bounded, distance_from_path, put_on_path, within_cone
from sim.contact.moments.moment_rates import is_felt
from sim.contact.softening import compose, contact_response, hardness_part, loaded_response
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import LawForm
from sim.model.record_columns import Cone, ConeScale, Moment, MomentRow
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3
from solvers.types import Vector

_SIDE = Moment.ROLL - Moment.SPIN


@kernel
def has_moment(model: Model, c: int) -> bool:
    """Whether contact c has torsional or rolling friction."""
    return model.moment_friction[c, MomentRow.SPIN] > 0.0 or model.moment_friction[c, MomentRow.ROLL] > 0.0


@kernel
def first_of(e: int) -> int:
    """Column of `cone` from which on the variables of law e are as those of a Cone, with beta where that has it."""
    return Moment.SPIN - Cone.FRICTION1 + _SIDE * e


@kernel
def bound(model: Model, data: Data, c: int, e: int) -> float:
    """mu_t gamma, or mu_r gamma [N m s]."""
    return model.moment_friction[c, e] * data.cone[c, Cone.IMPULSE]


@kernel
def moment_of(data: Data, c: int) -> Vec3:
    """(tau, rho) of contact c."""
    z = data.cone[c]
    return z[Moment.SPIN], z[Moment.ROLL], z[Moment.ROLL + 1]


@kernel
def start_moment(model: Model, data: Data, c: int, kappa: float) -> None:
    """Moment of contact c on the central path of kappa at its rates."""
    for e in range(2):
        if model.moment_friction[c, e] > 0.0:
            put_on_path(data.cone[c, first_of(e) :], data.moment_kin[2 * c + e], bound(model, data, c, e), kappa)


@kernel
def keep_in_bounds(model: Model, data: Data, c: int) -> None:
    """Shorten the moment to its bounds."""
    for e in range(2):
        z = data.cone[c, first_of(e) :]
        z[Cone.FRICTION1], z[Cone.FRICTION2] = within_cone(
            bound(model, data, c, e), z[Cone.FRICTION1], z[Cone.FRICTION2]
        )


@optional(Slot.MOMENT_VIOLATION, default=0.0)
def moment_violation(model: Model, data: Data, c: int, kappa: float) -> float:
    """Violation of both laws of contact c, in units of kappa; 0 where it does not act."""
    r = 0.0
    if not is_felt(model, data, c):
        return r
    for e in range(2):
        if model.moment_friction[c, e] > 0.0:
            b0 = bound(model, data, c, e)
            r = max(r, distance_from_path(data.cone[c, first_of(e) :], data.moment_kin[2 * c + e], b0, kappa))
    return r


@kernel
def condense_moment(model: Model, data: Data, h: float, c: int, kappa: float, indefinite: float, form: int) -> None:
    """moment_W = d(moment)/d(gap, rates) by the laws linearised at kappa, and moment_scale. See `condense_contact`."""
    for e in range(2):
        W, q = data.moment_W[2 * c + e], data.moment_scale[2 * c + e]
        for k in range(9):
            W[k] = 0.0
        for k in range(4):
            q[k] = 0.0
        mu = model.moment_friction[c, e]
        if mu == 0.0:
            continue
        k, z, b0 = data.moment_kin[2 * c + e], data.cone[c, first_of(e) :], bound(model, data, c, e)
        condense_bounded(z, k, b0, kappa, indefinite, form == LawForm.STICKING, W, q)
        if form == LawForm.SOFT:
            _soften(model, data, h, c, W, q)
        W[3] = mu * data.contact_W[c, 0] * q[ConeScale.GROWTH]
        W[6] = mu * data.contact_W[c, 0] * q[ConeScale.GROWTH + 1]


@kernel
def _soften(model: Model, data: Data, h: float, c: int, W: Vector, q: Vector) -> None:
    """W and the growth of a law softened as those of the slip (softening.py): d = part N sqrt(G/M), N the change of the
    angular velocity by a unit moment.
    """
    M = contact_response(model, c)
    N = _turning_response(model, c)
    part = hardness_part(data, c)
    hard = -min(W[4], W[8])
    if part * N * hard > 1.0 - 1e-12:
        d = part * N * sqrt(loaded_response(model, data, h, c, M) / M)
        compose(W, q, 0.0, d if d * hard > 1.0 else 0.0)
        hard = -min(W[4], W[8])
    data.contact_hard[0] = max(data.contact_hard[0], N * hard)


@kernel
def _turning_response(model: Model, c: int) -> float:
    """N of contact c [rad/s per N m s], of bodies with the mean of their moments of inertia."""
    total = _response(model, model.contact_body[c])
    j = c - model.contact_height.shape[0]
    if j >= 0:
        total += _response(model, model.coupling_body[model.pair_coupling[j], 1])
    return total


@kernel
def _response(model: Model, i: int) -> float:
    """3 over the trace of the inertia of body i and those it is fixed to; 0 for the world, 1 without inertia."""
    total = 0.0
    while i >= 0:
        J = model.body_inertia[i]
        total += J[0] + J[4] + J[8]
        if model.body_vadr[i + 1] > model.body_vadr[i]:
            return 3.0 / total if total > 0.0 else 1.0
        i = model.body_parent[i]
    return 0.0


@kernel
def moment_constant(model: Model, data: Data, c: int) -> Vec3:
    """moment_w, the constant part of d(moment), after contact_w; returns it."""
    for e in range(2):
        w, q = data.moment_w[2 * c + e], data.moment_scale[2 * c + e]
        b = model.moment_friction[c, e] * data.contact_w[c, 0]
        w[1] = b * q[ConeScale.GROWTH] - q[ConeScale.RESIDUAL]
        w[2] = b * q[ConeScale.GROWTH + 1] - q[ConeScale.RESIDUAL + 1]
    return data.moment_w[2 * c, 1], data.moment_w[2 * c + 1, 1], data.moment_w[2 * c + 1, 2]


@kernel
def moment_change(data: Data, c: int, gap: float, rates: Vec3) -> Vec3:
    """Change of (tau, rho) by the laws, of the gap and the rates about n, t1 and t2."""
    U, V = data.moment_W[2 * c], data.moment_W[2 * c + 1]
    s, x, y = rates
    return U[3] * gap + U[4] * s, V[3] * gap + V[4] * x + V[5] * y, V[6] * gap + V[7] * x + V[8] * y


@kernel
def friction_change(data: Data, c: int, e: int) -> Vec3:
    """Change of (tau, rho) by torsional (e = 0) or rolling friction: gamma d(beta)/d(bound)."""
    gamma, q = data.cone[c, Cone.IMPULSE], data.moment_scale[2 * c + e]
    a, b = gamma * q[ConeScale.GROWTH], gamma * q[ConeScale.GROWTH + 1]
    return (a, 0.0, 0.0) if e == 0 else (0.0, a, b)
