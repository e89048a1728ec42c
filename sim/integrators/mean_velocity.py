"""The mean velocity before a node where loops and gears are closed at both ends of its interval, for their dampers.

A damper takes h d (v + nu)/2 or so (dynamics/joints/damper.py), v and nu the mean velocities before and after a node.
The momentum of a node alone gives a v without the half impulse of loops there, off by O(h), and the damper would be of
first order. Impulses along G^T do not matter to the step, which has its own. So

    p(q, v) = p - G^T f      with f such that loops are closed at configuration 1
"""

from __future__ import annotations

from sim.dynamics.coordinates import node_poses
from sim.dynamics.energy import factor_mass_matrix
from sim.dynamics.kinematics import displace
from sim.dynamics.loops.loop_velocity import close_velocity, closing_velocity
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from sim.solve.start_velocity import meet_momentum, momentum_of_velocity
from solvers.compiler import optional
from solvers.status import Status
from solvers.types import Vector

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)
_CLOSINGS = 2  # each leaves O(h) of the gap


@optional(Slot.CLOSE_INTERVAL, default=_SOLVED)
def close_interval(model: Model, data: Data, h: float, x: Vector) -> int:
    """The velocity of the state x, of the momentum in data.nu, with loops closed at configuration 1; the Status."""
    for _ in range(_CLOSINGS):
        node_poses(model, data, h, x)
        if not factor_mass_matrix(model, data, 0.0) or not closing_velocity(model, data, h):
            return _SINGULAR
        momentum_of_velocity(model, data, 0.0, data.dnu, data.rhs)
        for d in range(data.nu.shape[0]):
            data.nu[d] += data.rhs[d]
        status = meet_momentum(model, data, h, x)
        if status != _SOLVED:
            return status
    return _SOLVED


@optional(Slot.CLOSE_NODE, default=False)
def close_node(model: Model, data: Data, x: Vector) -> bool:
    """Close loops and gears at the node x = (q, v), by changes along M^-1 G^T; False where they are singular."""
    nq = data.theta1.shape[0]
    for _ in range(_CLOSINGS):
        node_poses(model, data, 0.0, x)  # both configurations are that of the node
        if not factor_mass_matrix(model, data, 0.0) or not closing_velocity(model, data, 1.0):
            return False
        displace(model, x[:nq], data.dnu, -1.0, x[:nq])
    node_poses(model, data, 0.0, x)
    if not factor_mass_matrix(model, data, 0.0):
        return False
    for d in range(data.dnu.shape[0]):
        data.dnu[d] = x[nq + d]
    close_velocity(model, data, 1.0, x[:nq], x[nq:], data.dnu)
    for d in range(data.dnu.shape[0]):
        x[nq + d] = data.dnu[d]
    return True
