"""A ball in the Allegro hand, which the fingers turn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.rescue import Rescue
from dojo_opt.mpc.settings import OPTIONS
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.idto.allegro_hand import JOINTS, STIFFNESS, Angles, mechanism
from dojo_opt.tasks.suite import SuiteTask, quadratic, servo_effort, timed
from sim.mechanism.collision import Collision
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere
from sim.mechanism.short_repr import short_repr
from sim.simulator.simulator import Simulator
from solvers.types import Vector

__all__ = ["BallTurn", "squeezing", "turning"]

_KNOT, _HORIZON, _RATE, _DURATION = 0.05, 40, 10.0, 10.0  # [s], knots, [Hz], [s]
_ANGLE = np.radians(15.0)  # [rad] off the goal at the end
_HEIGHT, _QUATERNION = JOINTS + 2, slice(JOINTS + 3, JOINTS + 7)  # of the ball, columns of a state
_KAPPA = 1e-5  # [N s m]
_BACKTRACKING = 0.25  # of the line search, whose rollouts take most of a tick
_WORK = 500  # iterations of the steps of a tick after which a rescue ends; one takes about 60 us
_EFFORT = 0.1  # [1/(N m)^2]
_FINGERS, _BALL = 0.01, 10.0  # weights of places while the ball turns
_FINGER_RATES, _BALL_RATES = 1e-3, 1.0  # those of velocities


@dataclass(frozen=True)
class BallTurn:
    """A ball to turn in place by 90 degrees about the vertical.

    Attributes:
        name: name of the task.
        opened: joints at the start, about the ball without contact.
        nominal: those of the cost, and of the first guess of the servos' targets if `closing`.
        closing: whether the first guess closes the hand to `nominal`; otherwise it keeps it open.
        gravity: acceleration along z [m/s^2].
        grip: friction of the fingers that plans assume, 1 in the plant.
        stops: whether plans know the stops of the joints.
        spread: largest change of a finger's joint in a perturbed start [rad].
        end: weights of (fingers, ball, velocities of the fingers, of the ball) at the last knot.
        smoothing: those of rollouts and of derivatives in the stages of the first plan [N s m].
        reach: smallest and largest height at which the fingers hold the ball [m].
        squeeze: force of each finger on the ball whose torques cost nothing [N] (default 0).
        shrinkage: how much thinner plans find fingers and ball [m] (default 0).
        rescued: whether a tick whose plan is rejected starts again from rollouts and random splines (default False).
    """

    name: str
    opened: Angles
    nominal: Angles
    closing: bool
    gravity: float
    grip: float
    stops: bool
    spread: float
    end: tuple[float, float, float, float]
    smoothing: tuple[tuple[float, float], ...]
    reach: tuple[float, float]
    squeeze: float = 0.0
    shrinkage: float = 0.0
    rescued: bool = False

    __repr__ = short_repr


def turning(task: BallTurn, settings: Mapping[str, Any]) -> SuiteTask:
    """Controller, plant and criterion of a ball to turn.

    Args:
        task: hand, ball and costs.
        settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    own = mechanism(1.0, task.opened, task.gravity)
    planned = mechanism(task.grip, task.opened, task.gravity, servos=True, stops=task.stops)
    sim = Simulator(planned, time_step=_KNOT, kappa=_KAPPA)
    start = sim.neutral()
    goal = start.copy()
    goal[:JOINTS] = np.concatenate(list(task.nominal.values()))
    goal[_QUATERNION] = 0.5**0.5 * np.array([1.0, 0.0, 0.0, -1.0])
    running, end = _weights(_FINGERS, _BALL, _FINGER_RATES, _BALL_RATES), _weights(*task.end)
    grip = squeezing(own, sim.neutral()[: sim.nq], task.squeeze)
    effort = servo_effort(sim, own, _KNOT * _EFFORT, _HORIZON, grip)
    cost = [quadratic(goal, _KNOT, _HORIZON, running, end), effort]
    guess = STIFFNESS * (goal if task.closing else start)[:JOINTS]
    problem = Problem(sim, start, _HORIZON, cost=cost, controls0=guess)
    given = timed(_RATE) | {"servo": own, "gain_scale": 0.0}
    given |= {"options": replace(OPTIONS, backtracking=_BACKTRACKING)}
    given |= {"shrinkage": task.shrinkage, "rescue": Rescue(iterations=_WORK) if task.rescued else None}
    given |= {"kappa": _KAPPA, "first": Options(stages=tuple(Stage(*pair) for pair in task.smoothing))}
    mpc = MPC(problem, **{**given, **settings})
    model = Simulator(own, time_step=1e-3, kappa=1e-8)
    spread = np.concatenate([np.full(JOINTS, task.spread), np.full(3, 1e-3), np.full(3, 0.1), np.full(22, 0.02)])
    judge = _Turned(goal[_QUATERNION], task.reach)
    return SuiteTask(task.name, mpc, model, start, _DURATION, spread, judge, _RATE, lost=judge.lost)


def squeezing(hand: Mechanism, q: Vector, force: float) -> Vector:
    """Torques by which each finger presses on the ball: the sphere of the finger that is nearest to it, normally.

    Args:
        hand: hand and ball.
        q: (23,) coordinates.
        force: force of each finger [N].

    Returns:
        (16,) torques [N m].
    """
    out, step = np.zeros(JOINTS), 1e-6
    for first in range(0, JOINTS, 4):
        joints = range(first, first + 4)
        links = [hand.joints[j].child for j in joints]
        own = [c for c in hand.collisions if c.b in links]
        nearest = min(own, key=lambda c: _apart(hand, c, q))
        for j in joints:
            change = np.zeros(len(q))
            change[j] = step
            out[j] = -force * (_apart(hand, nearest, q + change) - _apart(hand, nearest, q - change)) / (2.0 * step)
    return out


def _apart(hand: Mechanism, collision: Collision, q: Vector) -> float:
    """Distance of two balls [m]."""
    at = body_poses(hand.joints, q)
    a, b = collision.shape_a, collision.shape_b
    assert isinstance(a, Sphere) and isinstance(b, Sphere) and collision.b is not None
    between = at[collision.a].at(np.asarray(a.center)) - at[collision.b].at(np.asarray(b.center))
    return float(np.linalg.norm(between)) - a.radius - b.radius


def _weights(fingers: float, ball: float, finger_rates: float, ball_rates: float) -> tuple[Vector, Vector]:
    """Weights (22,) of places and of velocities: squares of four numbers are a quarter of those of a rotation."""
    places = np.concatenate([np.full(JOINTS, fingers), np.full(3, ball), np.full(3, 0.25 * ball)])
    return places, np.concatenate([np.full(JOINTS, finger_rates), np.full(6, ball_rates)])


class _Turned:
    """Whether the ball ends as `goal` (4,) and is never dropped."""

    def __init__(self, goal: Vector, reach: tuple[float, float]) -> None:
        self._goal, self._reach = goal, reach

    def lost(self, x: Vector) -> bool:
        """Whether the fingers do not reach the ball of a state (nx,) any more."""
        return not self._reach[0] < x[_HEIGHT] < self._reach[1]

    def __call__(self, loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
        off = 2.0 * float(np.arccos(min(1.0, abs(float(loop.x[-1, _QUATERNION] @ self._goal)))))
        low, high = float(loop.x[:, _HEIGHT].min()), float(loop.x[:, _HEIGHT].max())
        kept = self._reach[0] < low and high < self._reach[1]
        return off < _ANGLE and kept, {
            "angle off [deg]": float(np.degrees(off)),
            "lowest [m]": low,
            "highest [m]": high,
        }
