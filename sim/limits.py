"""Joint limits on the central path: s = sign (theta3 - bound), s gamma = kappa, generalized impulse sign gamma.

Columns of `bound` (and of its steps): 0 slack s, 1 impulse gamma.
"""

from __future__ import annotations

from sim.model import Goal, Model, Work
from solvers.cones import return_pair
from solvers.jit import kernel


@kernel
def limit_gaps(model: Model, work: Work) -> None:
    """bound_gap = sign (theta3 - bound)."""
    for k in range(model.limit_dof.shape[0]):
        a = model.dof_qadr[model.limit_dof[k]]
        work.bound_gap[k] = model.limit_sign[k] * (work.theta3[a] - model.limit_bound[k])


@kernel
def add_limit_blocks(model: Model, work: Work, h: float) -> None:
    """joint_block += h gamma/s on the diagonal."""
    for k in range(model.limit_dof.shape[0]):
        d = model.limit_dof[k]
        i = model.dof_body[d]
        n = model.body_vadr[i + 1] - model.body_vadr[i]
        a = d - model.body_vadr[i]
        work.joint_block[i, a * n + a] += h * work.bound[k, 1] / work.bound[k, 0]


@kernel
def limit_constants(model: Model, work: Work, goal: Goal) -> None:
    """dnu += sign w, with d gamma = w - (gamma/s) sign h d nu; kept in bound_w."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, 0]
        g = work.bound[k, 1]
        r = goal.kappa - s * g
        if goal.corrected:
            r -= work.bound_step[k, 0] * work.bound_step[k, 1]
        w = (r - g * goal.share * (work.bound_gap[k] - s)) / s
        work.bound_w[k] = w
        work.dnu[model.limit_dof[k]] += model.limit_sign[k] * w


@kernel
def return_limits(model: Model, work: Work, weight: float, kappa: float) -> None:
    """The pairs that left their cones put back onto the central path of kappa."""
    for k in range(model.limit_dof.shape[0]):
        return_pair(work.bound[k], work.bound_trial[k], 0, 1, weight, kappa)


@kernel
def recover_limits(model: Model, work: Work, h: float, share: float) -> None:
    """bound_step from dnu."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, 0]
        t = model.limit_sign[k] * h * work.dnu[model.limit_dof[k]]
        work.bound_step[k, 0] = t + share * (work.bound_gap[k] - s)
        work.bound_step[k, 1] = work.bound_w[k] - work.bound[k, 1] / s * t
