"""iLQR through stages of smoothing, with gaps that open and close."""

import dataclasses

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.ilqr import Solver, ilqr
from dojo_opt.planning.ilqr_search import Direction, Search
from dojo_opt.planning.ilqr_start import only_stops
from dojo_opt.planning.iterate import Iterate
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from solvers.riccati import PredictedChange
from solvers.status import Status
from support.doubles import DoubleIntegrator, Pendulum, SmoothedWall
from support.small_problems import ONE_STAGE, gaps, lqr, swingup


@pytest.mark.parametrize("on_kappa_change", ["gaps", "feedback"])
def test_continuation_ends_at_the_hard_wall(on_kappa_change):
    problem = Problem(
        SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)], constraints=[Goal([0.5, 0.0])]
    )
    plan = ilqr(problem, on_kappa_change=on_kappa_change)
    assert plan.success, plan.message
    assert gaps(problem, plan, 1e-6) < 1e-12
    assert plan.x[:, 0].min() > 0.0
    used = [(r["kappa_eval"], r["kappa_grad"]) for r in plan.history]
    assert used == sorted(used, reverse=True) and used[-1][0] == 1e-6


def entered(problem, now, stage):
    """A trajectory after its passage to a stage, before its first iteration."""
    return Solver(problem, Options(stages=(stage._replace(iterations=0),), on_kappa_change="gaps")).iterate(now).now


def test_gaps_reopen_when_kappa_changes():
    problem = Problem(SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)])
    solver = Solver(problem, Options(stages=(Stage(1.0, 1.0),)))
    result = solver.iterate(solver.rollout(Iterate(np.tile(problem.start, (21, 1)), problem.controls0)))
    before = result.now
    assert result.success and result.history and before.gaps is None
    now = entered(problem, before, Stage(1e-4, 1e-4))
    np.testing.assert_array_equal(now.x, before.x)  # states and merit are kept, the mismatch is in the gaps
    assert now.merit == before.merit and now.gap > 1e-3
    for t in range(20):
        following = problem.sim.advance(now.x[t], now.u[t], 1, 1e-4)
        np.testing.assert_allclose(now.gaps[t + 1], following - now.x[t + 1], atol=1e-12)


def test_partial_steps_leave_the_rest_of_the_gaps(rng):
    problem = swingup()
    solver = Solver(problem)
    states = np.linspace([0.0, 0.0], [np.pi, 0.0], 31)
    now = entered(problem, solver.guess(states, problem.controls0), ONE_STAGE[0])
    k, K = rng.standard_normal((30, 1)), rng.standard_normal((30, 1, 2))
    horizon = problem.sim.horizon(problem.horizon, problem.substeps, problem.control_limits)
    search = Search(problem, horizon, solver.objective, solver.options)
    linear = horizon.linearize(now.x, now.u, 1e-4)
    shot = search.rollout(
        now, K, 1e-4, Direction(k, K, None, linear, PredictedChange(Status.SOLVED, 0, 0.0, 0.0, 0.0)), 0.25
    )
    assert now.gap > 1e-2
    for t in range(30):
        following = problem.sim.advance(shot.x[t], shot.u[t], 1, 1e-4)
        np.testing.assert_allclose(following - shot.x[t + 1], 0.75 * now.gaps[t + 1], atol=1e-12)


def test_the_first_trials_of_a_search_give_wild_steps_up_early():
    """Later trials have all the iterations of the simulator, so that no step size is lost to the limit."""
    problem = swingup(Stuck())
    solver = Solver(problem, Options(halvings=4))
    horizon = problem.sim.horizon(problem.horizon, problem.substeps, problem.control_limits)
    limits, roll = [], horizon.roll
    horizon.roll = lambda *given, **named: limits.append(named["max_iterations"]) or roll(*given, **named)
    search = Search(problem, horizon, solver.objective, solver.options)
    now = solver.guess(np.zeros((31, 2)), problem.controls0)
    k, K = np.ones((30, 1)), np.zeros((30, 1, 2))
    alpha, _ = search.single_shooting(
        now, Direction(k, K, None, None, PredictedChange(Status.SOLVED, 0, -1.0, 0.0, 0.0)), 1e-4
    )
    assert alpha == 0.0 and len(limits) == 5
    assert limits[0] == limits[1] < 100 and limits[2:] == [None] * 3


def test_step_sizes_go_down_by_the_factor_of_the_options():
    """1, 1/4, 1/16 instead of 1, 1/2, 1/4, 1/8, 1/16: three rollouts for five."""
    problem = swingup(Stuck())
    solver = Solver(problem, Options(halvings=4, backtracking=0.25))
    horizon = problem.sim.horizon(problem.horizon, problem.substeps, problem.control_limits)
    sizes, roll = [], horizon.roll
    horizon.roll = lambda *given, **named: sizes.append(named["alpha"]) or roll(*given, **named)
    search = Search(problem, horizon, solver.objective, solver.options)
    now = solver.guess(np.zeros((31, 2)), problem.controls0)
    k, K = np.ones((30, 1)), np.zeros((30, 1, 2))
    search.single_shooting(now, Direction(k, K, None, None, PredictedChange(Status.SOLVED, 0, -1.0, 0.0, 0.0)), 1e-4)
    assert sizes == [1.0, 0.25, 0.0625]
    for factor in (0.0, 1.0, 2.0):
        with pytest.raises(ValueError, match="backtracking"):
            Options(backtracking=factor)


def test_steps_within_the_limit_are_taken_without_a_rollout():
    """One iteration solves a linear problem from states that are no motion; the next finds nothing left to do."""
    problem = lqr()
    far = problem.start + np.linspace([0.0, 0.0], [0.3, -0.2], problem.horizon + 1)
    for limit, rolled in ((np.array([np.inf]), False), (np.array([1e-9]), True)):
        solver = Solver(problem, Options(stages=(Stage(1e-4, 1e-4, None, 1),)), limit)
        first = solver.iterate(solver.guess(far, problem.controls0))
        assert first.alpha == 1.0 and (first.now.kappa is not None) == rolled == np.isfinite(first.now.gap)
        np.testing.assert_allclose(first.now.x, ilqr(problem, stages=ONE_STAGE).x, atol=1e-9)
        assert solver.iterate(first.now).now.gap < 1e-9


def test_iterations_one_by_one_agree_with_a_solve():
    """Gains and regularisation carry over from one call to the next."""
    problem, (stage,) = swingup(), ONE_STAGE
    plan = ilqr(problem, stages=ONE_STAGE)
    solver = Solver(problem, Options(stages=(stage._replace(iterations=1),)))
    now = solver.rollout(Iterate(np.tile(problem.start, (31, 1)), problem.controls0))
    steps = [solver.iterate(now)]
    while steps[-1].history:
        steps.append(solver.iterate(steps[-1].now))
    assert [s.alpha for s in steps[:-1]] == [r["alpha"] for r in plan.history]
    np.testing.assert_array_equal(steps[-1].now.x, plan.x)
    assert steps[-1].success and steps[-1].consistent and steps[-1].now.cost == plan.fun


def test_an_iteration_keeps_a_guess_that_no_step_improves():
    problem, (stage,) = swingup(Stuck()), ONE_STAGE
    solver = Solver(problem, Options(stages=(stage._replace(iterations=1),), multiple_shooting_below=0.0))
    result = solver.iterate(solver.guess(np.linspace([0.0, 0.0], [np.pi, 0.0], 31), problem.controls0))
    assert result.alpha == 0.0 and not result.consistent and result.now.gap > 0.0
    assert solver.rollout(result.now, result.K) is None


def test_a_good_guess_of_states_skips_the_smooth_stages():
    problem = Problem(SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)])
    plan = ilqr(problem)
    assert plan.history[0]["kappa_eval"] == 3e-2
    again = ilqr(problem, controls=plan.u, states=plan.x)
    assert {r["kappa_eval"] for r in again.history} <= {1e-6}
    poor = ilqr(problem, controls=plan.u, states=np.tile([1.0, 0.0], (21, 1)))
    assert poor.history[0]["kappa_eval"] == 3e-2
    assert again.success and poor.success


def test_only_stops_of_joints_need_no_smooth_stages():
    """A shut gripper at its stop took an arm through a hundred iterations."""
    body, joint = dojo.Body("a", 1.0, shape=dojo.Capsule(0.02, 0.3)), dojo.Joint("revolute", None, "a", limits=(-1, 0))
    xs = np.zeros((21, 2))

    def found(joint, *contacts):
        return only_stops(dojo.Simulator(dojo.Mechanism([body], [joint], contacts), time_step=0.02), xs)

    assert found(joint) and found(joint, dojo.Contact("a", height=-0.2))
    assert not found(joint, dojo.Contact("a", height=-1e-3))
    assert not found(dataclasses.replace(joint, friction=0.1))
    assert not found(dataclasses.replace(joint, limits=None))


class Lost(Pendulum):
    """A pendulum: its first `lost` rollouts fail."""

    lost = 14

    def rollout_feedback(self, x0, us, *rest):
        self.lost -= 1
        shot = super().rollout_feedback(x0, us, *rest)
        return shot if self.lost < 0 else shot._replace(status=Status.MAX_ITERATIONS)


class Stuck(Lost):
    """All of its rollouts fail."""

    lost = 10**9


class StuckIntegrator(Stuck, DoubleIntegrator):
    """The same of a linear system."""

    move = DoubleIntegrator.move


def test_a_step_of_all_states_solves_a_linear_problem():
    exact, problem, (stage,) = ilqr(lqr()), lqr(), ONE_STAGE
    problem.sim = StuckIntegrator()
    solver = Solver(problem, Options(stages=(stage._replace(iterations=1),)))
    guess = solver.guess(np.zeros_like(exact.x), problem.controls0)
    result = solver.iterate(guess._replace(x=np.concatenate([[problem.start], guess.x[1:]])))
    assert result.alpha == 1.0 and result.now.gap < 1e-9
    np.testing.assert_allclose(result.now.x, exact.x, atol=1e-7)


def test_steps_of_all_states_are_taken_where_rollouts_are_lost():
    states = np.linspace([0.0, 0.0], [np.pi, 0.0], 31)
    with_shooting, without = (
        ilqr(swingup(Lost()), states=states, stages=ONE_STAGE, multiple_shooting_below=bar, rejections=3)
        for bar in (0.1, 0.0)
    )
    assert with_shooting.history[0]["alpha"] > 0.0 and with_shooting.history[0]["gap"] > 0.0
    assert without.history[0]["alpha"] == 0.0
    assert with_shooting.success and gaps(with_shooting.problem, with_shooting, 1e-4) < 1e-12


def test_a_stage_that_used_all_its_iterations_is_not_solved():
    """Neither an iteration nor a plan; one that converged is."""
    problem = swingup()
    stage = Stage(1e-4, 1e-4, decrease=1e-9, iterations=1)
    solver = Solver(problem, Options(stages=(stage,)))
    result = solver.iterate(solver.rollout(Iterate(np.tile(problem.start, (31, 1)), problem.controls0)))
    assert result.status == Status.MAX_ITERATIONS and result.success and len(result.history) == 1
    plan = ilqr(problem, stages=(stage,))
    assert plan.status == Status.MAX_ITERATIONS and not plan.success and plan.nit == 1
    whole = ilqr(problem, stages=(stage._replace(iterations=100),))
    assert whole.success and whole.nit > 1


def test_the_smoothing_of_derivatives_grows_along_the_horizon():
    """In blocks of knots, from that of the rollouts to kappa_grad; one block has kappa_grad throughout."""
    problem = Problem(SmoothedWall(), [0.1, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)])
    now = Iterate(np.tile(problem.start, (21, 1)), problem.controls0, kappa=1e-4)
    horizon = problem.sim.horizon(problem.horizon, problem.substeps, problem.control_limits)
    for blocks, kappas in ((1, [1e-2] * 20), (2, [1e-4] * 10 + [1e-2] * 10), (3, [1e-4] * 6 + [1e-3] * 7 + [1e-2] * 7)):
        solver = Solver(problem, Options(kappa_blocks=blocks))
        assert solver._subproblem.linearize(now, 1e-2, 1e-4) == Status.SOLVED
        for t, kappa in enumerate(kappas):
            alone = horizon.linearize(now.x, now.u, kappa)
            np.testing.assert_array_equal(solver._subproblem.linear.A[t], alone.A[t])
            np.testing.assert_array_equal(solver._subproblem.linear.x_next[t], alone.x_next[t])
    assert np.ptp(solver._subproblem.linear.A[:, 1, 0]) > 1e-2  # the wall pushes from further away later on
