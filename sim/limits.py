"""Joint limits on the central path: s = sign (theta3 - bound), s gamma = kappa, generalized impulse sign gamma.

Columns of `bound` (and of its steps): 0 slack s, 1 impulse gamma.
"""

from __future__ import annotations

from sim.model import Model, Work
from solvers.jit import kernel


@kernel
def limit_gaps(model: Model, work: Work) -> None:
    """bound_gap = sign (theta3 - bound)."""
    for k in range(model.limit_dof.shape[0]):
        a = model.dof_qadr[model.limit_dof[k]]
        work.bound_gap[k] = model.limit_sign[k] * (work.theta3[a] - model.limit_bound[k])


@kernel
def start_limits(model: Model, work: Work, kappa: float, floor: float) -> None:
    """Slacks at the present gap, at least `floor`, and impulses on the central path."""
    for k in range(model.limit_dof.shape[0]):
        s = max(work.bound_gap[k], floor)
        work.bound[k, 0] = s
        work.bound[k, 1] = kappa / s


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
def limit_constants(model: Model, work: Work, kappa: float, corrected: bool, reduce: float) -> None:
    """dnu += sign w, with d gamma = w - (gamma/s) sign h d nu; kept in bound_w."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, 0]
        g = work.bound[k, 1]
        r = kappa - s * g
        if corrected:
            r -= work.bound_step[k, 0] * work.bound_step[k, 1]
        w = (r - g * reduce * (work.bound_gap[k] - s)) / s
        work.bound_w[k] = w
        work.dnu[model.limit_dof[k]] += model.limit_sign[k] * w


@kernel
def recover_limits(model: Model, work: Work, h: float, reduce: float) -> None:
    """bound_step from dnu."""
    for k in range(model.limit_dof.shape[0]):
        s = work.bound[k, 0]
        t = model.limit_sign[k] * h * work.dnu[model.limit_dof[k]]
        work.bound_step[k, 0] = t + reduce * (work.bound_gap[k] - s)
        work.bound_step[k, 1] = work.bound_w[k] - work.bound[k, 1] / s * t
