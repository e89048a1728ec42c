"""Multi-start: one plan from several guesses."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import dojo_opt as dojo


def swing():
    """A pendulum to a height that its torque cannot hold: guesses to the left and right end in different plans."""
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
    goal = np.array([np.pi, 0.0])
    cost = [dojo.cost.Tracking(goal, [0.1, 0.01]), dojo.cost.Effort(1e-3)]
    return dojo.Problem(sim, sim.neutral(), 30, cost=cost, constraints=[dojo.constraint.Goal(goal)])


def test_the_best_of_several_starts_is_returned():
    """At least as good as the first, the same in threads as one after the other, and of the caller's problem."""
    problem = swing()
    one = dojo.ilqr(problem)
    best = dojo.ilqr(problem, starts=4, seed=1)
    with ThreadPoolExecutor(2) as pool:
        spread = dojo.ilqr(problem, starts=4, seed=1, executor=pool)
    other = dojo.ilqr(problem, starts=4, seed=2)
    assert best.success and best.fun <= one.fun
    assert np.array_equal(best.u, spread.u) and best.message == spread.message
    assert best.problem is problem and best.simulator is problem.sim
    assert "best of 4 starts" in best.message
    assert other.fun <= one.fun


def test_unsolved_starts_return_the_least_violation():
    plan = dojo.ilqr(swing(), starts=3, max_iterations=1)
    assert not plan.success
    assert "0 of them solved" in plan.message
    assert plan.violation <= dojo.ilqr(swing(), max_iterations=1).violation


def test_starts_are_checked():
    for wrong, error in (({"starts": 0}, ValueError), ({"seed": -1}, ValueError), ({"executor": 3}, TypeError)):
        with pytest.raises(error, match="ilqr"):
            dojo.ilqr(swing(), **wrong)


def test_a_problem_may_be_planned_and_judged_while_it_is_planned():
    """As by other threads: every plan is that of a problem of its own."""
    problem = dojo.problems.hop()
    push = problem.controls0 + [1.0, -1.0, 3.0]
    first, second = dojo.ilqr(problem), dojo.ilqr(problem, push)
    inside = []

    def plan_again(record):
        if record["iteration"] == 5:
            inside.append(dojo.ilqr(problem, push))
            assert problem.cost(second.x, second.u) == second.fun

    again = dojo.ilqr(problem, callback=plan_again)
    for one, other in ((again, first), (inside[0], second)):
        np.testing.assert_array_equal(one.x, other.x)
        assert (one.fun, one.violation, one.nit, one.problem) == (other.fun, other.violation, other.nit, problem)
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(lambda guess: dojo.ilqr(problem, guess), [push] * 4):
            np.testing.assert_array_equal(found.x, second.x)
