"""The Newton matrix of a step without contacts and limits, which condense into it (inequalities.py)."""

from __future__ import annotations

from sim.dynamics import momentum_balance_jacobian
from sim.elimination import factor
from sim.joints.terms import joint_blocks
from sim.kinematics import velocity_columns
from sim.model import Model, Vector
from sim.work import Work
from solvers.compiler import kernel


@kernel
def free_matrix(model: Model, work: Work, h: float, q: Vector, v: Vector) -> None:
    """S3nu, A = d(balance)/d(twist) and joint_block at nu."""
    velocity_columns(model, work.S3, work.nu, h, work.S3nu)
    momentum_balance_jacobian(model, work, h, work.A)
    joint_blocks(model, work, h, q, v)


@kernel
def factor_free(model: Model, work: Work, h: float, q: Vector, v: Vector) -> bool:
    """The same, eliminated; False if it is singular."""
    free_matrix(model, work, h, q, v)
    return factor(model, work) != 0
