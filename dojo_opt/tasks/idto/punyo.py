"""A humanoid upper body lifts a ball with its arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.mpc.controller import MPC
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from dojo_opt.tasks.suite import SuiteTask, held, quadratic, servo_effort, timed
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Capsule, Solid, Sphere
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Vector

__all__ = ["punyo"]

_KNOT, _HORIZON, _RATE, _DURATION = 0.05, 40, 15.0, 10.0  # [s], knots, [Hz], [s]
_NEAR, _HELD = 0.1, 1.0  # [m], [s]
_JOINTS = 14
_KAPPA, _SOFT = 1e-4, 1e-3  # [N s m] of all plans; of the first stage of the first one
_ASSUMED = 0.4  # friction, of plans
_BALL = slice(_JOINTS, _JOINTS + 3)  # its place in a state
_MASS, _RADIUS, _FRICTION = 1.0, 0.2, 0.5  # of the ball [kg], [m]
_START, _GOAL = (0.0, 0.4, 0.2), (0.2, 0.4, 0.8)  # [m] of the ball
_ONE = (1.0, 1.0, 1.0)  # [kg m^2] of every part, as the publication's file has it
_GLUE = 0.1  # [kg] of parts between two hinges
_PRESS = 20.0  # [N m] of each arm on the ball, twice what holds its weight
# guess of the first plan: arms close by this [rad] over 6 knots; from knot 4 on the waist rises by .6 m over 24 knots
_CLOSED, _CLOSING, _WAIT, _RISE, _RISING = 0.2, 6, 4, 0.6, 24
_ACROSS = [5, 10]  # joints of the arms that press
_ARM = (0.8, -0.1, 0.5, 0.0, 0.0)  # [rad]
_KP = np.array([900.0, *[700.0] * 3, *[500.0, 200.0, 200.0, 200.0, 200.0] * 2])  # [N/m, N m/rad]
_KD = np.array([100.0, *[70.0] * 3, *[80.0, 50.0, 50.0, 50.0, 50.0] * 2])  # [N s/m, N m s/rad]
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_UPRIGHT, _LYING = (1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.0, 0.5**0.5, 0.0)  # the second turns the axis of a capsule to x
# link, centre [m], radius [m], length [m] and quaternion of each capsule of the body; that of the neck and both of the
# head are in the frame of the torso, on which they are welded
_TRUNK = (
    ("waist", (0.0, 0.0, 0.0), 0.07, 0.16, _LYING),
    ("torso", (-0.1, 0.0, 0.06), 0.082, 0.16, _LYING),
    ("torso", (0.1, 0.0, 0.06), 0.082, 0.16, _LYING),
    ("torso", (0.0, 0.005, -0.06), 0.08, 0.175, _LYING),
    ("torso", (0.0, 0.0, 0.15), 0.045, 0.03, _UPRIGHT),
    ("torso", (0.0, 0.0, 0.35), 0.09, 0.09, _UPRIGHT),
    ("torso", (0.0, 0.0, 0.21), 0.045, 0.03, _UPRIGHT),
)


def _welded(parts: Sequence[tuple[float, float]]) -> tuple[float, tuple[float, float, float], tuple[float, ...]]:
    """Mass, centre of mass and moments of inertia of parts on the z axis, each of 1 kg m^2: (mass [kg], z [m])."""
    mass = sum(m for m, _ in parts)
    middle = sum(m * z for m, z in parts) / mass
    own = float(len(parts))
    across = own + sum(m * (z - middle) ** 2 for m, z in parts)
    return mass, (0.0, 0.0, middle), (across, across, own)


def _arm(side: str, sign: float) -> list[FileLink]:
    """The links of an arm; sign: 1 for the left one."""
    names = [f"{part} {side}" for part in ("shoulder", "arm", "elbow", "forearm", "hand")]
    shoulder, arm, elbow, forearm, hand = names
    y, zero = (0.0, sign, 0.0), (0.0, 0.0, 0.0)
    bound = (-0.5, 3.1416), (-1.5708, 0.7853), (-0.01, 2.3), (-0.01, 1.0), (-1.5, 1.5)
    return [
        FileLink(shoulder, "torso", _GLUE, zero, _ONE, pos=(0.215 * sign, 0.0, 0.07), axis=_X, limits=bound[0]),
        FileLink(arm, shoulder, 2.4, (0.0, 0.0, -0.16), _ONE, pos=(0.0, 0.0, 0.01), axis=y, limits=bound[1]),
        FileLink(elbow, arm, _GLUE, zero, _ONE, pos=(0.0, 0.0, -0.31), axis=_X, limits=bound[2]),
        FileLink(forearm, elbow, 1.4, (0.0, 0.0, -0.15), _ONE, pos=(0.0, 0.0, 0.01), axis=y, limits=bound[3]),
        FileLink(hand, forearm, 0.5, (0.0, 0.0, -0.05), _ONE, pos=(0.0, 0.0, -0.29), axis=_X, limits=bound[4]),
    ]


def links() -> list[FileLink]:
    """The links of the robot, with their stops.

    Returns:
        Waist, three parts of the torso, and five of the left and of the right arm.
    """
    waist, torso = "waist", _welded(((16.0, 0.0), (_GLUE, 0.18), (6.4, 0.35)))
    zero, up = (0.0, 0.0, 0.0), (0.0, 0.0, 0.065)
    return [
        FileLink(waist, None, 12.0, zero, _ONE, "prismatic", (0.0, 0.0, 0.2), axis=_Z, limits=(0.0, 0.6)),
        FileLink("bend", waist, _GLUE, zero, _ONE, pos=up, axis=_X, limits=(-0.3, 0.05)),
        FileLink("lean", "bend", _GLUE, zero, _ONE, axis=_Y, limits=(-0.13, 0.13)),
        FileLink("torso", "lean", *torso, pos=(0.0, 0.0, 0.135), axis=_Z, limits=(-0.6, 0.6)),
        *_arm("left", 1.0),
        *_arm("right", -1.0),
    ]


def _parts(own: Sequence[FileLink]) -> list[tuple[str, Solid]]:
    """What touches the ball: link and shape, from its centre of mass."""
    out: list[tuple[str, Solid]] = []
    for name, point, radius, length, turn in _TRUNK:
        out.append((name, Capsule(radius, length, center=from_com(own, name, point), orientation=turn)))
    for side in ("left", "right"):
        out.append((f"arm {side}", Capsule(0.045, 0.28)))
        out.append((f"forearm {side}", Capsule(0.036, 0.25)))
        out.append((f"hand {side}", Sphere(0.04)))
    return out


def mechanism(servos: bool = False) -> Mechanism:
    """The robot, whose drives carry it, and the ball on the ground, which touches all of its parts.

        q  (21,) height of the waist [m], torso about x, y and z, left arm, right arm [rad], pose of the ball

    Args:
        servos: whether it is the model of the controller: joints with servos and no stops (default False).

    Returns:
        The mechanism.
    """
    own = links()
    bodies, joints = assembled([link._replace(limits=None) for link in own] if servos else own)
    if servos:
        gains = zip(joints, _KP, _KD, strict=True)
        joints = [replace(joint, spring=float(kp), damper=float(kd)) for joint, kp, kd in gains]
    arms = dict(zip([link.name for link in own[4:]], _ARM * 2, strict=True))
    ball = Sphere(_RADIUS)
    return Mechanism(
        [
            *(replace(body, gravity_compensation=1.0) for body in bodies),
            Body("ball", _MASS, 0.4 * _MASS * _RADIUS**2 * np.eye(3)),
        ],
        [*joints, Joint("floating", None, "ball")],
        [Contact("ball", radius=_RADIUS, friction=_FRICTION)],
        [Input(link.name) for link in own],
        collisions=[
            Collision("ball", name, ball, shape, friction=_FRICTION, name=f"{name}:{k}")
            for k, (name, shape) in enumerate(_parts(own))
        ],
        name="punyo",
        neutral={**arms, "ball": (*_START, 1.0, 0.0, 0.0, 0.0)},
    )


def _guess(start: Vector) -> Matrix:
    """Inputs (_HORIZON, nu) of servos that close both arms, and then raise the waist.   start: (nx,) state."""
    knots = np.arange(_HORIZON)
    q = np.tile(start[:_JOINTS], (_HORIZON, 1))
    q[:, _ACROSS] += _CLOSED * np.clip(knots / _CLOSING, 0.0, 1.0)[:, None]
    q[:, 0] += _RISE * np.clip((knots - _WAIT) / _RISING, 0.0, 1.0)
    return np.asarray(_KP * q)


def punyo(**settings: Any) -> SuiteTask:
    """Lift a ball of 1 kg in both arms by .6 m, and move it by .2 m to the side: 40 knots of 50 ms, at 15 Hz.

    Costs are those of the publication, but that torques by which each arm presses on the ball cost nothing. So are the
    servos, which the plan knows here: arms that follow the planned angles alone would not press on the ball. The first
    plan begins with a guess that closes the arms and raises the waist, where that of the publication closes them only.
    The robot is carried by its drives, and does not touch itself or the ground. Its base is fixed, and neck and head
    are welded to the torso.

    A run of 10 s is a success when the ball stays within .1 m of its goal for 1 s.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(servos=True), time_step=_KNOT, kappa=_KAPPA)
    own = mechanism()
    start = sim.neutral()
    goal = start.copy()
    goal[_BALL] = _GOAL
    robot, turn = np.full(_JOINTS, 0.1), np.full(3, 0.25)  # of squares of four numbers of a quaternion, a quarter
    running = np.concatenate([robot, [10.0, 10.0, 20.0], turn]), np.concatenate([robot, np.ones(6)])
    end = np.concatenate([robot, [20.0, 20.0, 50.0], turn]), np.concatenate([0.1 * robot, np.ones(6)])
    press = _PRESS * np.isin(np.arange(_JOINTS), _ACROSS)
    cost = [quadratic(goal, _KNOT, _HORIZON, running, end), servo_effort(sim, own, 0.01 * _KNOT, _HORIZON, press)]
    problem = Problem(sim, start, _HORIZON, cost=cost, controls0=_guess(start))
    given = timed(_RATE) | {"servo": own, "gain_scale": 0.0, "kappa": _KAPPA, "friction": _ASSUMED, "iterations": 1}
    given["first"] = Options(stages=(Stage(_SOFT, _SOFT), Stage(_KAPPA, _KAPPA)))
    mpc = MPC(problem, **{**given, **settings})
    model = Simulator(own, time_step=1e-3, kappa=1e-8)
    angles, ball = np.concatenate([np.zeros(4), np.full(10, 0.02)]), [0.02, 0.02, 0.0, 0.1, 0.1, 0.1]
    spread = np.concatenate([angles, ball, angles, np.zeros(6)])
    return SuiteTask("idto.punyo", mpc, model, start, _DURATION, spread, _judge, _RATE, rise=_JOINTS + 2)


def _judge(loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    off = np.linalg.norm(loop.x[:, _BALL] - np.asarray(_GOAL), axis=1)
    time = held(loop, off < _NEAR)
    return time >= _HELD, {"at the goal [s]": time, "off at the end [mm]": 1e3 * float(off[-1])}
