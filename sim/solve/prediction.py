"""Prediction of a step: the step linearised at its incoming velocity, with contacts and limits on the central path.

    H (v' - v25) = -R(v25, l) + B^T (l' - l),      w' = w(v25) + J (v' - v25) = w0 + G (l' - l)

from the impulses l of the step before: a step of Josephy's method. Newton's method finds out slowly which contacts
press, stick and slide, one iteration of it costs as much as all of this (sim/solve/delassus.py), and from here it takes
two or three. The error is of second order in the change of the velocity; a second pass,
with the new residual and the old matrices, costs less than an iteration and reduces the error at least tenfold.
"""

from __future__ import annotations

from sim.contact.active_contacts import has_pyramids, lands
from sim.contact.contact_law import law_of
from sim.contact.ground_contact import contact_jacobian, contact_rate
from sim.dynamics.elimination import solve
from sim.model.data import Data
from sim.model.model import Law, Model
from sim.model.options import StepOptions
from sim.model.record_columns import Bound, Cone, Kin
from sim.model.slots import Slot
from sim.solve.delassus import delassus
from sim.solve.inequalities import resume_inequalities
from sim.solve.merit import residuals
from sim.solve.newton_matrix import factor_free
from sim.solve.residual import residual_scale
from sim.solve.trial_velocity import INFEASIBLE, set_trial_velocity
from solvers.compiler import kernel, optional
from solvers.gauss_seidel import gauss_seidel
from solvers.rotation import Vec3
from solvers.types import Vector

_ACTIVATION_REACH = 0.2  # of the way to a contact: motion beyond which it may become active
_STEPS = 2
_CLOSE = 1e-3  # error, as of the merit, from which one iteration of Newton's method does more


@kernel
def predictable(model: Model, data: Data) -> bool:
    """Whether `predict` covers the scene: no pairs of bodies, loops, gears, dry friction or friction pyramids."""
    if data.active_count[0] != data.active_ground_count[0] or model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0:
        return False
    return model.dry_dof.shape[0] == 0 and not has_pyramids(model, data)


@kernel
def _may_touch(gap: float, rate: float, slack: float, impulse: float, kappa: float) -> bool:
    """Whether a gap may close: by the motion that the impulses of the step before leave, or because it had closed."""
    return gap + rate < max(_ACTIVATION_REACH * abs(rate), kappa**0.5) or impulse > slack


@kernel
def _take_contact(data: Data, j: int, c: int, rate: Vec3) -> None:
    """w and l of contact c, in rows j, j + 1, j + 2.   rate: `contact_rate`."""
    w, l = data.reach_rate, data.reach_impulse
    k, z = data.contact_kin[c], data.cone[c]
    w[j], w[j + 1], w[j + 2] = k[Kin.GAP] + rate[0], k[Kin.SLIP1] + rate[1], k[Kin.SLIP2] + rate[2]
    l[j], l[j + 1], l[j + 2] = z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2]


@kernel
def _take_limit(data: Data, j: int, k: int, rate: float) -> None:
    """w and l of limit k, in row j.   rate: `limit_rate`."""
    data.reach_rate[j] = data.bound_gap[k] + rate
    data.reach_impulse[j] = data.bound[k, Bound.IMPULSE]


@kernel
def limit_rate(model: Model, data: Data, h: float, k: int) -> float:
    """d(gap) of limit k of one coordinate, by the last solve."""
    return h * model.limit_sign[k] * data.dnu[model.limit_dof[k]]


@optional(Slot.CHOOSE_CONTACTS, default=0)
def choose_contacts(model: Model, data: Data, h: float, kappa: float) -> int:
    """Contacts that may touch, into reach_of, with w and l; and their rows, three each. See `choose_reached`."""
    most = data.reach_of.shape[0]
    n = 0
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        contact_jacobian(model, data, h, c)
        rate = contact_rate(model, data, c)
        gap = data.contact_kin[c, Kin.GAP]
        z = data.cone[c]
        if _may_touch(gap, rate[0], z[Cone.SLACK], z[Cone.IMPULSE], kappa):
            if n + 3 > most:
                return -1
            data.reach_of[n] = c
            data.reach_friction[n] = model.contact_friction[c] if law_of(model, c) == Law.NONLINEAR else 0.0
            _take_contact(data, n, c, rate)
            n += 3
        else:
            z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2] = kappa / (gap + rate[0]), 0.0, 0.0
    return n


@optional(Slot.CHOOSE_REACHED, default=(0, -1))
def choose_reached(model: Model, data: Data, h: float, kappa: float) -> tuple[int, int]:
    """Contacts and limits that may touch, into reach_of, with w and l; and their number: (contacts, rows). The others
    get the impulses of their gaps.

    After a solve. (0, -1) when there are more of them than places.
    """
    most = data.reach_of.shape[0]
    n = choose_contacts(model, data, h, kappa)
    if n < 0:
        return 0, -1
    points = n // 3
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            continue
        change = limit_rate(model, data, h, k)
        gap = data.bound_gap[k]
        if _may_touch(gap, change, data.bound[k, Bound.SLACK], data.bound[k, Bound.IMPULSE], kappa):
            if n + 1 > most:
                return 0, -1
            data.reach_of[n] = k
            _take_limit(data, n, k, change)
            n += 1
        else:
            data.bound[k, Bound.IMPULSE] = kappa / (gap + change)
    return points, n


@optional(Slot.TAKE_CONTACTS)
def take_contacts(model: Model, data: Data, h: float, points: int) -> None:
    """w and l of the contacts chosen, with their Jacobians at the present pose, after the last solve."""
    for j in range(0, 3 * points, 3):
        c = data.reach_of[j]
        contact_jacobian(model, data, h, c)
        _take_contact(data, j, c, contact_rate(model, data, c))


@optional(Slot.REACHED_RATES)
def reached_rates(model: Model, data: Data, h: float, points: int, size: int) -> None:
    """w and l of the contacts and limits chosen, after the last solve."""
    take_contacts(model, data, h, points)
    for j in range(3 * points, size):
        _take_limit(data, j, data.reach_of[j], limit_rate(model, data, h, data.reach_of[j]))


@optional(Slot.REACHED_IMPULSES, default=False)
def reached_impulses(model: Model, data: Data, h: float, kappa: float, points: int, size: int) -> bool:
    """Impulses of the contacts and limits chosen, into cone and bound; whether they have settled."""
    l = data.reach_impulse
    w, change = data.reach_rate, data.reach_change
    settled = gauss_seidel(data.delassus, data.reach_friction, h, kappa, (points, size), w, l, change)
    for j in range(0, 3 * points, 3):
        z = data.cone[data.reach_of[j]]
        z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2] = l[j], l[j + 1], l[j + 2]
    for j in range(3 * points, size):
        data.bound[data.reach_of[j], Bound.IMPULSE] = l[j]
    return settled


@kernel
def descend(model: Model, data: Data) -> None:
    """dnu = -H^-1 R"""
    for d in range(data.dnu.shape[0]):
        data.dnu[d] = -data.residual[d]
    solve(model, data, data.dnu, data.dnu)


@kernel
def predict(
    model: Model, data: Data, options: StepOptions, inputs: tuple[Vector, Vector, Vector]
) -> tuple[float, float]:
    """nu = v25 as it is predicted and the impulses, on the central path; returns their residuals, INFEASIBLE where that
    fails.

    At nu with the impulses of the step before, whose residual is in data.residual.
    """
    q, v, u = inputs
    h, kappa = options.h, options.kappa
    scale = residual_scale(data)
    if not factor_free(model, data, h, q, v):
        return INFEASIBLE
    descend(model, data)
    points, size = choose_reached(model, data, h, kappa)
    if size < 0:
        return INFEASIBLE
    delassus(model, data, h, points, size)
    settled, changed = True, False
    step = 1
    while True:
        if size > 0:
            settled = reached_impulses(model, data, h, kappa, points, size)
            residuals(model, data, h, q, v, u)
            descend(model, data)
        for d in range(v.shape[0]):
            data.dnu[d] += data.nu[d]
        if not set_trial_velocity(model, data, h, q, data.dnu, 1.0):
            return INFEASIBLE
        missed = not changed and lands(model, data)  # where a foot rocks, onto a corner that the last impulses lift
        resume_inequalities(model, data, h, kappa, True)
        balance = residuals(model, data, h, q, v, u)
        if not missed and (step == _STEPS or not settled or max(balance[0] / scale, balance[1]) < _CLOSE):
            return balance
        descend(model, data)
        if missed:
            changed = True
            points, size = choose_reached(model, data, h, kappa)
            if size < 0:
                return INFEASIBLE
            delassus(model, data, h, points, size)
        else:
            step += 1
            reached_rates(model, data, h, points, size)
