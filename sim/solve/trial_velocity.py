"""Where an iterate of a step begins."""

from __future__ import annotations

from sim.contact.pairs.active_features import choose_pairs
from sim.dynamics.displacements import turn_bodies
from sim.dynamics.momentum_balance import momentum_balance
from sim.model.data import Data
from sim.model.model import Model
from sim.solve.inequalities import inequality_kinematics
from solvers.compiler import kernel
from solvers.types import Vector

INFEASIBLE = (1e300, 1e300)  # residuals where no trial velocity is feasible


@kernel
def set_trial_velocity(model: Model, data: Data, h: float, q: Vector, v: Vector, fraction: float) -> bool:
    """nu = fraction v, slowed down until no body turns by half a turn; False if that fails."""
    for _ in range(30):
        for d in range(v.shape[0]):
            data.nu[d] = fraction * v[d]
            data.nu_trial[d] = data.nu[d]
        if momentum_balance(model, data, h, q):
            turn_bodies(data, data.rot3)
            choose_pairs(model, data)
            inequality_kinematics(model, data, h)
            return True
        fraction *= 0.7
    return False
