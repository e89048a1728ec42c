"""Derivatives of a step by coordinates, velocities and inputs: the terms of servos whose force has limits.

Their impulse is T, c dT = e dP0 - h d nu (dry_friction.py): within limits dT = dP, beyond them c is large and dT zero.
"""

from __future__ import annotations

from sim.dynamics.joints.dry_friction import dry_compliance
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Drive, Gain
from sim.model.slots import Slot
from solvers.compiler import optional


@optional(Slot.ADD_DRIVE_DERIVATIVES)
def add_drive_derivatives(model: Model, data: Data, h: float) -> None:
    """dR_dq, dR_dv += servos whose force has limits: e/c of those without; see `add_spring_derivatives`."""
    for k in range(model.dry_dof.shape[0]):
        if model.dry_input[k] >= 0:
            d = model.dry_dof[k]
            part = data.dry_drive[k, Drive.COMPLIANCE] / dry_compliance(data, k)
            stiffness = model.dry_gain[k, Gain.STIFFNESS]
            data.dR_dq[d, d] += part * h * stiffness
            data.dR_dv[d, d] += part * 0.25 * h * stiffness


@optional(Slot.ADD_DRIVE_INPUTS)
def add_drive_inputs(model: Model, data: Data, h: float) -> None:
    """Columns of the inputs of servos whose force has limits: h g e/c."""
    nv = data.columns.shape[0]
    for k in range(model.dry_dof.shape[0]):
        j = model.dry_input[k]
        if j >= 0:
            part = data.dry_drive[k, Drive.COMPLIANCE] / dry_compliance(data, k)
            data.columns[model.dry_dof[k], 2 * nv + j] += part * h * model.dry_gain[k, Gain.INPUT]
