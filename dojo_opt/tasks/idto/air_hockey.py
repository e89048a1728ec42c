"""A disc pushes another one to a place and a heading, by contact and friction at its rim."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.cost import Clearance, Effort
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.moving_reference import SampledReference
from dojo_opt.mpc.settings import OPTIONS
from dojo_opt.planning.options import Options, Stage
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

__all__ = ["air_hockey"]

_KNOT, _HORIZON, _RATE = 0.05, 40, 200.0  # [s], knots, [Hz]
_PUCK = slice(3, 6)  # its coordinates in a state
_NEAR = 0.1  # [m] off the goal at the end
_KAPPA = 3e-5  # [N s m] at 1e-4 a contact that acts at a distance leaves the puck 9 cm off
# [N s m] of derivatives at the end of the horizon: at _KAPPA a pusher beside its puck has next to none; with 3e-4 at
# all knots, or 1e-3 at the end, the puck ends further away from some starts
_KAPPA_GRAD, _BLOCKS = 3e-4, 4
_TOUCH = 0.02  # [1/m^2] of the distance of the discs: with .2 the pusher stays at the puck on the wrong side of it
_FRICTION = 0.3  # assumed by plans: with all of 1 they turn the puck by its rim, lose it, and end 20 cm off
_MASS, _RADIUS, _HEIGHT = 0.1, 0.1, 0.05  # [kg], [m], [m] of either disc
_DISC = Sphere(_RADIUS)
_START, _GOAL = (0.0, 0.5, 0.0), (0.3, 1.0, 1.0)  # [m, m, rad] of the puck


def mechanism(friction: float) -> Mechanism:
    """Pusher and puck in the plane z = 0, where gravity does no work.

        q  (6,) x, y [m] and heading [rad] of the pusher, and of the puck

    Args:
        friction: coefficient of friction of their rims.

    Returns:
        The mechanism.
    """
    across = _MASS * (3.0 * _RADIUS**2 + _HEIGHT**2) / 12.0
    inertia = np.diag([across, across, 0.5 * _MASS * _RADIUS**2])
    joints = [Joint("planar_axis", None, "pusher"), Joint("planar_axis", None, "puck", damper=0.1)]
    rims = Collision("pusher", "puck", _DISC, _DISC, friction=friction, name="rims")
    return Mechanism(
        [Body("pusher", _MASS, inertia), Body("puck", _MASS, inertia)],
        joints,
        [],
        [Input("pusher", dof=dof, name=name) for dof, name in enumerate(("x", "y", "heading"))],
        collisions=[rims],
        name="air_hockey",
        neutral={"puck": _START},
    )


def air_hockey(**settings: Any) -> SuiteTask:
    """Push a puck by .3 and .5 m, and turn it by 1 rad, within 2 s: 40 knots of 50 ms at 200 Hz.

    A run of 4 s is a success when the puck ends within .1 m of its goal. Its heading hardly changes: friction at the
    rim would have to give .1 N m s against the damper, and a push of 1 N s with it, a hundred times that of the way.
    The publication plans once, and plays the plan; with hard contact a played plan loses the puck, so it is a closed
    loop here, at a rate of ours. The squared distance of the discs weighs .02 per m^2; without it, a pusher that has
    lost the puck waits where it is. The smoothing of the derivatives grows tenfold along the horizon: near its end they
    see a puck across a gap of centimetres.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(1.0), time_step=_KNOT, kappa=_KAPPA)
    start = sim.neutral()
    goal = start.copy()
    goal[_PUCK] = _GOAL
    ends = np.array([0.0, _KNOT * _HORIZON])
    speed = (goal - start)[: sim.nq] / ends[1]
    begin = np.concatenate([start[: sim.nq], speed])
    target = SampledReference([*ends, ends[1] + _KNOT], [begin, np.concatenate([goal[: sim.nq], speed]), goal], sim)
    pusher, puck = np.zeros(3), np.ones(3)
    running = np.concatenate([pusher, 0.1 * puck]), np.concatenate([pusher + 0.5, 0.1 * puck])
    end = np.concatenate([pusher, 10.0 * puck]), np.ones(6)
    cost = [
        quadratic(begin, _KNOT, _HORIZON, running, end),
        Effort(_KNOT * 0.1),
        Clearance("pusher", "puck", target=0.0, shape_a=_DISC, shape_b=_DISC, weight=_TOUCH),
    ]
    problem = Problem(sim, start, _HORIZON, cost=cost)
    given = timed(_RATE) | {"kappa": _KAPPA, "kappa_grad": _KAPPA_GRAD, "friction": _FRICTION}
    given |= {"options": replace(OPTIONS, kappa_blocks=_BLOCKS)}
    given |= {"first": Options(stages=(Stage(1e-2, 1e-2), Stage(_KAPPA, _KAPPA)))}
    mpc = MPC(problem, reference=target, **{**given, **settings})
    model = Simulator(mechanism(1.0), time_step=1e-3, kappa=1e-8)
    spread = np.array([0.05, 0.05, 0.1, 0.05, 0.05, 0.1] + [0.05] * 6)
    return SuiteTask("idto.air_hockey", mpc, model, start, 4.0, spread, _judge, _RATE)


def _judge(loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    off = loop.x[-1, _PUCK] - np.asarray(_GOAL)
    place, turn = float(np.hypot(*off[:2])), abs(float(off[2]))
    return place < _NEAR, {"off [mm]": 1e3 * place, "turned off [rad]": turn}
