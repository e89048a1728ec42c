"""A hopper that stands: its simulator, problem, and random plans, for the tests of MPC."""

import numpy as np

import dojo_opt as dojo
from dojo_opt.mpc.policy import Policy

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.05)


def standing_problem(horizon=8, **kwargs):
    start = HOPPER.neutral()
    hold = np.array([0.0, 0.0, 9.81 * 4.18])
    terms = [dojo.cost.Tracking(start, 1.0), dojo.cost.Effort(1e-4, reference=hold)]
    return dojo.Problem(HOPPER, start, horizon, cost=terms, controls0=hold, **kwargs)


def random_policy(rng, T=6, time=0.3):
    x = np.array([HOPPER.integrate(HOPPER.neutral(), 0.3 * rng.standard_normal(HOPPER.ndx)) for _ in range(T + 1)])
    return Policy(HOPPER, time, x, rng.standard_normal((T, 3)), rng.standard_normal((T, 3, 14)))
