"""Costs, constraints and messages by the names of joints, degrees of freedom and inputs."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.constraint import ControlBounds, Goal, StateBounds
from dojo_opt.cost import Effort, Tracking

SIM = dojo.Simulator(dojo.models.cartpole(), time_step=0.05)
X = SIM.neutral()


def bound(spec):
    problem = dojo.Problem(SIM, X, 10, **{"cost" if spec.kind == "cost" else "constraints": [spec]})
    return (problem.costs + problem.constraints)[0]


def test_weights_by_name_are_those_by_number():
    np.testing.assert_array_equal(
        bound(Tracking(X, {"q": 2.0, "cart": 5.0, "v pole": 0.1})).weight,
        bound(Tracking(X, [5.0, 2.0, 0.0, 0.1])).weight,
    )
    np.testing.assert_array_equal(bound(Tracking(X, {"v": [3.0, 4.0]})).weight[0], [0, 0, 3, 4])
    np.testing.assert_array_equal(bound(Effort({"cart": 3.0})).weight, bound(Effort(3.0)).weight)


def test_components_by_name_are_those_by_number():
    for by_name, by_number in (
        (Goal(X, components="pole"), Goal(X, components=[1])),
        (Goal(X, components=["q"]), Goal(X, components=[0, 1])),
        (StateBounds(-1, 1, components=["v cart"]), StateBounds(-1, 1, components=[2])),
        (ControlBounds(-1, 1, components=["cart"]), ControlBounds(-1, 1, components=[0])),
    ):
        one, other = bound(by_name), bound(by_number)
        np.testing.assert_array_equal(one.mask, other.mask)
        np.testing.assert_array_equal(one.columns, other.columns)
    free = dojo.Problem(SIM, X, 10, cost=Effort(1.0), free_start=["v cart", "pole"])
    assert free.free_start.tolist() == [1, 2]


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (lambda: Goal(X, components=["poel"]), r"Goal\(components=\.\.\.\): 'poel' is not one of: .*mean 'pole'"),
        (lambda: Goal(X, components=[1.5]), r"Goal\(components=\.\.\.\): expected names or whole numbers, got \[1.5\]"),
        (lambda: Tracking(X, {"car": 1.0}), r"Tracking\(weight=\.\.\.\): 'car' is not one of: .*mean 'cart'"),
        (lambda: Tracking(X, {"q": [1.0]}), r"Tracking\(weight=\.\.\.\): 'q': expected shape \(2,\), got \(1,\)"),
        (lambda: Effort({"pole": 1.0}), r"Effort\(weight=\.\.\.\): 'pole' is not one of: cart"),
    ],
)
def test_unknown_names_are_refused(spec, message):
    with pytest.raises(ValueError, match=message):
        bound(spec())


def test_a_plan_that_fails_names_the_constraint_and_the_component():
    goal = X.copy()
    goal[0] = 1.0
    problem = dojo.Problem(SIM, X, 10, cost=Effort(1e-3), constraints=[Goal(X), Goal(goal, components="cart")])
    plan = dojo.ilqr(problem)
    assert not plan.success
    assert "Largest violation: 0." in plan.message and "Goal of cart at knot 10." in plan.message


def test_one_term_need_not_be_a_list_and_names_of_settings_are_suggested():
    problem = dojo.Problem(SIM, X, 10, cost=Effort(1.0))
    assert len(problem.costs) == 1
    for call, message in (
        (
            lambda: dojo.ilqr(problem, max_iter=3),
            r"ilqr\(\.\.\.\): no keyword 'max_iter'; .*did you mean 'max_iterations'",
        ),
        (lambda: dojo.MPC(problem, dely=0.1), r"MPC\(\.\.\.\): no keyword 'dely'; .*did you mean 'delay'"),
        (lambda: dojo.Plant(SIM, payloda=1.0), r"Plant\(\.\.\.\): no keyword 'payloda'; .*did you mean 'payload'"),
        (lambda: dojo.ilqr(SIM), r"ilqr\(problem\): expected a Problem, got Simulator\(cartpole"),
        (lambda: dojo.MPC(SIM), r"MPC\(problem\): expected a Problem, got Simulator\(cartpole"),
        (lambda: dojo.closed_loop(lambda t, x: [0.0], SIM, 1.0), r"closed_loop\(plant\): expected a Plant"),
    ):
        with pytest.raises(TypeError, match=message):
            call()
    with pytest.raises(ValueError, match=r"control_limits=\.\.\.\): expected \(lower, upper\), got 5"):
        dojo.Problem(SIM, X, 10, cost=Effort(1.0), control_limits=5)


@pytest.mark.parametrize(
    ("module", "name", "near"),
    [
        (dojo, "Simulater", "Simulator"),
        (dojo.models, "hoper", "hopper"),
        (dojo.problems, "hopp", "hop"),
        (dojo.tasks, "hopper_mcp", "hopper_mpc"),
        (dojo.tasks.jin, "fingertip", "fingertips"),
        (dojo.learn, "Tasks", "Task"),
    ],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_a_misspelt_name_of_a_module(module, name, near):
    message = f"module '{module.__name__}' has no attribute '{name}'; it has .*did you mean '{near}'"
    with pytest.raises(AttributeError, match=message):
        getattr(module, name)


def test_results_print_on_one_line():
    plan = dojo.ilqr(dojo.Problem(SIM, X, 10, cost=Effort(1.0)))
    assert repr(plan) == "Plan(SOLVED, 0 iterations, cost 0, x (11, 4), u (10, 1))"
    loop = dojo.closed_loop(lambda t, x: [0.0], dojo.Plant(SIM), 0.1)
    assert repr(loop) == "ClosedLoop(0.1 s, Ran to the end. x (3, 4), u (2, 1), 0 ticks)"
    t = SIM.rollout(X, np.zeros((3, 1)))
    assert repr(t) == "Trajectory(cartpole, 3 steps of 0.05 s, SOLVED, x (4, 4), u (3, 1))"


def test_a_problem_is_refined_as_its_arguments_say():
    goal = Goal(X)
    problem = dojo.Problem(SIM, X, 10, cost=Effort(1.0), refinement=3, refined_constraints=goal)
    finer = problem.refined(problem.refinement)
    assert (finer.substeps, finer.refinement, finer.specs[1], problem.specs[1]) == (3, 1, (goal,), ())
    assert finer.sim.time_step == pytest.approx(SIM.time_step / 3)
    with pytest.raises(ValueError, match=r"Problem\(refinement=\.\.\.\): "):
        dojo.Problem(SIM, X, 10, cost=Effort(1.0), refinement=0)
    with pytest.raises(
        TypeError, match=r"refined_constraints=\.\.\.\): entry 0 is a float, not a term of dojo.constraint"
    ):
        dojo.Problem(SIM, X, 10, cost=Effort(1.0), refined_constraints=[1.0])
