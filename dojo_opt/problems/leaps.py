"""Leaps: problems of a quadruped that jumps without a reference gait."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt import models
from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from dojo_opt.problems.locomotion import EFFORT, TORQUE_LIMIT, standing, weights
from dojo_opt.problems.whole_knots import whole_knots
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.memory_limit import check_room
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["leap"]


@checked_numbers("problems")
def leap(
    *,
    distance: float = 0.3,
    height: float = 0.2,
    duration: float = 1.0,
    crouch: float = 0.1,
    damping: float = 0.5,
    time_step: float = 0.02,
    refinement: int = 5,
    **model: Any,
) -> Problem:
    """The quadruped leaps forward from rest, without a reference gait or a contact schedule.

    As in `hop`, the cost has a few reference poses: for a fifth of `duration` the standing pose lowered by `crouch`,
    for two fifths the pose half-way to the goal, raised by `height`, then the pose at the goal. Squares of place weigh
    1, 1, 20, attitude 2, angles .05 per second, the rest as in `follow`. The pose of the base at the end is a
    constraint. The guess is a robot that stands still at the smoothing of the planner's first stage, or of the first at
    which it stands: states and torques. Torques alone are no good guess: under them the robot falls on its back, and
    plans that begin there may stay there.

    Legs that push from the standing pose reach their torque limits below .27 m. Hence the crouch, which the planner
    does not find from a goal above. Most leaps planned with steps of 20 ms stumble at their landing in shorter steps;
    hence the refinement. In the refined problem the height is a constraint, too: half-way between the crouch and the
    landing, the base has to rise by it.

    Args:
        distance: displacement along x [m].
        height: rise of the base [m].
        duration: duration of the motion, rounded to whole knots, five at least [s].
        crouch: drop of the base before the leap [m], at least 0.
        damping: damper of the joints [N m s/rad].
        time_step: length of a knot [s].
        refinement: number of parts of every time step in the second half of `ilqr`; with 1, the plan may miss the
            height by some centimetres.
        **model: further parameters of `models.quadruped`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown parameter of the model.
        ValueError: for an argument out of range.
    """
    call = "problems.leap"
    distance = checks.number(f"{call}(distance=...)", distance)
    height = checks.number(f"{call}(height=...)", height)
    crouch = checks.number(f"{call}(crouch=...)", crouch, at_least=0.0)
    step = checks.number(f"{call}(time_step=...)", time_step, above=0.0)
    horizon = whole_knots(f"{call}(duration=...)", duration, step, 5)
    refinement = whole_number(f"{call}(refinement=...)", refinement)
    sim = Simulator(models.quadruped(damper=damping, **model), time_step=step, kappa=PLANNED)
    start, _ = equilibrium(sim)
    still, torques = standing(sim)
    check_room(f"{call}(duration=...)", horizon, 8.0 * sim.nx, "leap in less time, or with longer knots", "knots")
    low, apex, goal = (_moved(start, *by) for by in ((0.0, -crouch), (0.5 * distance, height), (distance, 0.0)))
    down, up = round(0.2 * horizon), round(0.4 * horizon)
    poses = np.array([low] * down + [apex] * up + [goal] * (horizon + 1 - down - up))
    return Problem(
        sim,
        start,
        horizon,
        cost=[Tracking(poses, step * weights(sim, (1.0, 1.0, 20.0), 2.0, 0.05)), Effort(step * EFFORT)],
        constraints=[Goal(goal, components=np.arange(6))],
        control_limits=(-TORQUE_LIMIT, TORQUE_LIMIT),
        controls0=torques,
        states0=np.tile(still, (horizon + 1, 1)),
        refinement=refinement,
        refined_constraints=Goal(apex, components=[2], knots=down + up // 2),
        advice="Try a smaller distance or height, a longer duration, or a deeper crouch.",
    )


def _moved(x: Floats, ahead: float, up: float) -> Floats:
    """The state (nx,) with the base so far [m] ahead and up."""
    out = x.copy()
    out[[0, 2]] += ahead, up
    return out
