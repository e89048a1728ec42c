"""Flips: problems of a quadruped that turns over in the air without a reference gait."""

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
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.memory_limit import check_room
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["backflip"]

_CROUCHED, _PUSH, _LANDED = 0.25, 0.12, 0.53  # [s] before the push, until the feet leave, after the landing
_STILL = 0.1  # [s] at the end, in which the base stands
_RAISED = 0.3  # of the crouch that the push rises beyond the stance
_LEAD = 0.3  # [rad] of the turn at take-off
_ATTITUDE, _ANGLE = 10.0, 0.05  # weights of squares per second


@checked_numbers("problems")
def backflip(
    *,
    distance: float = -0.2,
    height: float = 0.4,
    crouch: float = 0.1,
    damping: float = 0.5,
    time_step: float = 0.02,
    refinement: int = 5,
    **model: Any,
) -> Problem:
    """The quadruped turns over backwards in the air from rest, and lands on its feet; no reference gait, no schedule.

    The cost has reference poses of the base alone: lowered by `crouch` for .25 s, raised and turned by .3 rad within
    .12 s, then on a parabola of `height` while it turns at a constant rate, and at the goal for .53 s. What the legs
    do, and when feet touch, is not given: joints have the small weight of `leap`. Squares of place weigh 1, 1, 20,
    attitude 10 per second. The pose of the base at the end is a constraint. The guess of the states has these poses
    with the legs as they stand, and its torques are those of standing: from a guess that stands still, plans fall over.
    In the refined problem the base has this pose for the last tenth of a second, so that it stands: a pose at the end
    alone may be met in passing, and the gains of the last knots jerk the robot there.

    Args:
        distance: displacement along x [m].
        height: rise of the parabola [m], above 0.
        crouch: drop of the base before the flip [m], at least 0.
        damping: damper of the joints [N m s/rad].
        time_step: length of a knot [s].
        refinement: number of parts of every time step in the second half of `ilqr`; with 1, the robot stumbles at its
            landing in shorter steps.
        **model: further parameters of `models.quadruped`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown parameter of the model.
        ValueError: for an argument out of range.
    """
    call = "problems.backflip"
    distance = checks.number(f"{call}(distance=...)", distance)
    height = checks.number(f"{call}(height=...)", height, above=0.0)
    crouch = checks.number(f"{call}(crouch=...)", crouch, at_least=0.0)
    step = checks.number(f"{call}(time_step=...)", time_step, above=0.0)
    refinement = whole_number(f"{call}(refinement=...)", refinement)
    sim = Simulator(models.quadruped(damper=damping, **model), time_step=step, kappa=PLANNED)
    flight = _flight(height, sim)
    start, _ = equilibrium(sim)
    still, torques = standing(sim)
    horizon = round(min((_CROUCHED + _PUSH + flight + _LANDED) / step, 1e300))
    check_room(f"{call}(height=..., time_step=...)", horizon, 8.0 * sim.nx, "flip lower, or with longer knots", "knots")
    still_knots = np.arange(max(1, horizon - round(min(_STILL / step, 1e300))), horizon + 1)
    poses = _poses(start, np.linspace(0.0, step * horizon, horizon + 1), flight, distance, height, crouch)
    states = np.tile(still, (horizon + 1, 1))
    states[:, BaseState.POSE] = poses[:, BaseState.POSE]
    states[:, 2] += still[2] - start[2]
    return Problem(
        sim,
        start,
        horizon,
        cost=[Tracking(poses, step * weights(sim, (1.0, 1.0, 20.0), _ATTITUDE, _ANGLE)), Effort(step * EFFORT)],
        constraints=[Goal(poses[-1], components=np.arange(6))],
        control_limits=(-TORQUE_LIMIT, TORQUE_LIMIT),
        controls0=torques,
        states0=states,
        refinement=refinement,
        refined_constraints=Goal(poses[still_knots], components=np.arange(6), knots=still_knots),
        advice="Try another height, or a deeper crouch.",
    )


def _flight(height: float, sim: Simulator) -> float:
    """Time on a parabola of a height [s]."""
    gravity = float(np.linalg.norm(sim.mechanism.gravity))
    if gravity == 0.0:
        raise ValueError("problems.backflip(gravity=...): without gravity the robot never comes down")
    return float(2.0 * np.sqrt(2.0 * height / gravity))


def _poses(start: Floats, time: Floats, flight: float, distance: float, height: float, crouch: float) -> Floats:
    """States (N + 1, nx) of the cost at times (N + 1,), with the legs as at the start (nx,)."""
    push = np.clip((time - _CROUCHED) / _PUSH, 0.0, 1.0)
    air = np.clip((time - _CROUCHED - _PUSH) / flight, 0.0, 1.0)
    poses = np.tile(start, (len(time), 1))
    poses[:, 0] += distance * air
    rise = np.where(air > 0.0, 4.0 * height * air * (1.0 - air), crouch * ((1.0 + _RAISED) * push - 1.0))
    poses[:, 2] += rise
    half = -0.5 * (_LEAD * push**2 + (2.0 * np.pi - _LEAD) * air)
    poses[:, BaseState.QUATERNION] = np.column_stack([np.cos(half), 0.0 * half, np.sin(half), 0.0 * half])
    return poses
