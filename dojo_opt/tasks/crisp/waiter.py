"""A pusher below the overhang of a plate draws it off its table."""

from __future__ import annotations

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.plan_task import PlanTask, continuation
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Sphere
from sim.simulator.simulator import Simulator

__all__ = ["waiter"]

_KNOT, _HORIZON = 0.05, 100  # [s], knots
_KAPPAS = (1e-1, 3e-3, 1e-4, 1e-6)  # [N s m]
_PLATE, _PUSHER = 2.0, 1.0  # [kg]
_G = 9.81  # [m/s^2]
_HALF, _THICK = 7.0, 0.1  # [m] half of the length of the plate
_TABLE_FRICTION, _TIP_FRICTION = 0.1, 1.0
_TIP, _EDGE = 0.05, 0.02  # [m] radii of the pusher and of the edge of the table
_BEGIN, _END, _SPEED = -6.0, 0.1, 2.0  # [m], [m], [m/s]
_NEAR, _FAST = 0.15, 0.1  # [m], [m/s] of the goal


def mechanism() -> Mechanism:
    """A plate on a table that ends at x = 0, and a pusher below the part of it that hangs over.

    The plate touches the table with its left end and at the table's edge.

        q  (5,) position x, z [m] and pitch of the plate, position x, z of the pusher, which touches it at z = 0
        u  (2,) forces on the pusher along x and z [N]; its weight is carried

    Returns:
        The mechanism.
    """
    across = (0.0, 1.0, 0.0)
    length = 2.0 * _HALF
    turn = np.diag([1.0 + _THICK**2, length**2 + _THICK**2, length**2 + 1.0]) / 12.0
    bodies = [Body("plate", _PLATE, _PLATE * turn), Body("pusher", _PUSHER, 1e-3 * np.eye(3), gravity_compensation=1.0)]
    beyond = [(_END, np.inf), None]
    joints = [
        Joint("planar_axis", None, "plate", axis=across, parent_point=(0.0, 0.0, 0.5 * _THICK)),
        Joint("planar", None, "pusher", axis=across, parent_point=(0.0, 0.0, -_TIP), limits=beyond),
    ]
    board = Box(length, 1.0, _THICK)
    edge = Sphere(_EDGE, center=(0.0, 0.0, -_EDGE))
    touching = [
        Collision("plate", None, board, edge, friction=_TABLE_FRICTION, name="edge"),
        Collision("pusher", "plate", Sphere(_TIP), board, friction=_TIP_FRICTION, name="tip"),
    ]
    end = Contact("plate", (-_HALF, 0.0, -0.5 * _THICK), 0.0, friction=_TABLE_FRICTION, name="end")
    lift = Input("pusher", dof=1, name="lift", limits=(0.0, 0.5 * _PLATE * _G))
    inputs = [Input("pusher", dof=0, name="push"), lift]
    return Mechanism(bodies, joints, [end], inputs, collisions=touching, gravity=(0.0, 0.0, -_G), name="crisp_waiter")


def waiter() -> PlanTask:
    """Draw a plate by 6.1 m in 5 s, so that its centre and the pusher leave the table at 2 m/s: 100 knots of 50 ms.

    The pusher presses from below, and takes the plate along by friction; pressing also takes load off the table. It
    stays beyond the table, and returns for the end. Only the end has a cost, 100 of squares of places and speeds along
    x, and forces 1e-4. A plan is a success when both end within .15 m and .1 m/s of x = .1 m and 2 m/s.

    Here the plate may lift off and tip, and the pusher may leave it, where the publication only balances forces and
    bounds the pressing force so that the plate does not tip. Half of the plate's weight, at which it never tips, bounds
    the force that lifts the pusher, which is weighed in place of the pressing force. The pusher cannot have 2 m/s at
    the limit of its place: it gets them within the last knot, which takes it .1 m.

    Returns:
        The task.
    """
    sim = Simulator(mechanism(), time_step=_KNOT, kappa=_KAPPAS[-1])
    start, goal = sim.neutral(), sim.neutral()
    start[[0, 3]] = _BEGIN, _END
    goal[[0, 3, 5, 8]] = _END, _END, _SPEED, _SPEED
    weight = np.zeros(sim.ndx)
    weight[[0, 3, 5, 8]] = 100.0
    cost = [Tracking(goal, weight, knots=[_HORIZON]), Effort(1e-4)]
    problem = Problem(sim, start, _HORIZON, cost=cost)
    return PlanTask("crisp.waiter", problem, continuation(_KAPPAS), _judge)


def _judge(plan: Plan) -> tuple[bool, dict[str, float]]:
    place = float(np.abs(plan.x[-1, [0, 3]] - _END).max())
    speed = float(np.abs(plan.x[-1, [5, 8]] - _SPEED).max())
    return place < _NEAR and speed < _FAST, {"off [mm]": 1e3 * place, "off [m/s]": speed}
