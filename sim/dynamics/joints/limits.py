"""Joint limits on the central path: s = gap, s gamma = kappa, generalized impulse d(gap)/d(coordinates) gamma.

    bound    gap = sign (theta3 - bound)    of one coordinate
    cone     of a quaternion joint, see cone_limit.py

Columns of `bound` (and of its steps): 0 slack s, 1 impulse gamma.
"""

from __future__ import annotations

from sim.dynamics.joints.cone_limit import cone_block, cone_derivative, cone_gap
from sim.dynamics.joints.joint_forces import add_limit_impulse
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import NewtonTarget
from sim.model.record_columns import Bound, BoundRow
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.cones import onto_path, return_pair


@kernel
def limit_gaps(model: Model, data: Data, h: float) -> None:
    """bound_gap, and p of cones."""
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            cone_gap(model, data, h, k)
            continue
        a = model.dof_qadr[model.limit_dof[k]]
        data.bound_gap[k] = model.limit_sign[k] * (data.theta3[a] - model.limit_bound[k])


@kernel
def add_limit_blocks(model: Model, data: Data, h: float) -> None:
    """joint_block += h gamma/s on the diagonal, and the corresponding terms of cones."""
    for k in range(model.limit_dof.shape[0]):
        d = model.limit_dof[k]
        i = model.dof_body[d]
        n = model.body_vadr[i + 1] - model.body_vadr[i]
        a = d - model.body_vadr[i]
        if model.limit_cone[k]:
            cone_block(model, data, h, k)
        else:
            data.joint_block[i, a * n + a] += h * data.bound[k, Bound.IMPULSE] / data.bound[k, Bound.SLACK]


@optional(Slot.ADD_LIMIT_DERIVATIVES)
def add_limit_derivatives(model: Model, data: Data, h: float) -> None:
    """dR_dq += gamma/s, and the corresponding terms of cones."""
    for k in range(model.limit_dof.shape[0]):
        if model.limit_cone[k]:
            cone_derivative(model, data, h, k)
        else:
            d = model.limit_dof[k]
            data.dR_dq[d, d] += data.bound[k, Bound.IMPULSE] / data.bound[k, Bound.SLACK]


@kernel
def limit_constants(model: Model, data: Data, target: NewtonTarget) -> None:
    """dnu += (impulse of size w), with d gamma = w - (gamma/s) d gap; w kept in bound_w."""
    for k in range(model.limit_dof.shape[0]):
        s = data.bound[k, Bound.SLACK]
        g = data.bound[k, Bound.IMPULSE]
        r = target.kappa - s * g
        if target.corrected > 0.0:
            r -= target.corrected * data.carry.bound_step[k, Bound.SLACK] * data.carry.bound_step[k, Bound.IMPULSE]
        w = (r - g * target.gap_fraction * (data.bound_gap[k] - s)) / s
        data.bound_w[k] = w
        add_limit_impulse(model, data, k, w, data.dnu)


@kernel
def resume_limits(model: Model, data: Data, weight: float, kappa: float, predicted: bool) -> None:
    """All pairs on the central path of kappa, near their gaps and the impulses that they had (in bound_trial).

    predicted: near the impulses that they have now; those that press stay and give the slacks.
    """
    for k in range(model.limit_dof.shape[0]):
        b = data.bound[k]
        impulse = b[Bound.IMPULSE] if predicted else data.bound_trial[k, Bound.IMPULSE]
        if predicted and weight * impulse * impulse > kappa:
            b[Bound.SLACK] = kappa / impulse
        else:
            b[Bound.SLACK], b[Bound.IMPULSE] = onto_path(data.bound_gap[k], impulse, weight, kappa)


@kernel
def return_limits(model: Model, data: Data, weight: float, kappa: float) -> None:
    """The pairs that left their cones put back onto the central path of kappa."""
    for k in range(model.limit_dof.shape[0]):
        return_pair(data.bound[k], data.bound_trial[k], Bound.SLACK.value, Bound.IMPULSE.value, weight, kappa)


@kernel
def recover_limits(model: Model, data: Data, h: float, gap_fraction: float) -> None:
    """bound_step from dnu."""
    for k in range(model.limit_dof.shape[0]):
        s = data.bound[k, Bound.SLACK]
        d = model.limit_dof[k]
        if model.limit_cone[k]:
            c = data.bound_row[k]
            t = (
                c[BoundRow.RATE] * data.dnu[d]
                + c[BoundRow.RATE + 1] * data.dnu[d + 1]
                + c[BoundRow.RATE + 2] * data.dnu[d + 2]
            )
        else:
            t = model.limit_sign[k] * h * data.dnu[d]
        data.carry.bound_step[k, Bound.SLACK] = t + gap_fraction * (data.bound_gap[k] - s)
        data.carry.bound_step[k, Bound.IMPULSE] = data.bound_w[k] - data.bound[k, Bound.IMPULSE] / s * t
