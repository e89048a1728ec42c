"""A box on the ground, which one arm or two arms turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from dojo_opt.cost import Clearance
from dojo_opt.mpc.controller import MPC
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.idto.jaco_arm import JOINTS, KP, arms
from dojo_opt.tasks.suite import SuiteTask, held, quadratic, servo_effort, timed
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box
from sim.mechanism.short_repr import short_repr
from sim.simulator.simulator import Simulator
from solvers.types import Vector

__all__ = ["Turning", "mechanism", "turning"]

_KNOT, _RATE, _DURATION = 0.05, 20.0, 5.0  # [s], [Hz], [s]
_KAPPA = 2e-5  # [N s m]
_TOUCH = 10.0  # [1/m^2] of the distance of stub and box
_EDGE, _MASS, _MOMENT = 0.15, 0.55, 0.0020625  # [m], [kg], [kg m^2]


@dataclass(frozen=True)
class Turning:
    """A box to turn.

    Attributes:
        name: name of the task.
        sides: y [m] of the bases of the n arms by prefix of their names.
        angles: (7 n,) joints at the start [rad].
        start: (3,) centre of the box at the start [m].
        goal: (3,) centre of the box at the end [m].
        quaternion: (4,) multiple of its quaternion at the end.
        horizon: number of knots.
        iterations: iterations per tick.
        friction: coefficient that plans assume.
        effort: weight of torques [1/(N m)^2].
        velocities: running weight of velocities [s^2/rad^2, s^2/m^2].
        angles_at_the_end: weight of the joints at the last knot [1/rad^2].
        angle: largest angle off the goal [deg].
        distance: largest distance of the box from the goal [m].
        held: time for which they hold [s].
    """

    name: str
    sides: Mapping[str, float]
    angles: Sequence[float]
    start: Sequence[float]
    goal: Sequence[float]
    quaternion: Sequence[float]
    horizon: int
    iterations: int
    friction: float
    effort: float
    velocities: float
    angles_at_the_end: float
    angle: float
    distance: float
    held: float

    __repr__ = short_repr


def mechanism(task: Turning, servos: bool = False) -> Mechanism:
    """Arms, which float, and the box on the ground: its eight corners, and three spheres of each arm touch.

        q  (7 n + 7,) joints of the arms [rad], box

    Args:
        task: arms and box.
        servos: whether the joints have the servos of the controller (default False).

    Returns:
        The mechanism.
    """
    friction = 0.5
    parts = arms(task.sides, servos)
    neutral: dict[str, Any] = {joint.child: angle for joint, angle in zip(parts.joints, task.angles, strict=True)}
    neutral["box"] = (*task.start, 1.0, 0.0, 0.0, 0.0)
    half = 0.5 * _EDGE
    corners = [Contact("box", corner, friction=friction) for corner in product((-half, half), repeat=3)]
    return Mechanism(
        [*parts.bodies, Body("box", _MASS, _MOMENT * np.eye(3))],
        [*parts.joints, Joint("floating", None, "box")],
        [*corners, *parts.grounded(friction)],
        parts.inputs,
        collisions=parts.touching("box", Box(_EDGE, _EDGE, _EDGE), friction),
        name=task.name,
        neutral=neutral,
    )


def turning(task: Turning, settings: Mapping[str, Any]) -> SuiteTask:
    """Controller, plant and criterion of a box to turn.

    Args:
        task: arms, box and costs.
        settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(task, servos=True), time_step=_KNOT, kappa=_KAPPA)
    own = mechanism(task)
    start, n = sim.neutral(), len(task.angles)
    goal = start.copy()
    goal[n : n + 3] = task.goal
    goal[n + 3 : n + 7] = np.asarray(task.quaternion) / np.linalg.norm(task.quaternion)
    box = np.concatenate([np.full(3, 10.0), np.full(3, 2.5)])  # of four numbers of a quaternion, a quarter
    running = np.concatenate([np.zeros(n), box]), np.full(n + 6, task.velocities)
    end = np.concatenate([np.full(n, task.angles_at_the_end), box]), np.ones(n + 6)
    cost = [
        quadratic(goal, _KNOT, task.horizon, running, end),
        servo_effort(sim, own, _KNOT * task.effort, task.horizon),
    ]
    for touch in own.collisions[2::3]:  # of the stubs
        cost.append(Clearance("box", touch.b, target=0.0, shape_a=touch.shape_a, shape_b=touch.shape_b, weight=_TOUCH))
    rest = np.tile(KP, n // JOINTS) * start[:n]
    problem = Problem(sim, start, task.horizon, cost=cost, controls0=rest)
    given = timed(_RATE) | {"iterations": task.iterations, "servo": own, "gain_scale": 0.0}
    given |= {"kappa": _KAPPA, "friction": task.friction, "first": Options(stages=(Stage(_KAPPA, _KAPPA),))}
    mpc = MPC(problem, **{**given, **settings})
    model = Simulator(own, time_step=1e-3, kappa=1e-8)
    spread = np.concatenate([np.full(n, 0.02), [0.01, 0.01, 0.0, 0.0, 0.0, 0.1], np.full(n, 0.02), np.zeros(6)])
    judge = _Boxed(goal[n : n + 7], task)
    return SuiteTask(task.name, mpc, model, start, _DURATION, spread, judge, _RATE, rise=n + 2)


class _Boxed:
    """Whether the box stays close to `goal` (7,), place and quaternion."""

    def __init__(self, goal: Vector, task: Turning) -> None:
        self._goal, self._task = goal, task

    def __call__(self, loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
        task = self._task
        box = loop.x[:, len(task.angles) : len(task.angles) + 7]
        angle = np.degrees(2.0 * np.arccos(np.minimum(1.0, np.abs(box[:, 3:] @ self._goal[3:]))))
        off = np.linalg.norm(box[:, :3] - self._goal[:3], axis=1)
        time = held(loop, (angle < task.angle) & (off < task.distance))
        measures = {"at the goal [s]": time, "angle off [deg]": float(angle[-1]), "off [mm]": 1e3 * float(off[-1])}
        return time >= task.held, measures
