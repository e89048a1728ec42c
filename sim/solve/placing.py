"""Where an iterate of a step begins."""

from __future__ import annotations

from sim.dynamics import momentum_balance
from sim.late import choose_pairs
from sim.model import Model, Vector
from sim.moves import turn_bodies
from sim.solve.inequalities import inequality_kinematics
from sim.work import Work
from solvers.compiler import kernel

NOWHERE = (1e300, 1e300)  # residuals where nothing could be placed


@kernel
def place(model: Model, work: Work, h: float, q: Vector, v: Vector, share: float) -> bool:
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
