"""A cart shifts its cargo by sliding out from below it."""

from __future__ import annotations

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.plan_task import PlanTask, continuation
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

__all__ = ["transport"]

_KNOT, _HORIZON = 0.02, 200  # [s], knots
_KAPPAS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)  # [N s m]
_NEAR = 0.05  # [m, m/s] of the goal
_CART, _CARGO, _FRICTION = 2.0, 1.0, 0.2  # [kg], [kg]
_G = 9.81  # [m/s^2]
_REACH = 1.0  # [m] between the centres of cart and cargo, at most


def mechanism() -> Mechanism:
    """A cart on a rail along x, and the cargo, which slides on it with dry friction, up to its ends.

        q  (2,) position of the cart, and of the cargo from it [m]

    Returns:
        The mechanism.
    """
    x = (1.0, 0.0, 0.0)
    joints = [
        Joint("prismatic", None, "cart", axis=x),
        Joint("prismatic", "cart", "cargo", axis=x, limits=(-_REACH, _REACH), friction=_FRICTION * _CARGO * _G),
    ]
    bodies = [Body("cart", _CART, np.eye(3)), Body("cargo", _CARGO, np.eye(3))]
    return Mechanism(bodies, joints, [], [Input("cart")], gravity=(0.0, 0.0, -_G), name="crisp_transport")


def transport() -> PlanTask:
    """Shift the cargo from .5 m ahead of the centre of its cart to .5 m behind it in 4 s: 200 knots of 20 ms.

    Both begin at -4 m/s, the cart at x = 3 m, and end at -2 m/s, the cart at 0. Only the end has a cost, 1e5 of squares
    of positions and 10 of velocities, and the force 1e-4. A plan is a success when positions and velocities end
    within .05 of the goal. The cargo is weighed by its place on the cart, where the publication takes that in the
    world, and its friction, no variable here, has no cost.

    Returns:
        The task.
    """
    sim = Simulator(mechanism(), time_step=_KNOT, kappa=_KAPPAS[-1])
    goal = np.array([0.0, -0.5, -2.0, 0.0])
    cost = [Tracking(goal, [1e5, 1e5, 10.0, 10.0], knots=[_HORIZON]), Effort(1e-4)]
    problem = Problem(sim, np.array([3.0, 0.5, -4.0, 0.0]), _HORIZON, cost=cost)

    def judge(plan: Plan) -> tuple[bool, dict[str, float]]:
        off = float(np.abs(plan.x[-1] - goal).max())
        return off < _NEAR, {"off [m, m/s]": off}

    return PlanTask("crisp.transport", problem, continuation(_KAPPAS), judge)
