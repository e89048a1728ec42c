"""A planar hopper with a knee and an ankle hops half a metre forward."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.cost import Slip
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.mpc.controller import MPC
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
from solvers.types import Matrix, Vector

__all__ = ["hopper"]

_KNOT, _HORIZON, _RATE = 0.025, 20, 100.0  # [s], knots, [Hz]
_AWAY, _LEAD = 0.5, 0.3  # [m] to the goal, of the nominal pose from the robot
_KAPPA = 3e-4  # [N s m]
_POSE = np.array([30.0, 3.0, 0.3, 0.1, 0.1])  # [1/m^2, 1/rad^2]
_RATES, _END = 0.1, 30.0  # [1/(m/s)^2, 1/(rad/s)^2], times the weights of the pose
_TORQUE = 1e-3  # [1/(N m)^2]
_SLIP, _NEAR = 10.0, 0.01  # [1/(m/s)^2], [m]
_FRICTION = 0.4  # assumed by plans, against slip on the .67 of the plant
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


class _Goal:
    """A pose at the goal, at most `_LEAD` ahead of where the robot is measured."""

    def __init__(self, pose: Vector, goal: float) -> None:
        self._pose, self._goal, self._ahead = pose, goal, pose[0]

    def anchor(self, time: float, x: Vector) -> None:
        """Move on; x: (nx,) state at the beginning of the horizon."""
        del time
        self._ahead = x[0] + np.clip(self._goal - x[0], -_LEAD, _LEAD)

    def __call__(self, times: ArrayLike) -> Matrix:
        """(n, nx) states at times (n,) [s], all the same."""
        states = np.tile(self._pose, (np.size(times), 1))
        states[:, 0] = self._ahead
        return states


def hopper(**settings: Any) -> SuiteTask:
    """Hop half a metre along x and stay there: 20 knots of 25 ms at 100 Hz.

    A run of 5 s is a success when the torso ends within 50 mm of x = .5 m with its pitch within .2 rad of .3. The foot
    starts on the ground; in the publication it starts 3.1 mm inside it.

    With hard contact the cost of the publication is least for a robot that leans forward and stands: a hop takes it
    more torque than half a metre is worth. Costs differ therefore. Squares of torques weigh a hundredth of the .1
    there, joint angles .1, pitch .3, height 3 and place 30 instead of 1, at the end thirty times as much, and the slip
    of toe and heel 10. The horizon is 20 knots of 25 ms, where the publication has 40 of 50: with longer ones the robot
    folds forward more often than it hops. The nominal pose is that of the goal, at most .3 m ahead of the robot,
    where the publication has a ramp from x = 0 that restarts with every plan. Plans assume a friction of .4.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(1.0, servos=True), time_step=_KNOT, kappa=_KAPPA)
    own = mechanism(2.0 / 3.0)
    pose = sim.neutral()
    start = lifted(sim, pose, 1)
    cost = [
        quadratic(pose, _KNOT, _HORIZON, (_POSE, _RATES), (_END * _POSE, _RATES)),
        servo_effort(sim, own, _KNOT * _TORQUE, _HORIZON),
        Slip(weight=_KNOT * _SLIP, near=_NEAR),
    ]
    problem = Problem(sim, start, _HORIZON, cost=cost, controls0=equilibrium(sim, start)[1])
    given = timed(_RATE) | {"servo": own, "gain_scale": 0.0, "friction": _FRICTION}
    given |= {"kappa": _KAPPA, "first": Options(stages=(Stage(_KAPPA, _KAPPA),))}
    mpc = MPC(problem, reference={0: _Goal(pose, _AWAY)}, **{**given, **settings})
    model = Simulator(own, time_step=1e-3, kappa=1e-8)
    spread = np.array([0.1, 0.02, 0.1, 0.1, 0.1] + [0.1] * 5)
    return SuiteTask("idto.hopper", mpc, model, start, 5.0, spread, _judge, _RATE, rise=1)


def _judge(loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    x, pitch = float(loop.x[-1, 0]), float(loop.x[-1, 2])
    return abs(x - _AWAY) < _PLACE and abs(pitch - 0.3) < _PITCH, {"x [m]": x, "pitch [rad]": pitch}
