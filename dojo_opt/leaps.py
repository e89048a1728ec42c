"""Leaps: problems of a quadruped that jumps with no gait to follow."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt import models
from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.locomotion import EFFORT, RATE, TORQUE_LIMIT, VELOCITY
from dojo_opt.options import PLANNED
from dojo_opt.problem import Problem
from dojo_opt.rest import equilibrium
from sim import checks
from sim.simulator import Simulator

__all__ = ["leap"]


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
    """The quadruped gets `distance` [m] ahead from rest, its base rising by `height` [m]: no gait, no contact sequence.

    As in `hop`, the cost asks for a few poses: for a fifth of `duration` [s] the standing one lowered by `crouch` [m],
    for two fifths that half-way to the goal, `height` up, then that at the goal. Squares of place weigh 1, 1, 20,
    attitude 2, angles .05 per second, the rest as in `follow`, and the pose of the base at the end is a constraint. The
    guess is the rollout of the torques of standing: single shooting.

    Legs that push from where they stand reach their torque limits below .27 m: hence the crouch, which no planner finds
    from a goal that is up. `ilqr` ends with every step cut into `refinement`, since most leaps planned with steps of
    20 ms stumble at their landing in shorter ones, and there the height is a constraint, too: half-way between the
    crouch and the landing the base is that much higher than at first, or the plan is no success. With refinement=1, the
    height is asked for and missed by up to some centimetres.
    """
    sim = Simulator(models.quadruped(damper=damping, **model), time_step=time_step, kappa=PLANNED)
    horizon = max(5, round(checks.number("problems.leap(duration=...)", duration, above=0.0) / time_step))
    start, torques = equilibrium(sim)
    goal, low = start.copy(), start.copy()
    goal[0] += distance
    low[2] -= checks.number("problems.leap(crouch=...)", crouch, at_least=0.0)
    apex = start.copy()
    apex[[0, 2]] += 0.5 * distance, height
    down, up = round(0.2 * horizon), round(0.4 * horizon)
    legs = sim.nv - 6
    parts = [
        np.array([1.0, 1.0, 20.0]),
        np.full(3, 2.0),
        np.full(legs, 0.05),
        np.full(6, VELOCITY),
        np.full(legs, RATE),
    ]
    problem = Problem(
        sim,
        start,
        horizon,
        cost=[
            Tracking(
                np.array([low] * down + [apex] * up + [goal] * (horizon + 1 - down - up)),
                time_step * np.concatenate(parts),
            ),
            Effort(time_step * EFFORT),
        ],
        constraints=[Goal(goal, components=np.arange(6))],
        control_limits=(-TORQUE_LIMIT, TORQUE_LIMIT),
        controls0=torques,
    )
    problem.refinement = refinement
    problem.refined_constraints = (Goal(apex, components=[2], knots=down + up // 2),)
    return problem
