"""The acrobot swings up and balances."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.cost import Effort
from dojo_opt.mpc.controller import MPC
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.suite import SuiteTask, held, quadratic, timed
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

__all__ = ["acrobot"]

_KNOT, _HORIZON, _RATE = 0.05, 40, 300.0  # [s], knots, [Hz]
_NEAR, _HELD = 0.05, 1.0  # [rad], [s]
_THIN = 5e-7  # [kg m^2] about the axes of the links


def mechanism() -> Mechanism:
    """Two links that hang on hinges about y, of 1 m and 2 m.

    Returns:
        The mechanism.
    """
    bodies = [Body("upper", 1.0, np.diag([0.083, 0.083, _THIN])), Body("lower", 1.0, np.diag([0.33, 0.33, _THIN]))]
    y = (0.0, 1.0, 0.0)
    joints = [
        Joint("revolute", None, "upper", child_point=(0.0, 0.0, 0.5), axis=y, damper=0.1),
        Joint(
            "revolute",
            "upper",
            "lower",
            parent_point=(0.0, 0.15, -0.5),
            child_point=(0.0, 0.0, 1.0),
            axis=y,
            damper=0.1,
        ),
    ]
    return Mechanism(bodies, joints, [], [Input("lower", name="elbow")], name="acrobot")


def acrobot(**settings: Any) -> SuiteTask:
    """Swing up from hanging and balance, driven at the elbow: 40 knots of 50 ms at 300 Hz.

    A run of 5 s is a success when both angles stay within .05 rad of upright for 1 s.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(), time_step=_KNOT, kappa=1e-4)
    goal = np.array([3.1415, 0.0, 0.0, 0.0])
    cost = [quadratic(goal, _KNOT, _HORIZON, ([1.0, 1.0], 1.0), ([100.0, 100.0], 1.0)), Effort(_KNOT * 0.1)]
    problem = Problem(sim, np.zeros(4), _HORIZON, cost=cost)
    given = timed(_RATE) | {"servo": (100.0, 10.0)}
    mpc = MPC(problem, **{**given, **settings})
    model = Simulator(mechanism(), time_step=1e-3)
    spread = np.array([0.1, 0.1, 0.1, 0.1])
    return SuiteTask("idto.acrobot", mpc, model, np.zeros(4), 5.0, spread, _judge, _RATE)


def _judge(loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    off = np.abs(loop.x[:, :2] - (np.pi, 0.0)).max(axis=1)
    time = held(loop, off < _NEAR)
    return time >= _HELD, {"upright [s]": time, "last error [rad]": float(off[-1])}
