"""Where an iterate of a step begins."""

from __future__ import annotations

from sim.contact.pairs.active_features import choose_pairs
from sim.dynamics.displacements import turn_bodies
from sim.dynamics.momentum_balance import momentum_balance
from sim.model.data import Work
from sim.model.model import Model
from sim.solve.inequalities import inequality_kinematics
from solvers.compiler import kernel
from solvers.types import Vector

INFEASIBLE = (1e300, 1e300)  # residuals where no trial velocity is feasible


@kernel
def set_trial_velocity(model: Model, work: Work, h: float, q: Vector, v: Vector, share: float) -> bool:
    """nu = share v, slowed down until no body turns by half a turn; False if that fails."""
    for _ in range(30):
        for d in range(v.shape[0]):
            work.nu[d] = share * v[d]
            work.nu_trial[d] = work.nu[d]
        if momentum_balance(model, work, h, q):
            turn_bodies(work, work.rot3)
            choose_pairs(model, work)
            inequality_kinematics(model, work, h)
            return True
        share *= 0.7
    return False
