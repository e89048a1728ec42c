"""A planar hopper with a knee and an ankle moves half a metre forward."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.moving_reference import Onward
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.suite import SuiteTask, lifted, quadratic, servo_effort, timed
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

__all__ = ["hopper"]

_KNOT, _HORIZON, _RATE = 0.05, 40, 100.0  # [s], knots, [Hz]
_PLACE, _PITCH = 0.05, 0.2  # [m], [rad] off the goal
_SERVO = 100.0, 5.0  # [N m/rad], [N m s/rad]
_RADIUS = 0.03  # [m] of toe and heel


def mechanism(friction: float, servos: bool = False) -> Mechanism:
    """Torso, leg and foot in the plane y = 0.

        q  (5,) position x, z of the torso [m], pitch, knee and ankle [rad], which turn the foot's toe up

    Args:
        friction: coefficient of friction of toe and heel.
        servos: whether its joints have the servos of the controller (default False).

    Returns:
        The mechanism, at angles of .3, -.5, .2 rad with its foot level.
    """
    bodies = [
        Body("torso", 1.0, 0.013 * np.eye(3)),
        Body("leg", 0.2, 0.01 * np.eye(3)),
        Body("foot", 0.1, 0.005 * np.eye(3)),
    ]
    across = (0.0, -1.0, 0.0)
    hip, knee = (0.0, 0.0, -0.2), (0.0, 0.0, 0.2)
    hinge: dict[str, Any] = {"axis": across}
    if servos:
        hinge |= {"spring": _SERVO[0], "damper": _SERVO[1]}
    joints = [
        Joint("planar_axis", None, "torso", axis=across),
        Joint("revolute", "torso", "leg", parent_point=hip, child_point=knee, **hinge),
        Joint("revolute", "leg", "foot", parent_point=(0.0, 0.0, -0.2), child_point=(-0.05, 0.0, 0.0), **hinge),
    ]
    balls = [
        Contact("foot", (0.1, 0.0, 0.0), _RADIUS, friction=friction, name="toe"),
        Contact("foot", (-0.1, 0.0, 0.0), _RADIUS, friction=friction, name="heel"),
    ]
    neutral: dict[str, Any] = {"torso": (0.0, 0.61, 0.3), "leg": -0.5, "foot": 0.2}
    inputs = [Input("leg", name="knee"), Input("foot", name="ankle")]
    return Mechanism(bodies, joints, balls, inputs, name="hopper", neutral=neutral)


def hopper(**settings: Any) -> SuiteTask:
    """Move half a metre along x and stay there: 40 knots of 50 ms at 100 Hz.

    The nominal motion of every plan begins at x = 0 and ends at .5 m after 2 s, wherever the robot is by then, as in
    the publication. A run of 5 s is a success when the torso ends within 50 mm of x = .5 m with its pitch within .2 rad
    of .3. The foot starts on the ground; in the publication it starts 3.1 mm inside it.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(1.0, servos=True), time_step=_KNOT, kappa=1e-4)
    own = mechanism(2.0 / 3.0)
    begin = sim.neutral()
    start = lifted(sim, begin, 1)
    goal = begin.copy()
    goal[0] = 0.5
    begin[sim.nq] = goal[sim.nq] = 0.5 / (_KNOT * _HORIZON)
    target = Onward(sim, begin, goal, _KNOT * _HORIZON)
    cost = [
        quadratic(begin, _KNOT, _HORIZON, (np.ones(5), 0.1), (10.0 * np.ones(5), 1.0)),
        servo_effort(sim, own, _KNOT * 0.1, _HORIZON),
    ]
    problem = Problem(sim, start, _HORIZON, cost=cost, controls0=equilibrium(sim, start)[1])
    given = timed(_RATE) | {"servo": own, "gain_scale": 0.0}
    given |= {"kappa": 1e-3, "first": Options(stages=(Stage(1e-3, 1e-3),))}
    mpc = MPC(problem, reference=target, **{**given, **settings})
    model = Simulator(own, time_step=1e-3, kappa=1e-8)
    spread = np.array([0.1, 0.02, 0.1, 0.1, 0.1] + [0.1] * 5)
    return SuiteTask("idto.hopper", mpc, model, start, 5.0, spread, _judge, _RATE, rise=1)


def _judge(loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    x, pitch = float(loop.x[-1, 0]), float(loop.x[-1, 2])
    return abs(x - 0.5) < _PLACE and abs(pitch - 0.3) < _PITCH, {"x [m]": x, "pitch [rad]": pitch}
