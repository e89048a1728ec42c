"""A T is pushed to its place by forces on its faces."""

from __future__ import annotations

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.crisp.pushing import Face, Placed, flat_pose, slider
from dojo_opt.tasks.plan_task import PlanTask, continuation
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

__all__ = ["push_t"]

_KNOT, _HORIZON = 0.05, 50  # [s], knots
_KAPPAS = (1e-3, 1e-6)  # [N s m]
_NEAR, _TURNED = 0.005, 0.05  # [m], [rad] of the goal
_L = 0.05  # [m] width of bar and stem
_COM = (4.0 * 3.5 + 3.0 * 1.5) / 7.0  # [l] above the foot of the stem
_MASS, _FRICTION = 1.0, 0.4  # [kg]
_START, _GOAL = (0.24722, 0.0141359, -2.95844), (0.036, -0.143, -2.637)  # [m, m, rad]
# ends [l], from the middle of the foot of the stem, and normals of the faces
_FACES = (
    ((-0.5, 0.0), (0.5, 0.0), (0.0, 1.0)),
    ((-0.5, 0.0), (-0.5, 3.0), (1.0, 0.0)),
    ((0.5, 0.0), (0.5, 3.0), (-1.0, 0.0)),
    ((-2.0, 3.0), (-0.5, 3.0), (0.0, 1.0)),
    ((0.5, 3.0), (2.0, 3.0), (0.0, 1.0)),
    ((-2.0, 3.0), (-2.0, 4.0), (1.0, 0.0)),
    ((2.0, 3.0), (2.0, 4.0), (-1.0, 0.0)),
    ((-2.0, 4.0), (2.0, 4.0), (0.0, -1.0)),
)
_CORNERS = ((-0.5, 0.0), (0.5, 0.0), (-2.0, 3.0), (2.0, 3.0), (-2.0, 4.0), (2.0, 4.0))  # [l]


def _from_com(point: tuple[float, float]) -> tuple[float, float]:
    """A point [l] of the drawing from the centre of mass [m]."""
    return _L * point[0], _L * (point[1] - _COM)


def mechanism() -> Mechanism:
    """A T of 1 kg: a bar of 4 by 1 on a stem of 1 by 3 widths, which are 50 mm.

    Returns:
        The mechanism.
    """
    bar, stem = (1.0 + 16.0) / 12.0 + (3.5 - _COM) ** 2, (1.0 + 9.0) / 12.0 + (1.5 - _COM) ** 2
    inertia = _MASS * _L**2 * (4.0 * bar + 3.0 * stem) / 7.0
    faces = [Face(_from_com(begin), _from_com(end), inward) for begin, end, inward in _FACES]
    return slider("tee", _MASS, inertia, _FRICTION, [_from_com(corner) for corner in _CORNERS], faces)


def push_t() -> PlanTask:
    """Push a T by .26 m and turn it by .32 rad in 2.5 s: 50 knots of 50 ms.

    Squares of place and heading weigh 1, 100 at the end, forces .01. A plan is a success when it ends within 5 mm and
    .05 rad. The T has inertia, and friction at six corners, where that of the publication slides quasi-statically under
    an ellipsoidal limit surface. Several faces may be pushed at once, where the publication pushes one at a time.

    Returns:
        The task.
    """
    sim = Simulator(mechanism(), time_step=_KNOT, kappa=_KAPPAS[-1])
    weight = np.zeros(sim.ndx)
    weight[[0, 1, 5]] = 1.0
    cost = [Tracking(flat_pose(_GOAL), np.vstack([np.tile(weight, (_HORIZON, 1)), 100.0 * weight])), Effort(1e-2)]
    problem = Problem(sim, flat_pose(_START), _HORIZON, cost=cost)
    return PlanTask("crisp.push_t", problem, continuation(_KAPPAS), Placed(_GOAL, _NEAR, _TURNED))
