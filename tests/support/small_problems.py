"""Small problems for the tests of the planner: a linear one, a swing-up; and the gaps of a plan."""

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.options import Stage
from dojo_opt.planning.problem import Problem
from support.doubles import DoubleIntegrator, Pendulum

ONE_STAGE = (Stage(1e-4, 1e-4),)


def lqr(horizon=30, **settings):
    return Problem(DoubleIntegrator(), [1.0, 0.0], horizon, cost=[Tracking(np.zeros(2), 1.0), Effort(0.1)], **settings)


def swingup(sim=None, **settings):
    up = np.array([np.pi, 0.0])
    return Problem(sim or Pendulum(), np.zeros(2), 30, cost=[Tracking(up, 0.1), Effort(0.01)], **settings)


def gaps(problem, plan, kappa):
    """Largest mismatch between the plan and the motion of the simulator."""
    sim, worst = problem.sim, 0.0
    for t in range(problem.horizon):
        following = sim.advance(plan.x[t], plan.u[t], problem.substeps, kappa)
        worst = max(worst, np.abs(sim.difference(following, plan.x[t + 1])).max())
    return worst
