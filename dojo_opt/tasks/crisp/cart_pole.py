"""A cart swings its pole up between two walls."""

from __future__ import annotations

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.plan_task import PlanTask, continuation
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Sphere
from sim.simulator.simulator import Simulator

__all__ = ["cart_pole"]

_KNOT, _HORIZON = 0.02, 100  # [s], knots
_KAPPAS = (1e-3, 1e-6)  # [N s m]
_NEAR = 0.1  # [m, rad, m/s, rad/s] of the goal
_CART, _TIP, _LENGTH = 1.0, 0.1, 0.8  # [kg], [kg], [m]
_RADIUS, _THICK = 0.02, 0.1  # [m] of the tip and the walls
_SMALL = 1e-6  # [kg m^2] of the tip, a point in the publication


def mechanism() -> Mechanism:
    """A cart on a rail along x, and a mass at the end of a rod, between smooth walls that it meets at x = -1 and 1 m.

        q  (2,) position of the cart [m], angle of the pole from upright [rad]

    Returns:
        The mechanism.
    """
    wall = 1.0 + _RADIUS + 0.5 * _THICK
    walls = [
        Collision(
            "tip",
            None,
            Sphere(_RADIUS),
            Box(_THICK, 1.0, 4.0, center=(side * wall, 0.0, 0.0)),
            friction=0.0,
            name=name,
        )
        for name, side in (("left", -1.0), ("right", 1.0))
    ]
    joints = [
        Joint("prismatic", None, "cart", axis=(1.0, 0.0, 0.0)),
        Joint("revolute", "cart", "tip", child_point=(0.0, 0.0, -_LENGTH), axis=(0.0, 1.0, 0.0)),
    ]
    bodies = [Body("cart", _CART, _SMALL * np.eye(3)), Body("tip", _TIP, _SMALL * np.eye(3))]
    return Mechanism(
        bodies, joints, [], [Input("cart")], collisions=walls, gravity=(0.0, 0.0, -9.8), name="crisp_cart_pole"
    )


def cart_pole() -> PlanTask:
    """Swing a pole up and come to rest within 2 s: 100 knots of 20 ms, from a pole that hangs and turns at 2.8 rad/s.

    Only the end has a cost, 100 of every square, and forces .001. A plan is a success when every component of its end
    is within .1 of upright rest at x = 0. The walls are hard, where those of the publication have springs of 200 N/m,
    and the tip has a radius of 20 mm.

    Returns:
        The task.
    """
    sim = Simulator(mechanism(), time_step=_KNOT, kappa=_KAPPAS[-1])
    cost = [Tracking(np.zeros(4), 100.0, knots=[_HORIZON]), Effort(1e-3)]
    problem = Problem(sim, np.array([0.0, np.pi, 0.0, 2.8]), _HORIZON, cost=cost)
    return PlanTask("crisp.cart_pole", problem, continuation(_KAPPAS), _judge)


def _judge(plan: Plan) -> tuple[bool, dict[str, float]]:
    off = float(np.abs(plan.x[-1]).max())
    return off < _NEAR, {"off [m, rad, m/s, rad/s]": off}
