"""Where a motion goes on: the step linearised at its incoming velocity, with hard contacts; a step of Josephy's method.

    H (v25 - v) = -R(v) + B^T l,      w = w(v) + J (v25 - v) = w0 + G l,      w and l of hard contacts and limits

Newton's method finds out slowly which contacts press, stick and slide, one iteration of it costs as much as all of this
(sim/solve/delassus.py), and from here it takes three or four. What the solution does differently is of second order in
the change of the velocity.
"""

from __future__ import annotations

from sim.contacts.contact import contact_jacobian, contact_rate
from sim.contacts.friction import law_of, touch_contact
from sim.dynamics import momentum_balance_jacobian
from sim.elimination import factor, solve
from sim.joints.limits import touch_limits
from sim.joints.terms import joint_blocks
from sim.kinematics import velocity_columns
from sim.model import Law, Model, Vector
from sim.options import Options
from sim.solve.delassus import delassus
from sim.solve.inequalities import LIMIT_INERTIA
from sim.solve.merit import residuals
from sim.work import Work
from solvers.gauss_seidel import gauss_seidel
from solvers.jit import kernel

_LINEAR = int(Law.LINEAR)
_NONLINEAR = int(Law.NONLINEAR)
_NEAR = 0.2  # of the way to a contact that the free motion goes: what may touch


@kernel
def predictable(model: Model, work: Work) -> bool:
    """Whether `predict` knows all that acts: no pairs of bodies, loops, gears or friction pyramids."""
    if work.counts[2] != work.counts[0] or model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0:
        return False
    for m in range(work.counts[0]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            if law_of(model, c) == _LINEAR:
                return False
    return True


@kernel
def release(model: Model, work: Work) -> None:
    """No impulses of contacts and limits, but those of cone limits."""
    for m in range(work.counts[0]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            for k in range(1, 4):
                work.cone[c, k] = 0.0
    for k in range(model.limit_dof.shape[0]):
        if not model.limit_cone[k]:
            work.bound[k, 1] = 0.0


@kernel
def _may_touch(gap: float, rate: float, slack: float, impulse: float, kappa: float) -> bool:
    """Whether a gap may close: by the free motion, or because it did in the step before."""
    return gap + rate < max(_NEAR * abs(rate), kappa**0.5) or impulse > slack


@kernel
def choose(model: Model, work: Work, h: float, kappa: float) -> tuple[int, int]:
    """Contacts and limits that may touch, into reach_of, with w0 and the impulses of the step before; (contacts, rows).
    The others get the impulses of their gaps.

    After a solve for the free motion. (0, -1) when there are more of them than places.
    """
    most = work.reach_of.shape[0]
    w, l = work.reach_rate, work.reach_impulse
    n = 0
    for m in range(work.counts[0]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            contact_jacobian(model, work, h, c)
            a, x, y = contact_rate(model, work, c)
            gap = work.contact_kin[c, 0]
            z = work.cone_trial[c]
            if _may_touch(gap, a, z[0], z[1], kappa):
                if n + 3 > most:
                    return 0, -1
                work.reach_of[n] = c
                work.reach_friction[n] = model.contact_friction[c] if law_of(model, c) == _NONLINEAR else 0.0
                w[n], w[n + 1], w[n + 2] = gap + a, work.contact_kin[c, 1] + x, work.contact_kin[c, 2] + y
                l[n], l[n + 1], l[n + 2] = z[1], z[2], z[3]
                n += 3
            else:
                work.cone[c, 1] = kappa / (gap + a)
    points = n // 3
    for k in range(model.limit_dof.shape[0]):
        rate = h * model.limit_sign[k] * work.dnu[model.limit_dof[k]]
        z = work.bound_trial[k]
        if model.limit_cone[k]:
            continue
        if _may_touch(work.bound_gap[k], rate, z[0], z[1], kappa):
            if n + 1 > most:
                return 0, -1
            work.reach_of[n] = k
            w[n], l[n] = work.bound_gap[k] + rate, z[1]
            n += 1
        else:
            work.bound[k, 1] = kappa / (work.bound_gap[k] + rate)
    return points, n


@kernel
def impulses(model: Model, work: Work, h: float, kappa: float, points: int, size: int) -> None:
    """Impulses of the contacts and limits chosen, into cone and bound."""
    w, l = work.reach_rate, work.reach_impulse
    delassus(model, work, h, points, size)
    for j in range(size):
        g = work.delassus[j]
        for k in range(size):
            w[k] += g[k] * l[j]
    gauss_seidel(work.delassus, work.reach_friction, h, kappa, points, size, w, l)
    for a in range(0, 3 * points, 3):
        z = work.cone[work.reach_of[a]]
        z[1], z[2], z[3] = l[a], l[a + 1], l[a + 2]
    for a in range(3 * points, size):
        work.bound[work.reach_of[a], 1] = l[a]


@kernel
def predict(model: Model, work: Work, options: Options, inputs: tuple[Vector, Vector, Vector]) -> bool:
    """dnu = v25 as it is predicted, and the impulses into cone and bound; False where that fails.

    At nu = v, without impulses, whose residual is in work.residual.
    """
    q, v, u = inputs
    h, kappa = options.h, options.kappa
    velocity_columns(model, work.S3, work.nu, h, work.S3nu)
    momentum_balance_jacobian(model, work, h, work.A)
    joint_blocks(model, work, h, q, v)
    if factor(model, work) == 0:
        return False
    for d in range(v.shape[0]):
        work.dnu[d] = -work.residual[d]
    solve(model, work, work.dnu, work.dnu)
    points, size = choose(model, work, h, kappa)
    if size < 0:
        return False
    if size > 0:
        impulses(model, work, h, kappa, points, size)
        residuals(model, work, h, q, v, u)
        for d in range(v.shape[0]):
            work.dnu[d] = -work.residual[d]
        solve(model, work, work.dnu, work.dnu)
    for d in range(v.shape[0]):
        work.dnu[d] += work.nu[d]
    return True


@kernel
def touch_inequalities(model: Model, work: Work, options: Options) -> None:
    """Slacks that belong to the predicted impulses, on the central path of kappa."""
    for m in range(work.counts[2]):
        for c in range(work.near[m, 0], work.near[m, 1]):
            touch_contact(model, work, options.h, c, options.kappa)
    touch_limits(model, work, options.h / LIMIT_INERTIA, options.kappa)
