"""Costs of single knots: their sum is the cost of the trajectory, and each belongs to its knot."""

from __future__ import annotations

import numpy as np

import dojo_opt as dojo
from dojo_opt.planning.knot_costs import KnotCosts


def test_costs_of_the_knots_add_up_to_that_of_a_trajectory():
    sim, cost = dojo.Simulator(dojo.models.block(), time_step=0.05), dojo.cost
    rng, knots = np.random.default_rng(1), 5
    goal = sim.integrate(sim.neutral(), rng.normal(0.0, 0.5, sim.ndx))
    costs = (
        cost.Tracking(goal, rng.uniform(0.1, 1.0, sim.ndx), knots=[1, 3]),
        cost.Tracking(sim.neutral(), 2.0, knots=[-1]),
        cost.Tracking(goal, 0.1, knots=[2, 2]),
        cost.Effort(0.3),
        cost.CenterOfMass(weight=0.7),
        cost.TorqueRate(weight=0.2),
    )
    problem = dojo.Problem(sim, sim.neutral(), knots, cost=costs)
    xs = np.array([sim.integrate(sim.neutral(), rng.normal(0.0, 0.3, sim.ndx)) for _ in range(knots + 1)])
    us = rng.normal(0.0, 1.0, (knots, sim.nu))
    each = KnotCosts(problem.with_own_terms())
    parts = [each(t, xs, us) for t in range(knots + 1)]
    np.testing.assert_allclose(sum(parts), problem.cost(xs, us), rtol=1e-13)
    for t in range(knots + 1):
        moved = xs.copy()
        moved[t] = goal
        changed = [each(k, moved, us) != part for k, part in enumerate(parts)]
        assert changed == [k == t for k in range(knots + 1)]
