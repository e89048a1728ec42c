"""How iLQR ends: every status, with a plan that fits it."""

import numpy as np

from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.ilqr import Solver, ilqr
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.problems import hop
from solvers.riccati import PredictedChange
from solvers.status import MESSAGES, Status
from support.doubles import DoubleIntegrator, Pendulum, SmoothedWall
from support.small_problems import gaps, lqr, swingup


def test_start_at_the_optimum():
    problem = lqr()
    plan = ilqr(problem, controls=ilqr(problem).u)
    assert plan.success and plan.nit == 0


def test_iteration_limit():
    plan = ilqr(swingup(), max_iterations=2, tolerance=1e-9)
    assert not plan.success and plan.status == Status.MAX_ITERATIONS and plan.nit == 2
    assert ilqr(swingup(), tolerance=1e-9).success


def test_time_limit():
    plan = ilqr(swingup(), time_limit=0.0)
    assert plan.status == Status.TIME_LIMIT and plan.nit == 0 and np.all(np.isfinite(plan.x))


def test_the_time_limit_ends_a_rollout(monkeypatch):
    problem, ended = hop(), []
    monkeypatch.setattr(
        Solver, "_attempts", lambda self, duals: ended.append(problem.sim.rollout(problem.start, steps=300_000))
    )
    plan = ilqr(problem, time_limit=0.1)
    assert plan.status == Status.TIME_LIMIT and not plan.success and not ended


def test_time_limit_returns_a_consistent_plan():
    problem = Problem(SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)])
    plan = ilqr(problem, states=np.tile([1.0, 0.0], (21, 1)), max_iterations=1)
    assert plan.status == Status.MAX_ITERATIONS
    assert plan.gap == 0.0 and gaps(problem, plan, 1e-6) < 1e-12


def test_callback_stops():
    seen = []

    def stop(record):
        seen.append(record["merit"])
        if len(seen) == 2:
            raise StopIteration

    plan = ilqr(swingup(), callback=stop, tolerance=1e-9)
    assert plan.status == Status.STOPPED and plan.nit == 2 == len(seen)


class Contrary(DoubleIntegrator):
    """Its derivatives have the wrong sign."""

    def linearize_trajectory(self, xs, us, substeps=1, kappa=None):
        lin = super().linearize_trajectory(xs, us, substeps, kappa)
        return lin._replace(B=-lin.B)


def test_line_search_failure():
    problem = Problem(Contrary(), [1.0, 0.0], 10, cost=[Tracking(np.zeros(2), 1.0), Effort(1e-3)])
    plan = ilqr(problem)
    assert not plan.success and plan.status == Status.LINE_SEARCH
    assert all(r["alpha"] == 0.0 for r in plan.history) and plan.nit >= 1


def test_a_last_stage_that_stays_stuck_ends_the_solve():
    goal = Goal(np.zeros(2))
    problem = Problem(Contrary(), [1.0, 0.0], 10, cost=[Tracking(np.zeros(2), 1.0), Effort(1e-3)], constraints=[goal])
    plan = ilqr(problem)
    assert not plan.success and plan.status == Status.LINE_SEARCH
    assert plan.nit <= 100


def test_simulation_failure_names_the_knot():
    problem = swingup(controls0=np.full((30, 1), 50.0))
    problem.sim.too_fast = 12.0
    plan = ilqr(problem)
    assert plan.status == Status.SIMULATION_FAILED and not plan.success
    assert "Knot 2, MAX_ITERATIONS" in plan.message


def test_trials_that_cannot_be_simulated_are_rejected():
    problem = Problem(Pendulum(), np.zeros(2), 30, cost=[Tracking([np.pi, 0.0], 1.0), Effort(1e-4)])
    problem.sim.too_fast = 8.0
    plan = ilqr(problem)
    assert np.all(np.isfinite(plan.x)) and np.abs(plan.x[:, 1]).max() < 8.0
    assert plan.fun < ilqr(problem, max_iterations=0).fun
    assert any(r["alpha"] < 1.0 for r in plan.history)


def test_no_positive_definite_hessian():
    problem = lqr()
    problem.costs[1].weight[:] = -1e3  # cannot be built through the public interface
    plan = ilqr(problem, regularization_max=1e2)
    assert plan.status == Status.MAX_REGULARIZATION and not plan.success
    assert plan.message.startswith("No positive definite control Hessian") and "At knot " in plan.message


class Broken(DoubleIntegrator):
    """Its derivatives at one knot are scaled by something."""

    knot, factor, status = 4, np.nan, Status.SOLVED

    def linearize_trajectory(self, xs, us, substeps=1, kappa=None):
        lin = super().linearize_trajectory(xs, us, substeps, kappa)
        lin.A[self.knot] *= self.factor
        lin.status[self.knot] = self.status
        return lin


def broken(**given):
    sim = Broken()
    for name, value in given.items():
        setattr(sim, name, value)
    return Problem(sim, [1.0, 0.0], 10, cost=[Tracking(np.zeros(2), 1.0), Effort(1e-3)])


def test_a_number_that_is_not_finite_is_not_regularized():
    """The message names its place, not the control Hessians that lose positive definiteness because of it."""
    plan = ilqr(broken())
    assert plan.status == Status.NOT_FINITE and not plan.success
    assert plan.message.startswith(MESSAGES[Status.NOT_FINITE] + " In the derivatives of the dynamics, at knot 4.")
    problem = lqr()
    problem.costs[0].weight[3] = np.nan
    assert "In the derivatives of the costs, at knot 3." in ilqr(problem).message
    plan = ilqr(broken(knot=5, factor=1e200))
    assert plan.status == Status.NOT_FINITE and "The cost-to-go overflows at knot 4." in plan.message


def test_derivatives_that_cannot_be_had_are_said():
    plan = ilqr(broken(factor=1.0, status=Status.NO_PROGRESS))
    assert plan.status == Status.SIMULATION_FAILED
    assert "Derivatives at knot 4, NO_PROGRESS: " + MESSAGES[Status.NO_PROGRESS] in plan.message


def test_a_box_qp_that_does_not_end(monkeypatch):
    unfinished = PredictedChange(Status.MAX_ITERATIONS, 3, 0.0, 0.0, 0.0)
    monkeypatch.setattr("dojo_opt.planning.subproblem.backward", lambda *arguments: unfinished)
    plan = ilqr(lqr())
    assert plan.status == Status.MAX_ITERATIONS
    assert "quadratic program of the control limits did not converge at knot 3" in plan.message


def test_gains_of_a_plan_have_no_more_regularization_than_they_need():
    exact = ilqr(lqr())
    held_back = ilqr(lqr(), regularization=1e3, max_iterations=1)
    assert held_back.history[-1]["mu"] == 1e3 and not held_back.success
    np.testing.assert_allclose(held_back.K, exact.K, rtol=1e-6)
    problem = lqr()
    problem.costs[1].weight[:] = -1.0  # needs some, and gets the first of the schedule that is enough
    solver = Solver(problem, Options(regularization=1e3, max_iterations=1))
    concave = solver.solve()
    assert concave.history[-1]["mu"] == 1e3
    assert 1.0 <= solver.regularization <= 4.0
    assert np.all(np.isfinite(concave.K)) and np.abs(concave.K).max() > 0.0


def test_infeasible_constraints():
    problem = lqr(horizon=5, constraints=[Goal([0.0, 0.0]), Goal([1.0, 0.0])])
    plan = ilqr(problem, max_updates=4)
    assert plan.status == Status.INFEASIBLE and not plan.success and plan.violation > 0.1


def test_every_status_has_a_sentence():
    assert set(MESSAGES) == set(Status)


def test_a_decrease_of_the_last_stage_is_kept():
    given = Options(stages=(Stage(1e-3, 1e-3), Stage(1e-6, 1e-6, 1e-5)), tolerance=1e-2)
    assert [stage.decrease for stage in given.stages] == [3e-2, 1e-5]
    assert Options(stages=((1e-6, 1e-6),), tolerance=1e-2).stages[0].decrease == 1e-2
