"""Reposing: the task to bring an object to a pose, with what the hands of the publication have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from dojo_opt.cost import Spec
from dojo_opt.mpc.controller import MPC
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.jin.placing import Placing
from dojo_opt.tasks.jin.trial import Trial
from dojo_opt.tasks.suite import SuiteTask, quadratic
from sim.mechanism.mechanism import Mechanism
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Vector

__all__ = ["HORIZON", "Aim", "reposing"]

HORIZON = 10  # knots
_KNOT, _RATE, _STEP = 0.04, 50.0, 2e-3  # [s], [Hz], [s] of the plant
_KAPPA = 1e-6  # [N s m]
# friction that plans assume, .9 in the plant (.5 with the stick): with all of .9, grasps slip in MuJoCo's plant; with
# the .5 of the publication, tips that plans expect to slide wedge objects in ours
_FRICTION = 0.7
_FAR = 0.5  # [m] from the middle of the table
# of the squares of place, rotation vector, velocity and angular velocity: those of the publication, of which the second
# is a quarter of 50, as the rotation vector is twice the vector of the quaternion, and two small ones
_END, _RUNNING = (5000.0, 12.5, 10.0, 0.02), (0.0, 0.0, 1e-3, 1e-3)


class Aim(NamedTuple):
    """When an object has reached its pose.

    Attributes:
        near: largest distance [m].
        turned: largest squared sine of half the angle.
        period: period of the publication's controller, for 20 of which the object has to stay [s].
        budget: length of a run [s].
    """

    near: float
    turned: float
    period: float
    budget: float


def reposing(
    name: str,
    trial: Trial,
    damped: Mechanism,
    own: Mechanism,
    terms: Sequence[Spec],
    aim: Aim,
    settings: Mapping[str, Any],
) -> SuiteTask:
    """Controller, plant and criterion of an object to be brought to a pose.

    Args:
        name: name of the task.
        trial: where the object starts and where it has to go.
        damped: model of the controller, whose first seven coordinates are the pose of the object, and whose joints have
            dampers.
        own: the same without dampers, for the plant.
        terms: costs of grasp and inputs.
        aim: criterion of success.
        settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(damped, time_step=_KNOT, kappa=_KAPPA)
    start = sim.neutral()
    start[BaseState.POSE] = trial.start
    goal = start.copy()
    goal[BaseState.POSE] = trial.goal
    free = np.zeros(sim.nv - 6)
    running, end = (
        tuple(np.concatenate([np.repeat(pair, 3), free]) for pair in (row[:2], row[2:])) for row in (_RUNNING, _END)
    )
    problem = Problem(sim, start, HORIZON, cost=[quadratic(goal, 1.0, HORIZON, running, end), *terms])
    given: dict[str, Any] = {"period": 1.0 / _RATE, "iterations": 2, "servo": own, "gain_scale": 0.0}
    given |= {"kappa": _KAPPA, "friction": _FRICTION, "patience": 3}
    given |= {"first": Options(stages=(Stage(_KAPPA, _KAPPA),), max_iterations=20)}
    placing = Placing(slice(0, 7), trial.goal, aim.near, aim.turned, aim.period)
    return SuiteTask(
        name=name,
        mpc=MPC(problem, **{**given, **settings}),
        model=Simulator(own, time_step=_STEP, kappa=1e-8),
        start=start,
        duration=aim.budget,
        spread=np.concatenate([[5e-3, 5e-3, 0.0, 0.0, 0.0, 0.1], np.zeros(2 * sim.nv - 6)]),
        judge=placing,
        rate=_RATE,
        lost=_lost,
        finished=placing.finished,
    )


def _lost(x: Vector) -> bool:
    """Whether the object has been thrown away."""
    return bool(np.abs(x[:3]).max() > _FAR)
