"""Where a motion goes on: the step linearised at its incoming velocity, with contacts and limits on the central path.

    H (v' - v25) = -R(v25, l) + B^T (l' - l),      w' = w(v25) + J (v' - v25) = w0 + G (l' - l)

from the impulses l of the step before: a step of Josephy's method. Newton's method finds out slowly which contacts
press, stick and slide, one iteration of it costs as much as all of this (sim/solve/delassus.py), and from here it takes
two or three. What the solution does differently is of second order in the change of the velocity; the same once more,
with the residual there and the matrices of before, costs less than an iteration and leaves a tenth of it or less.
"""

from __future__ import annotations

from sim.contact.contact_law import law_of
from sim.contact.ground_contact import contact_jacobian, contact_rate
from sim.dynamics.elimination import solve
from sim.model.columns import Bound, Cone, Kin
from sim.model.data import Work
from sim.model.model import Law, Model
from sim.model.options import Options
from sim.solve.delassus import delassus
from sim.solve.inequalities import resume_inequalities
from sim.solve.matrix import factor_free
from sim.solve.merit import residuals
from sim.solve.residual import residual_scale
from sim.solve.trial_velocity import INFEASIBLE, set_trial_velocity
from solvers.compiler import kernel
from solvers.gauss_seidel import gauss_seidel
from solvers.rotation import Vec3
from solvers.types import Vector

_NEAR = 0.2  # of the way to a contact that the motion goes: what may touch
_STEPS = 2
_CLOSE = 1e-3  # error, as of the merit, from which one iteration of Newton's method does more


@kernel
def predictable(model: Model, work: Work) -> bool:
    """Whether `predict` knows all that acts: no pairs of bodies, loops, gears or friction pyramids."""
    if work.active_count[0] != work.active_ground_count[0] or model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0:
        return False
    for m in range(work.active_ground_count[0]):
        c = work.active[m]
        if law_of(model, c) == Law.LINEAR:
            return False
    return True


@kernel
def _may_touch(gap: float, rate: float, slack: float, impulse: float, kappa: float) -> bool:
    """Whether a gap may close: by the motion that the impulses of the step before leave, or because it had closed."""
    return gap + rate < max(_NEAR * abs(rate), kappa**0.5) or impulse > slack


@kernel
def _take_contact(work: Work, j: int, c: int, rate: Vec3) -> None:
    """w and l of contact c, in rows j, j + 1, j + 2.   rate: `contact_rate`."""
    w, l = work.reach_rate, work.reach_impulse
    k, z = work.contact_kin[c], work.cone[c]
    w[j], w[j + 1], w[j + 2] = k[Kin.GAP] + rate[0], k[Kin.SLIP1] + rate[1], k[Kin.SLIP2] + rate[2]
    l[j], l[j + 1], l[j + 2] = z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2]


@kernel
def _take_limit(work: Work, j: int, k: int, rate: float) -> None:
    """w and l of limit k, in row j.   rate: `limit_rate`."""
    work.reach_rate[j] = work.bound_gap[k] + rate
    work.reach_impulse[j] = work.bound[k, Bound.IMPULSE]


@kernel
def limit_rate(model: Model, work: Work, h: float, k: int) -> float:
    """d(gap) of limit k of one coordinate, by the last solve."""
    return h * model.limit_sign[k] * work.dnu[model.limit_dof[k]]


@kernel
def choose(model: Model, work: Work, h: float, kappa: float) -> tuple[int, int]:
    """Contacts and limits that may touch, into reach_of, with w and l; and their number: (contacts, rows). The others
    get the impulses of their gaps.

    After a solve. (0, -1) when there are more of them than places.
    """
    most = work.reach_of.shape[0]
    n = 0
    for m in range(work.active_ground_count[0]):
        c = work.active[m]
        contact_jacobian(model, work, h, c)
        rate = contact_rate(model, work, c)
        gap = work.contact_kin[c, Kin.GAP]
        z = work.cone[c]
        if _may_touch(gap, rate[0], z[Cone.SLACK], z[Cone.IMPULSE], kappa):
            if n + 3 > most:
                return 0, -1
            work.reach_of[n] = c
            work.reach_friction[n] = model.contact_friction[c] if law_of(model, c) == Law.NONLINEAR else 0.0
            _take_contact(work, n, c, rate)
            n += 3
        else:
            z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2] = kappa / (gap + rate[0]), 0.0, 0.0
    points = n // 3
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            continue
        change = limit_rate(model, work, h, k)
        gap = work.bound_gap[k]
        if _may_touch(gap, change, work.bound[k, Bound.SLACK], work.bound[k, Bound.IMPULSE], kappa):
            if n + 1 > most:
                return 0, -1
            work.reach_of[n] = k
            _take_limit(work, n, k, change)
            n += 1
        else:
            work.bound[k, Bound.IMPULSE] = kappa / (gap + change)
    return points, n


@kernel
def rates(model: Model, work: Work, h: float, points: int, size: int) -> None:
    """w and l of the contacts and limits chosen, after the last solve."""
    for j in range(0, 3 * points, 3):
        _take_contact(work, j, work.reach_of[j], contact_rate(model, work, work.reach_of[j]))
    for j in range(3 * points, size):
        _take_limit(work, j, work.reach_of[j], limit_rate(model, work, h, work.reach_of[j]))


@kernel
def impulses(model: Model, work: Work, h: float, kappa: float, points: int, size: int) -> bool:
    """Impulses of the contacts and limits chosen, into cone and bound; whether they have settled."""
    l = work.reach_impulse
    settled = gauss_seidel(work.delassus, work.reach_friction, h, kappa, points, size, work.reach_rate, l)
    for j in range(0, 3 * points, 3):
        z = work.cone[work.reach_of[j]]
        z[Cone.IMPULSE], z[Cone.FRICTION1], z[Cone.FRICTION2] = l[j], l[j + 1], l[j + 2]
    for j in range(3 * points, size):
        work.bound[work.reach_of[j], Bound.IMPULSE] = l[j]
    return settled


@kernel
def descend(model: Model, work: Work) -> None:
    """dnu = -H^-1 R"""
    for d in range(work.dnu.shape[0]):
        work.dnu[d] = -work.residual[d]
    solve(model, work, work.dnu, work.dnu)


@kernel
def predict(model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector]) -> tuple[float, float]:
    """nu = v25 as it is predicted and the impulses, on the central path; returns their residuals, INFEASIBLE where that
    fails.

    At nu with the impulses of the step before, whose residual is in work.residual.
    """
    q, v, u = inputs
    h, kappa = options.h, options.kappa
    scale = residual_scale(work)
    if not factor_free(model, work, h, q, v):
        return INFEASIBLE
    descend(model, work)
    points, size = choose(model, work, h, kappa)
    if size < 0:
        return INFEASIBLE
    delassus(model, work, h, points, size)
    settled = True
    step = 1
    while True:
        if size > 0:
            settled = impulses(model, work, h, kappa, points, size)
            residuals(model, work, h, q, v, u)
            descend(model, work)
        for d in range(v.shape[0]):
            work.dnu[d] += work.nu[d]
        if not set_trial_velocity(model, work, h, q, work.dnu, 1.0):
            return INFEASIBLE
        resume_inequalities(model, work, h, kappa, True)
        balance = residuals(model, work, h, q, v, u)
        if step == _STEPS or not settled or max(balance[0] / scale, balance[1]) < _CLOSE:
            return balance
        step += 1
        for j in range(0, 3 * points, 3):
            contact_jacobian(model, work, h, work.reach_of[j])
        descend(model, work)
        rates(model, work, h, points, size)
