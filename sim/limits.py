"""Joint limits on the central path: s = gap, s gamma = kappa, generalized impulse d(gap)/d(coordinates) gamma.

    bound    gap = sign (theta3 - bound)    of one coordinate
    cone     of a quaternion joint, see cone_limit.py

Columns of `bound` (and of its steps): 0 slack s, 1 impulse gamma.

A far limit has s = the gap and gamma = kappa/s at every iterate, with their exact derivative: the law is the same, but
no variable of the interior point. It is far where its stiffness cannot lead a Newton step astray,

    kappa h M/a^2 <= 0.01,        a: half the gap after one more step like the last one, M: limit_mobility

and near again, the step solved again, when the gap at the solution is below a.
"""

from __future__ import annotations

from sim.model import Goal, Late, Model, Options, Vector, Work
from solvers.jit import kernel
from solvers.record import call_late

_CONE_GAP = int(Late.CONE_GAP)
_CONE_BLOCK = int(Late.CONE_BLOCK)
_CONE_DERIVATIVE = int(Late.CONE_DERIVATIVE)

_STIFFNESS = 0.01  # largest stiffness of a far limit, in units of the inertia behind it


@kernel
def choose_far_limits(model: Model, work: Work, options: Options, q: Vector, v: Vector) -> None:
    """near_limit, and the least gap of the others in far_limit, at configuration 2."""
    near = 0
    for k in range(model.limit_dof.shape[0]):
        d = model.limit_dof[k]
        gap = model.limit_sign[k] * (q[model.dof_qadr[d]] - model.limit_bound[k])
        a = 0.5 * (gap - abs(options.h * v[d]))
        if a > 0.0 and options.kappa * options.h * model.limit_mobility[k] <= _STIFFNESS * a * a:
            work.far_limit[k] = a
        else:
            work.far_limit[k] = 0.0
            work.near_limit[near] = k
            near += 1
    work.count[1] = near


@kernel
def limits_came_near(model: Model, work: Work) -> bool:
    """Whether a far limit is not, at configuration 3; it is near from now on."""
    before = work.count[1]
    for k in range(model.limit_dof.shape[0]):
        if work.bound_gap[k] < work.far_limit[k]:
            work.far_limit[k] = 0.0
            work.near_limit[work.count[1]] = k
            work.count[1] += 1
    return work.count[1] > before


@kernel
def limit_gaps(model: Model, work: Work, h: float) -> None:
    """bound_gap, and p of cones; the slack of a far limit."""
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            call_late(model.late[_CONE_GAP], model, work, k, h, 0.0)
            continue
        a = model.dof_qadr[model.limit_dof[k]]
        gap = model.limit_sign[k] * (work.theta3[a] - model.limit_bound[k])
        work.bound_gap[k] = gap
        if work.far_limit[k] > 0.0:
            s = max(gap, work.far_limit[k])
            work.bound[k, 0] = s
            work.bound[k, 1] = work.far_law[0] / s


@kernel
def add_limit_impulse(model: Model, work: Work, k: int, size: float, out: Vector) -> None:
    """out += the generalized impulse of limit k.   out: (nv,)."""
    d = model.limit_dof[k]
    if model.limit_cone[k]:
        for j in range(3):
            out[d + j] += work.bound_row[k, j] * size
    else:
        out[d] += model.limit_sign[k] * size


@kernel
def add_limit_blocks(model: Model, work: Work, h: float) -> None:
    """joint_block += h gamma/s on the diagonal, and what a cone has in its place."""
    for k in range(model.limit_dof.shape[0]):
        d = model.limit_dof[k]
        i = model.dof_body[d]
        n = model.body_vadr[i + 1] - model.body_vadr[i]
        a = d - model.body_vadr[i]
        if model.limit_cone[k]:
            call_late(model.late[_CONE_BLOCK], model, work, k, h, 0.0)
        else:
            work.joint_block[i, a * n + a] += h * work.bound[k, 1] / work.bound[k, 0]


@kernel
def add_limit_derivatives(model: Model, work: Work, h: float) -> None:
    """dR_dq += gamma/s, and what a cone has in its place."""
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            call_late(model.late[_CONE_DERIVATIVE], model, work, k, h, 0.0)
        else:
            d = model.limit_dof[k]
            work.dR_dq[d, d] += work.bound[k, 1] / work.bound[k, 0]


@kernel
def limit_constants(model: Model, work: Work, goal: Goal) -> None:
    """dnu += (impulse of size w), with d gamma = w - (gamma/s) d gap; w kept in bound_w; near limits only."""
    for m in range(work.count[1]):
        k = work.near_limit[m]
        s = work.bound[k, 0]
        g = work.bound[k, 1]
        r = goal.kappa - s * g
        if goal.corrected:
            r -= work.bound_step[k, 0] * work.bound_step[k, 1]
        w = (r - g * goal.share * (work.bound_gap[k] - s)) / s
        work.bound_w[k] = w
        add_limit_impulse(model, work, k, w, work.dnu)


@kernel
def recover_limits(model: Model, work: Work, h: float, share: float) -> None:
    """bound_step of near limits from dnu."""
    for m in range(work.count[1]):
        k = work.near_limit[m]
        s = work.bound[k, 0]
        d = model.limit_dof[k]
        if model.limit_cone[k]:
            c = work.bound_row[k]
            t = c[3] * work.dnu[d] + c[4] * work.dnu[d + 1] + c[5] * work.dnu[d + 2]
        else:
            t = model.limit_sign[k] * h * work.dnu[d]
        work.bound_step[k, 0] = t + share * (work.bound_gap[k] - s)
        work.bound_step[k, 1] = work.bound_w[k] - work.bound[k, 1] / s * t
