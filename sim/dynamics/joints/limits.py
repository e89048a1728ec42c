"""Joint limits on the central path: s = gap, s gamma = kappa, generalized impulse d(gap)/d(coordinates) gamma.

    bound    gap = sign (theta3 - bound)    of one coordinate
    cone     of a quaternion joint, see cone_limit.py

Columns of `bound` (and of its steps): 0 slack s, 1 impulse gamma.
"""

from __future__ import annotations

from sim.dynamics.joints.cone_limit import cone_block, cone_derivative, cone_gap
from sim.dynamics.joints.terms import add_limit_impulse
from sim.model.columns import Bound, BoundRow
from sim.model.data import Work
from sim.model.model import Model
from sim.model.options import NewtonTarget
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.cones import onto_path, return_pair


@kernel
def limit_gaps(model: Model, work: Work, h: float) -> None:
    """bound_gap, and p of cones."""
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            cone_gap(model, work, h, k)
            continue
        a = model.dof_qadr[model.limit_dof[k]]
        work.bound_gap[k] = model.limit_sign[k] * (work.theta3[a] - model.limit_bound[k])


@kernel
def add_limit_blocks(model: Model, work: Work, h: float) -> None:
    """joint_block += h gamma/s on the diagonal, and what a cone has in its place."""
    for k in range(model.limit_dof.shape[0]):
        d = model.limit_dof[k]
        i = model.dof_body[d]
        n = model.body_vadr[i + 1] - model.body_vadr[i]
        a = d - model.body_vadr[i]
        if model.limit_cone[k]:
            cone_block(model, work, h, k)
        else:
            work.joint_block[i, a * n + a] += h * work.bound[k, Bound.IMPULSE] / work.bound[k, Bound.SLACK]


@optional(Slot.ADD_LIMIT_DERIVATIVES)
def add_limit_derivatives(model: Model, work: Work, h: float) -> None:
    """dR_dq += gamma/s, and what a cone has in its place."""
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            cone_derivative(model, work, h, k)
        else:
            d = model.limit_dof[k]
            work.dR_dq[d, d] += work.bound[k, Bound.IMPULSE] / work.bound[k, Bound.SLACK]


@kernel
def limit_constants(model: Model, work: Work, target: NewtonTarget) -> None:
    """dnu += (impulse of size w), with d gamma = w - (gamma/s) d gap; w kept in bound_w."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, Bound.SLACK]
        g = work.bound[k, Bound.IMPULSE]
        r = target.kappa - s * g
        if target.corrected > 0.0:
            r -= target.corrected * work.bound_step[k, Bound.SLACK] * work.bound_step[k, Bound.IMPULSE]
        w = (r - g * target.share * (work.bound_gap[k] - s)) / s
        work.bound_w[k] = w
        add_limit_impulse(model, work, k, w, work.dnu)


@kernel
def resume_limits(model: Model, work: Work, weight: float, kappa: float, predicted: bool) -> None:
    """All pairs on the central path of kappa, near their gaps and the impulses that they had (in bound_trial).

    predicted: near the impulses that they have now; those that press stay and give the slacks.
    """
    for k in range(model.limit_dof.shape[0]):
        b = work.bound[k]
        impulse = b[Bound.IMPULSE] if predicted else work.bound_trial[k, Bound.IMPULSE]
        if predicted and weight * impulse * impulse > kappa:
            b[Bound.SLACK] = kappa / impulse
        else:
            b[Bound.SLACK], b[Bound.IMPULSE] = onto_path(work.bound_gap[k], impulse, weight, kappa)


@kernel
def return_limits(model: Model, work: Work, weight: float, kappa: float) -> None:
    """The pairs that left their cones put back onto the central path of kappa."""
    for k in range(model.limit_dof.shape[0]):
        return_pair(work.bound[k], work.bound_trial[k], 0, 1, weight, kappa)


@kernel
def recover_limits(model: Model, work: Work, h: float, share: float) -> None:
    """bound_step from dnu."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, Bound.SLACK]
        d = model.limit_dof[k]
        if model.limit_cone[k]:
            c = work.bound_row[k]
            t = (
                c[BoundRow.RATE] * work.dnu[d]
                + c[BoundRow.RATE + 1] * work.dnu[d + 1]
                + c[BoundRow.RATE + 2] * work.dnu[d + 2]
            )
        else:
            t = model.limit_sign[k] * h * work.dnu[d]
        work.bound_step[k, Bound.SLACK] = t + share * (work.bound_gap[k] - s)
        work.bound_step[k, Bound.IMPULSE] = work.bound_w[k] - work.bound[k, Bound.IMPULSE] / s * t
