"""Messages of plans that fail because inputs are too weak, or a goal too far: the reason, and what to change."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.planning.overload import demand


@pytest.fixture(scope="module")
def swing():
    """A pendulum that has to stand on end after ten knots."""

    def make(limit, **settings):
        sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
        top = np.array([np.pi, 0.0])
        return dojo.Problem(
            sim,
            sim.neutral(),
            10,
            cost=dojo.cost.Effort(1.0),
            constraints=dojo.constraint.Goal(top),
            control_limits=(-limit, limit),
            **settings,
        )

    return make


def test_a_plan_that_fails_at_its_limits_says_so(swing):
    plan = dojo.ilqr(swing(0.2, advice="Try a longer horizon."))
    assert not plan.success
    name = plan.problem.sim.mechanism.input_names[0]
    assert f"at their limits at 100% of the knots, most often {name!r}. Try a longer horizon." in plan.message
    assert plan.message.count("  ") == 0 and plan.message.endswith(".")


def test_a_guess_beyond_the_limits_is_told_where_no_plan_is_found(swing):
    guess = np.linspace(-0.1, 0.6, 10)[:, None]
    problem = swing(0.2, controls0=guess)
    np.testing.assert_allclose(demand(problem), np.abs(guess) / 0.2)
    assert "The guess needs 3 times the limit of input" in dojo.ilqr(problem, max_iterations=3).message
    free = swing(np.inf, controls0=guess, advice="Try another.")
    np.testing.assert_array_equal(demand(free), 0.0)
    plan = dojo.ilqr(free)
    assert plan.success and plan.message == "Solved to the requested tolerance."


def test_a_jump_of_three_meters_names_the_weakest_joint():
    """It used to end with its iteration limit, and no word on the torques of such a jump."""
    plan = dojo.ilqr(dojo.problems.jump(height=3.0), max_iterations=2)
    assert not plan.success
    assert "times the limit of input" in plan.message and "Try a smaller height" in plan.message
