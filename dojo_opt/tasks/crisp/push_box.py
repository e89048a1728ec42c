"""A box is pushed across a table by forces on its faces."""

from __future__ import annotations

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.crisp.pushing import Face, Placed, flat_pose, slider
from dojo_opt.tasks.plan_task import PlanTask, continuation
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

__all__ = ["push_box"]

_KNOT, _HORIZON = 0.02, 100  # [s], knots
_KAPPAS = (1e-3, 1e-6)  # [N s m]
_NEAR, _TURNED = 0.05, 0.05  # [m], [rad] of the goal
_A, _B = 0.5, 0.25  # [m] half of its sides
_MASS, _FRICTION = 1.0, 0.5  # [kg]
_FAR, _SECTOR = 3.0, np.radians(20.0)  # [m], [rad] of goals


def mechanism() -> Mechanism:
    """A box of 1 kg, 1 m by .5 m.

    Returns:
        The mechanism.
    """
    corners = [(_A, _B), (_A, -_B), (-_A, -_B), (-_A, _B)]
    faces = [
        Face(corners[0], corners[1], (-1.0, 0.0)),
        Face(corners[3], corners[2], (1.0, 0.0)),
        Face(corners[0], corners[3], (0.0, -1.0)),
        Face(corners[1], corners[2], (0.0, 1.0)),
    ]
    return slider("box", _MASS, _MASS * (_A**2 + _B**2) / 3.0, _FRICTION, corners, faces)


def push_box(sector: int = 12) -> PlanTask:
    """Push a box 3 m away and turn it in 2 s: 100 knots of 20 ms.

    The goal lies in the direction of `sector` times 20 degrees, which is also its heading. Only the end has a cost, 100
    of squares of place and heading, and forces .001. A plan is a success when it ends within 50 mm and .05 rad.

    The box has inertia, and friction at its four corners, where that of the publication slides quasi-statically under
    an ellipsoidal limit surface. Several faces may be pushed at once, where the publication pushes one at a time.

    Args:
        sector: number of the direction.

    Returns:
        The task.

    Raises:
        TypeError: `sector` is not a whole number.
        ValueError: it is negative.
    """
    angle = _SECTOR * checks.whole_number("tasks.crisp.push_box(sector=...)", sector, 0)
    goal = (_FAR * np.cos(angle), _FAR * np.sin(angle), angle)
    sim = Simulator(mechanism(), time_step=_KNOT, kappa=_KAPPAS[-1])
    weight = np.zeros(sim.ndx)
    weight[[0, 1, 5]] = 100.0
    cost = [Tracking(flat_pose(goal), weight, knots=[_HORIZON]), Effort(1e-3)]
    problem = Problem(sim, flat_pose((0.0, 0.0, 0.0)), _HORIZON, cost=cost)
    return PlanTask("crisp.push_box", problem, continuation(_KAPPAS), Placed(goal, _NEAR, _TURNED))
