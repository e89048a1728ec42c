"""A point mass on a telescopic leg falls, hops two metres forward, and stands."""

from __future__ import annotations

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.plan_task import PlanTask, continuation
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

__all__ = ["hopper"]

_KNOT, _HORIZON = 0.02, 200  # [s], knots
_KAPPAS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)  # [N s m]
_MASS, _LEG, _FOOT = 1.0, 0.02, 0.05  # [kg]
_LEG_TURN, _FOOT_TURN = 1e-3, 1e-4  # [kg m^2]
_LENGTH, _RETRACTION = 1.0, 0.8  # [m]
_FAR, _HIGH = 2.0, 1.5  # [m]
_POSE, _RATES = 0.01, 1e-3  # [1/rad^2, 1/m^2], [1/(rad/s)^2, 1/(m/s)^2] of the leg in every knot
_NEAR = 0.05  # [m, rad, m/s, rad/s] of the goal


def mechanism() -> Mechanism:
    """A mass that moves in the plane y = 0 and does not turn, its leg, and a foot that the leg draws in.

        q  (4,) position x, z of the mass [m], angle of the leg, which turns the foot forward [rad], retraction [m]
        u  (2,) torque of the hip [N m], force that draws the foot in, which only pushes it out [N]

    Returns:
        The mechanism.
    """
    bodies = [
        Body("mass", _MASS, 1e-3 * np.eye(3)),
        Body("leg", _LEG, _LEG_TURN * np.eye(3)),
        Body("foot", _FOOT, _FOOT_TURN * np.eye(3)),
    ]
    joints = [
        Joint("planar", None, "mass", axis=(0.0, 1.0, 0.0)),
        Joint("revolute", "mass", "leg", axis=(0.0, -1.0, 0.0)),
        Joint("prismatic", "leg", "foot", child_point=(0.0, 0.0, _LENGTH), limits=(0.0, _RETRACTION)),
    ]
    foot = Contact("foot", friction=1.0, name="foot")
    inputs = [Input("leg", name="hip"), Input("foot", name="retraction", limits=(-np.inf, 0.0))]
    return Mechanism(bodies, joints, [foot], inputs, gravity=(0.0, 0.0, -9.81), name="crisp_hopper")


def hopper() -> PlanTask:
    """Fall from 1.5 m, hop 2 m forward in 4 s, and end standing at rest: 200 knots of 20 ms.

    The end costs 100 of squares of the places and velocities of mass and foot, to first order, the torque of the hip
    .001 and the thrust 1e-5. The leg costs a little in every knot, .01 of squares of angle and retraction and .001 of
    their rates: without it, plans often end far from the goal. A plan is a success when every component of its end is
    within .05 of the goal.

    The leg of the publication has no mass: its foot is fixed in stance, where it has thrust alone, and in flight the
    input is the rate of its angle. Here leg and foot have 70 g, the foot touches the ground with a friction of 1, and
    the hip has a torque throughout, whose reaction the mass takes without turning. The ground is hard; there, the
    body is kept above it by a penalty.

    Returns:
        The task.
    """
    sim = Simulator(mechanism(), time_step=_KNOT, kappa=_KAPPAS[-1])
    start, goal = sim.neutral(), sim.neutral()
    start[1] = _HIGH
    goal[:2] = _FAR, _LENGTH
    # the foot is at (x, z) + (l - r) (sin a, -cos a): about (x + a l, z - l + r)
    both, foot = 100.0 * np.array([2.0, 2.0]), 100.0 * np.array([1.0, 1.0])
    rows = np.zeros((_HORIZON + 1, sim.ndx))
    rows[:, [2, 3]], rows[:, [6, 7]] = _POSE, _RATES
    rows[-1] = np.concatenate([both, foot, both, foot])
    problem = Problem(sim, start, _HORIZON, cost=[Tracking(goal, rows), Effort([1e-3, 1e-5])])

    def judge(plan: Plan) -> tuple[bool, dict[str, float]]:
        off = float(np.abs(plan.x[-1] - goal).max())
        return off < _NEAR, {"off [m, rad, m/s, rad/s]": off}

    return PlanTask("crisp.hopper", problem, continuation(_KAPPAS), judge)
