"""The Newton matrix of a step without contacts and limits, which condense into it (inequalities.py)."""

from __future__ import annotations

from sim.contact.corner_laws import add_corner_laws
from sim.dynamics.elimination import factor
from sim.dynamics.joints.joint_forces import joint_blocks
from sim.dynamics.kinematics import velocity_columns
from sim.dynamics.momentum_balance import momentum_balance_jacobian
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.types import Vector


@kernel
def free_matrix(model: Model, data: Data, h: float, q: Vector, v: Vector) -> None:
    """S3nu, A = d(balance)/d(twist) and joint_block at nu."""
    velocity_columns(model, data.S3, data.nu, h, data.S3nu)
    momentum_balance_jacobian(model, data, h, data.A)
    joint_blocks(model, data, h, q, v)


@kernel
def factor_free(model: Model, data: Data, h: float, q: Vector, v: Vector) -> bool:
    """Free matrix with the laws of inactive corners, eliminated; False if it is singular."""
    free_matrix(model, data, h, q, v)
    add_corner_laws(model, data, h, 1.0, False, data.A)
    return factor(model, data) != 0
