"""A finger of two links flicks a disc round."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.cost import Effort
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.moving_reference import AnchoredReference
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.suite import SuiteTask, quadratic, timed
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere
from sim.simulator.simulator import Simulator

__all__ = ["spinner"]

_KNOT, _HORIZON, _RATE = 0.05, 40, 200.0  # [s], knots, [Hz]
_SPEED = (0.8, 1.2)  # [rad/s] mean of a success
_RATE_OF_DISC = 5  # column of a state
_LAST = 3.0  # [s] of the run that count


def mechanism(friction: float) -> Mechanism:
    """Finger and disc, hinges about z. At angles of zero both links point along -y.

    Args:
        friction: coefficient of friction of fingertip and disc.

    Returns:
        The mechanism.
    """
    link = np.diag([0.0839, 0.00125, 0.0839])
    tip = Sphere(0.05, center=(0.0, -0.45, 0.0))
    bodies = [
        Body("first", 1.0, link),
        Body("second", 1.0, link),
        Body("disc", 1.0, np.diag([0.054, 0.022, 0.074])),
    ]
    half = (0.0, 0.5, 0.0)
    joints = [
        Joint("revolute", None, "first", child_point=half, damper=0.1),
        Joint("revolute", "first", "second", parent_point=(0.0, -0.5, 0.0), child_point=half, damper=0.1),
        Joint("revolute", None, "disc", parent_point=(1.5, -1.0, 0.0), damper=0.1),
    ]
    touch = Collision("second", "disc", tip, Sphere(0.25), friction=friction, name="tip")
    neutral = {"first": 0.3, "second": 1.5}
    inputs = [Input("first"), Input("second")]
    return Mechanism(bodies, joints, [], inputs, collisions=[touch], name="spinner", neutral=neutral)


def spinner(**settings: Any) -> SuiteTask:
    """Turn the disc at 1 rad/s, with the finger close to its place: 40 knots of 50 ms at 200 Hz.

    A run of 5 s is a success when the mean speed of the disc over its last 3 s is .8 to 1.2 rad/s.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(0.5), time_step=_KNOT, kappa=1e-4)
    start = sim.neutral()
    goal = start.copy()
    goal[2], goal[_RATE_OF_DISC] = 2.0, 1.0
    begin = start.copy()
    begin[_RATE_OF_DISC] = 1.0
    target = AnchoredReference(sim, begin, goal, _KNOT * _HORIZON, anchored=[2])
    cost = [
        quadratic(begin, _KNOT, _HORIZON, ([1.0, 1.0, 1.0], 0.1), ([10.0, 10.0, 10.0], 0.1)),
        Effort(_KNOT * 0.1),
    ]
    problem = Problem(sim, start, _HORIZON, cost=cost)
    given = timed(_RATE) | {"servo": (10.0, 1.0)}
    mpc = MPC(problem, reference=target, **{**given, **settings})
    model = Simulator(mechanism(1.0), time_step=1e-3, kappa=1e-8)
    spread = np.array([0.1, 0.1, np.pi, 0.1, 0.1, 0.5])
    return SuiteTask("idto.spinner", mpc, model, start, 5.0, spread, _judge, _RATE)


def _judge(loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    count = round(_LAST / loop.simulator.time_step)
    speed = float(np.mean(loop.x[-count:, _RATE_OF_DISC]))
    return _SPEED[0] <= speed <= _SPEED[1], {"mean speed [rad/s]": speed}
