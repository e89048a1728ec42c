"""Leaps of robots on two feet, without a reference motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt import models
from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.biped import over_its_feet
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.legs import Legs
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["humanoid_leap"]

# in units of the height and weight of a quadruped, see `Legs`
_DISTANCE, _HEIGHT, _CROUCH, _DURATION, _KNOTS = 0.1, 0.05, 0.04, 0.81, 70  # [m], [m], [m], [s]
_PLACE, _UP, _TURN, _ANGLE = 88.0, 880.0, 20.0, 0.3  # of lengths and angles, per second
_SPEED, _SPIN, _RATE, _EFFORT = 0.3, 0.03, 1e-3, 1.8e-3  # of their rates, and of torques
_DAMPER = 0.06  # share of the usual damper of a gait
_SMOOTH = 1.5e-5  # [N s m] of the equilibrium that the guess stands in
_CLEAR = 1e-5  # [m] between the lowest contact and the ground at the start


@checked_numbers("problems")
def humanoid_leap(
    *,
    robot: Any = None,
    distance: float | None = None,
    height: float | None = None,
    refinement: int = 4,
) -> Problem:
    """A humanoid leaps forward from rest, without a reference motion or a contact schedule.

    As in `leap`, the cost has a few reference poses: for .3 of the duration, 1.4 s for Atlas, the stance lowered by .12
    m, for another .3 the pose half-way to the goal, raised by `height`, then the pose at the goal. For Atlas squares of
    the place weigh 10, 10, 100 per second, attitude 20, angles .3, torques 1e-6; other robots have these numbers in
    units of height and weight. The pose of the base at the end is a constraint. The guess stands still.

    Args:
        robot: a mechanism on two feet, on a floating base that looks along x (default None: `models.atlas`).
        distance: displacement along x [m] (default None: .3 for Atlas).
        height: rise of the base in the middle [m] (default None: .15 for Atlas).
        refinement: number of parts of every time step in the second half of `ilqr`; with 1 a robot that follows the
            plan lands centimetres beside it.

    Returns:
        The problem.

    Raises:
        ValueError: for an argument out of range, or a robot without two legs.
    """
    call = "problems.humanoid_leap"
    legs = Legs(models.atlas() if robot is None else robot, share=_DAMPER)
    if not legs.biped:
        raise ValueError(f"{call}(robot=...): expected a robot on two feet, got {', '.join(legs.feet)}")
    size, slow = legs.size, legs.size**0.5
    far = _DISTANCE * size if distance is None else checks.number(f"{call}(distance=...)", distance)
    high = _HEIGHT * size if height is None else checks.number(f"{call}(height=...)", height)
    sim = legs.simulator(1e-3 * round(1e3 * _DURATION * slow / _KNOTS), PLANNED)
    stance, held = equilibrium(sim.replace(kappa=_SMOOTH * legs.torque * slow), over_its_feet(sim))
    start = _moved(Feet(sim).put_down(stance), 0.0, _CLEAR)
    low, apex, goal = (_moved(start, *by) for by in ((0.0, -_CROUCH * size), (0.5 * far, high), (far, 0.0)))
    part = round(0.3 * _KNOTS)
    poses = np.array([low] * part + [apex] * part + [goal] * (_KNOTS + 1 - 2 * part))
    return Problem(
        sim,
        start,
        _KNOTS,
        cost=[
            Tracking(poses, sim.time_step * _weights(legs, sim)),
            Effort(sim.time_step * _EFFORT / legs.torque**2),
        ],
        constraints=[Goal(goal, components=np.arange(6))],
        controls0=np.clip(held, *sim.mechanism.input_limits),
        states0=np.tile(start, (_KNOTS + 1, 1)),
        refinement=whole_number(f"{call}(refinement=...)", refinement),
        advice="Try a smaller distance or height.",
    )


def _moved(x: Floats, ahead: float, up: float) -> Floats:
    """The state (nx,) with the base moved forward and up [m]."""
    out = x.copy()
    out[[0, 2]] += ahead, up
    return out


def _weights(legs: Legs, sim: Simulator) -> Floats:
    """(ndx,) weights per second of squares, in units of the robot's height and time."""
    joints, size = np.ones(sim.nv - 6), legs.size
    place = np.array([_PLACE, _PLACE, _UP]) / size**2
    rates = [*np.full(3, _SPEED / size), *np.full(3, _SPIN * size), *_RATE * size * joints]
    return np.concatenate([place, np.full(3, _TURN), _ANGLE * joints, rates])
