"""Motion of closed loops through a bifurcation: the start velocity that keeps a step on its branch.

At a bifurcation two branches of a loop's motion meet, as when the links of a parallelogram lie in one line. Near it the
equations of a step have a solution on each branch, as close to one another as configuration 3 is to the bifurcation.
The right one continues configurations 1 and 2. Newton's method finds it from a start that is closer to it than to the
other: the leapfrog start 2 P v - v (loop_velocity.py) has an error of O(h^3), the incoming velocity one of O(h^2). Of
two solutions the one closer to this start is taken.

This costs as much as the step, and far from a bifurcation it changes nothing. The least pivot of the system
(coupling_system.py) is the product of the distances of configurations 2 and 3 from singular ones. If it was not small
in the last step, the step is solved from its guess without regard to branches; if it is still not small, that is the
solution. At a singular configuration a constraint depends on others. The number of constraints that always do is
counted along the motion, and the first step of a motion always takes the full procedure.
"""

from __future__ import annotations

from sim.dynamics.energy import factor_mass_matrix
from sim.dynamics.loops.bifurcation import lead_loops
from sim.dynamics.loops.closure import direct_loops, start_loops
from sim.dynamics.loops.loop_velocity import close_velocity
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import CoupleRank
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.status import Status
from solvers.types import Vector

_CLOSER = 0.5  # share of a least pivot
_REGULAR = 5e-3  # a pivot above this is far from a bifurcation
_MAX_TRANSVERSE_SHARE = 0.5  # share of a velocity across its loops; of more, the loops were not closed


@optional(Slot.LOOPS_REGULAR, default=True)
def loops_regular(model: Model, data: Data) -> bool:
    """Whether the last step of this motion was far from a bifurcation; clears its pivot and directions."""
    data.bifurcation_count[0] = 0
    if data.carry.steps[0] == 0:
        data.couple_rank[CoupleRank.DEFICIENCY] = 1e300
        return False
    deficiency = data.couple_rank[CoupleRank.SIZE] - data.couple_rank[CoupleRank.RANK]
    data.couple_rank[CoupleRank.DEFICIENCY] = min(data.couple_rank[CoupleRank.DEFICIENCY], deficiency)
    regular = deficiency == data.couple_rank[CoupleRank.DEFICIENCY] and data.couple_rank[CoupleRank.PIVOT] > _REGULAR
    data.couple_rank[CoupleRank.PIVOT] = 0.0
    return regular


@optional(Slot.STAY_REGULAR, default=True)
def stay_regular(model: Model, data: Data, status: int) -> bool:
    """Whether this step is as far, too; if not, the forces of loops are zero again."""
    deficiency = data.couple_rank[CoupleRank.SIZE] - data.couple_rank[CoupleRank.RANK]
    if (
        status == Status.SOLVED
        and data.couple_rank[CoupleRank.PIVOT] > _REGULAR
        and deficiency <= data.couple_rank[CoupleRank.DEFICIENCY]
    ):
        return True
    start_loops(model, data, False)
    return False


@optional(Slot.PREDICT_LOOPS, default=False)
def predict_loops(model: Model, data: Data, h: float, q: Vector, v: Vector, guess: Vector) -> bool:
    """loop_velocity = 2 P v - v, and its directions of forces (bifurcation.py); False if a guess is not v.

    q: (nq,) configuration 2; v: (nv,) velocity of the interval 1-2. Where loops are open v need not be along them; then
    the start is P v.
    """
    if model.loop_ntrans.shape[0] == 0 or not factor_mass_matrix(model, data, 0.0):
        return False
    given = False
    for d in range(v.shape[0]):
        given = given or guess[d] != v[d]
        data.loop_velocity[d] = v[d]
    close_velocity(model, data, h, q, v, data.loop_velocity)
    across = 0.0
    whole = 0.0
    for d in range(v.shape[0]):
        across = max(across, abs(v[d] - data.loop_velocity[d]))
        whole = max(whole, abs(v[d]))
    for d in range(v.shape[0]):
        if across < _MAX_TRANSVERSE_SHARE * whole:
            data.loop_velocity[d] += data.loop_velocity[d] - v[d]
    data.loop_pivot[0] = data.couple_rank[CoupleRank.PIVOT]
    _no_step(data)
    return not given


@optional(Slot.RECOMPUTE_BIFURCATION, default=False)
def recompute_bifurcation(model: Model, data: Data, h: float, q: Vector) -> bool:
    """Where directions were led, those by the velocity of the solution, which loop_velocity keeps; False elsewhere."""
    if data.bifurcation_count[0] == 0:
        return False
    for d in range(data.nu.shape[0]):
        data.loop_velocity[d] = data.nu[d]
    _no_step(data)
    direct_loops(model, data)
    lead_loops(model, data, h, q, data.loop_velocity)
    return True


@optional(Slot.CROSSES_BIFURCATION, default=False)
def crosses_bifurcation(model: Model, data: Data) -> bool:
    """Whether the solution is closer to the bifurcation than configuration 2, and so may be on another branch.

    Then loop_start is a start on the other side of the prediction, and loop_kept the solution.
    """
    if data.bifurcation_count[0] > 0 or not data.couple_rank[CoupleRank.PIVOT] < _CLOSER * data.loop_pivot[0]:
        return False
    for d in range(data.nu.shape[0]):
        data.loop_kept[d] = data.nu[d]
        data.loop_start[d] = 2.0 * data.loop_velocity[d] - data.nu[d]
    _no_step(data)
    return True


@optional(Slot.IS_OTHER_BRANCH, default=False)
def is_other_branch(model: Model, data: Data, status: int) -> bool:
    """Whether the solution is none, or farther from the prediction than the one kept, which loop_start is then."""
    kept = 0.0
    found = 0.0
    for d in range(data.nu.shape[0]):
        kept += (data.loop_kept[d] - data.loop_velocity[d]) ** 2
        found += (data.nu[d] - data.loop_velocity[d]) ** 2
        data.loop_start[d] = data.loop_kept[d]
    _no_step(data)
    return status != Status.SOLVED or found > (1.0 + 1e-6) * kept


@kernel
def _no_step(data: Data) -> None:
    """Set the forces of loops to zero, with which a solve begins."""
    for row in range(data.couple_step.shape[0]):
        data.couple_step[row] = 0.0
