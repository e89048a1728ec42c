"""iLQR on small systems: what it solves, how it ends, and what it reports."""

import io

import numpy as np
import pytest
from doubles import DoubleIntegrator, FreeBody, Pendulum, SmoothedWall
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation

from dojo_opt.constraint import ControlBounds, Goal, StateBounds
from dojo_opt.cost import Effort, Tracking
from dojo_opt.options import Options, Stage
from dojo_opt.plan import Plan
from dojo_opt.planner import Solver, ilqr
from dojo_opt.problem import Problem
from dojo_opt.problems import hop
from dojo_opt.shooting import Shooting
from solvers.status import MESSAGES, Status

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


# what it solves


def test_lqr_in_one_iteration():
    problem = lqr()
    plan = ilqr(problem)
    assert plan.success and plan.status == Status.SOLVED and plan.nit == 1
    assert plan.history[0]["alpha"] == 1.0 and np.abs(plan.k).max() < 1e-7
    # its gains are those of the infinite horizon, far from the end
    lin = problem.sim.linearize_trajectory(plan.x[:2], plan.u[:1])
    A, B = lin.A[0], lin.B[0]
    P = solve_discrete_are(A, B, np.eye(2), 0.1 * np.eye(1))
    long = ilqr(lqr(horizon=200))
    np.testing.assert_allclose(long.K[0], -np.linalg.solve(0.1 + B.T @ P @ B, B.T @ P @ A), rtol=1e-6)


def test_lqr_from_inconsistent_states_in_one_iteration():
    problem = lqr()
    reference = ilqr(problem)
    states = np.random.default_rng(0).normal(size=(31, 2))
    plan = ilqr(problem, states=states)
    assert plan.success and plan.nit == 1 and plan.gap == 0.0
    np.testing.assert_allclose(plan.x, reference.x, atol=1e-8)
    np.testing.assert_allclose(plan.u, reference.u, atol=1e-7)


def test_control_limits_hold_and_are_used():
    plan = ilqr(lqr(control_limits=(-0.6, 0.5)), tolerance=1e-9)
    assert plan.success
    assert plan.u.min() == -0.6 and plan.u.max() <= 0.5
    held = plan.u[:, 0] == -0.6
    assert held.any() and np.all(plan.K[held] == 0.0)
    # the same optimum as bounds by augmented Lagrangian
    soft = ilqr(lqr(constraints=[ControlBounds(-0.6, 0.5)]), violation=1e-6, tolerance=1e-9)
    assert soft.success
    np.testing.assert_allclose(plan.u, soft.u, atol=1e-3)


def test_swing_up_with_goal_and_limits():
    up = np.array([np.pi, 0.0])
    problem = swingup(constraints=[Goal(up)], control_limits=(-6.0, 6.0))
    plan = ilqr(problem)
    assert plan.success, plan.message
    assert plan.violation <= 1e-3 and np.abs(plan.x[-1] - up).max() <= 1e-3
    assert np.abs(plan.u).max() <= 6.0
    assert gaps(problem, plan, 1e-6) < 1e-12


def test_attitude_goal_is_reached_through_the_tangent_space():
    target = np.concatenate(
        [[1.0, 2.0, 3.0], Rotation.from_rotvec([1.0, -2.0, 0.5]).as_quat(scalar_first=True), np.zeros(6)]
    )
    start = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(6)])
    problem = Problem(FreeBody(), start, 8, cost=[Tracking(target, 1.0), Effort(0.01)], constraints=[Goal(target)])
    plan = ilqr(problem)
    assert plan.success, plan.message
    assert np.abs(problem.sim.difference(plan.x[-1], target)).max() <= 1e-3


def test_state_bounds():
    free = ilqr(lqr())
    plan = ilqr(lqr(constraints=[StateBounds([-np.inf, -0.3], [np.inf, np.inf])]))
    assert free.x[:, 1].min() < -0.5
    assert plan.success and plan.x[:, 1].min() >= -0.3 - 1e-3
    assert plan.fun > free.fun


def test_substeps():
    problem = lqr(substeps=3)
    plan = ilqr(problem)
    assert plan.success and plan.nit == 1 and plan.substeps == 3
    np.testing.assert_allclose(plan.time[-1], 30 * 0.3)


@pytest.mark.parametrize("reopen", ["gaps", "feedback"])
def test_continuation_ends_at_the_hard_wall(reopen):
    problem = Problem(
        SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)], constraints=[Goal([0.5, 0.0])]
    )
    plan = ilqr(problem, reopen=reopen)
    assert plan.success, plan.message
    assert gaps(problem, plan, 1e-6) < 1e-12
    assert plan.x[:, 0].min() > 0.0
    used = [(r["kappa_eval"], r["kappa_grad"]) for r in plan.history]
    assert used == sorted(used, reverse=True) and used[-1][0] == 1e-6


def test_gaps_reopen_when_kappa_changes():
    problem = Problem(SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)])
    solver = Solver(problem, Options(stages=(Stage(1.0, 1.0), Stage(1e-4, 1e-4)), reopen="gaps"))
    solver.objective.reset()
    solver.descent.reset()
    solver._guess(None, None)
    solver.continuation.run(solver.options.stages[0])
    before = solver.continuation.now
    assert before.gaps is None
    solver.continuation._enter(solver.options.stages[1])
    now = solver.continuation.now
    np.testing.assert_array_equal(now.x, before.x)  # states and merit are kept, the mismatch is in the gaps
    assert now.merit == before.merit and now.gap > 1e-3
    for t in range(20):
        following = problem.sim.advance(now.x[t], now.u[t], 1, 1e-4)
        np.testing.assert_allclose(now.gaps[t + 1], following - now.x[t + 1], atol=1e-12)


def test_partial_steps_leave_the_rest_of_the_gaps():
    problem = swingup()
    solver = Solver(problem, Options(stages=ONE_STAGE))
    solver.objective.reset()
    solver.descent.reset()
    states = np.linspace([0.0, 0.0], [np.pi, 0.0], 31)
    solver._guess(None, states)
    solver.continuation._enter(ONE_STAGE[0])
    now = solver.continuation.now
    solver.descent.linearize(now, 1e-4, 1e-4)
    solver.descent.gains(now)
    shot = solver.line_search.roll(now, solver.descent.k, solver.descent.K, 0.25, 1e-4)
    for t in range(30):
        following = problem.sim.advance(shot.x[t], shot.u[t], 1, 1e-4)
        np.testing.assert_allclose(following - shot.x[t + 1], 0.75 * now.gaps[t + 1], atol=1e-12)


def test_warm_start_takes_over_multipliers():
    problem = swingup(constraints=[Goal([np.pi, 0.0])])
    plan = ilqr(problem)
    again = ilqr(problem, warm_start=plan, stages=ONE_STAGE)
    assert plan.success and again.success
    assert again.nit <= 3 < plan.nit
    np.testing.assert_allclose(again.fun, plan.fun, rtol=1e-2)


# how it ends: every status of the planner


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
    assert 1.0 <= solver.descent.mu <= 4.0
    assert np.all(np.isfinite(concave.K)) and np.abs(concave.K).max() > 0.0


def test_infeasible_constraints():
    problem = lqr(horizon=5, constraints=[Goal([0.0, 0.0]), Goal([1.0, 0.0])])
    plan = ilqr(problem, max_updates=4)
    assert plan.status == Status.INFEASIBLE and not plan.success and plan.violation > 0.1


def test_every_status_has_a_sentence():
    assert set(MESSAGES) == set(Status)


# what it reports


def test_table_and_history():
    stream = io.StringIO()
    plan = ilqr(swingup(constraints=[Goal([np.pi, 0.0])]), verbose=True, stream=stream)
    lines = stream.getvalue().splitlines()
    assert lines[0].split() == "iter cost merit |grad| k_eval k_grad mu alpha gap viol ms".split()
    assert len({len(line) for line in lines[:-1]}) == 1 and len(lines) == plan.nit + 2
    assert lines[-1].startswith("SOLVED: ")
    assert plan.summary() == stream.getvalue().rstrip("\n")
    assert [r["iteration"] for r in plan.history] == list(range(1, plan.nit + 1))


def test_save_and_load(tmp_path):
    plan = ilqr(swingup(constraints=[Goal([np.pi, 0.0])]))
    plan.save(tmp_path / "plan.npz")
    again = Plan.load(tmp_path / "plan.npz")
    for name in ("x", "u", "K", "k"):
        np.testing.assert_array_equal(getattr(again, name), getattr(plan, name))
    assert again.status is plan.status and again.history == plan.history and again.message == plan.message
    np.testing.assert_array_equal(again.multipliers[0], plan.multipliers[0])
    assert again.summary() == plan.summary()


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"max_iterations": -1}, r"ilqr\(max_iterations=...\): expected a number >= 0, got -1"),
        ({"reopen": "open"}, r'ilqr\(reopen=...\): expected "feedback" or "gaps"'),
        ({"stages": ()}, "at least one stage"),
        ({"stages": ((0.0, 1e-3),)}, "expected positive kappa"),
        ({"time_limit": np.nan}, "time_limit"),
    ],
)
def test_bad_options(settings, message):
    with pytest.raises(ValueError, match=message):
        ilqr(lqr(), **settings)


def test_bad_guesses():
    with pytest.raises(ValueError, match=r"ilqr\(controls=...\): expected shape \(30, 1\), got \(5, 1\)"):
        ilqr(lqr(), np.zeros((5, 1)))
    with pytest.raises(ValueError, match=r"ilqr\(states=...\): expected shape \(31, 2\), got \(30, 2\)"):
        ilqr(lqr(), states=np.zeros((30, 2)))
    with pytest.raises(ValueError, match=r"ilqr\(controls=...\): expected finite numbers, got nan at index \(3, 0\)"):
        controls = np.zeros((30, 1))
        controls[3] = np.nan
        ilqr(lqr(), controls)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"start": [1.0]}, r"Problem\(start=...\): expected shape \(2,\), got \(1,\)"),
        ({"start": [np.nan, 0.0]}, r"Problem\(start=...\): expected finite numbers"),
        ({"horizon": 0}, r"Problem\(horizon=...\)"),
        ({"substeps": 0}, r"Problem\(substeps=...\)"),
        ({"control_limits": (1.0, -1.0)}, "expected lower <= upper, got .* of control 0"),
        ({"control_limits": ([0.0, 0.0], 1.0)}, r"Problem\(control_limits=...\): expected a number or shape \(1,\)"),
        ({"controls0": np.zeros((3, 1))}, r"Problem\(controls0=...\): expected shape \(5, 1\), got \(3, 1\)"),
        ({"states0": np.zeros((3, 2))}, r"Problem\(states0=...\): expected shape \(6, 2\), got \(3, 2\)"),
    ],
)
def test_bad_problems(change, message):
    arguments = {"start": [1.0, 0.0], "horizon": 5} | change
    with pytest.raises(ValueError, match=message):
        Problem(DoubleIntegrator(), **arguments)


def test_terms_must_be_terms():
    with pytest.raises(TypeError, match=r"Problem\(cost=...\): entry 0 is a float, not a term"):
        Problem(DoubleIntegrator(), [1.0, 0.0], 5, cost=[1.0])


# what it does not depend on


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_multiple_of_the_costs_is_solved_alike(scale):
    up = np.array([np.pi, 0.0])

    def solve(factor):
        cost = [Tracking(up, 0.1, scale=factor), Effort(0.01, scale=factor)]
        return ilqr(Problem(Pendulum(), np.zeros(2), 30, cost=cost, constraints=[Goal(up)]))

    plan, other = solve(1.0), solve(scale)
    assert plan.success and other.success and other.nit == plan.nit
    np.testing.assert_allclose(other.fun, scale * plan.fun, rtol=1e-6)


def test_penalties_are_in_units_of_the_cost():
    problem = Problem(
        DoubleIntegrator(), [1.0, 0.0], 5, cost=[Tracking(np.zeros(2), [2.0, 0.0])], constraints=[Goal([0.0, 0.0])]
    )
    solver = Solver(problem, Options(penalty=10.0))
    solver.objective.reset()
    # half the penalty: 10 times the curvature 4 of the position; the velocity has no weight and takes the largest
    np.testing.assert_allclose(problem.constraints[0].weight, [[20.0, 20.0]])


def test_a_good_guess_of_states_skips_the_smooth_stages():
    problem = Problem(SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)])
    plan = ilqr(problem)
    assert plan.history[0]["kappa_eval"] == 3e-2
    again = ilqr(problem, controls=plan.u, states=plan.x)
    assert {r["kappa_eval"] for r in again.history} <= {1e-6}
    poor = ilqr(problem, controls=plan.u, states=np.tile([1.0, 0.0], (21, 1)))
    assert poor.history[0]["kappa_eval"] == 3e-2
    assert again.success and poor.success


# multiple shooting


def test_a_step_of_all_states_solves_a_linear_problem():
    problem = lqr()
    solver = Solver(problem, Options(stages=ONE_STAGE))
    solver.solve()  # makes buffers belong to the problem
    solver.continuation.reset()
    solver.descent.reset()
    solver._guess(None, np.zeros_like(solver.continuation.now.x))
    solver.continuation._enter(ONE_STAGE[0])
    now = solver.continuation.now
    assert now.gaps is not None
    solver.descent.linearize(now, 1e-4, 1e-4)
    promise = solver.descent.gains(now)
    shooting = Shooting(problem, solver.horizon, solver.objective, solver.options)
    alpha, there, linear = shooting.search(
        now, promise, solver.descent.linear, (solver.descent.k, solver.descent.K, None), 1e-4
    )
    assert alpha == 1.0 and there.gap < 1e-9
    np.testing.assert_allclose(there.x, ilqr(problem).x, atol=1e-7)
    np.testing.assert_allclose(linear.x_next, there.x[1:], atol=1e-9)


class Lost(Pendulum):
    """Its rollouts fail, the first so many of them."""

    lost = 14

    def closed_loop(self, x0, us, *rest):
        self.lost -= 1
        shot = super().closed_loop(x0, us, *rest)
        return shot if self.lost < 0 else shot._replace(status=Status.MAX_ITERATIONS)


def test_steps_of_all_states_are_taken_where_rollouts_are_lost():
    states = np.linspace([0.0, 0.0], [np.pi, 0.0], 31)
    with_shooting, without = (
        ilqr(swingup(Lost()), states=states, stages=ONE_STAGE, shooting=bar, rejections=3) for bar in (0.1, 0.0)
    )
    assert with_shooting.history[0]["alpha"] > 0.0 and with_shooting.history[0]["gap"] > 0.0
    assert without.history[0]["alpha"] == 0.0
    assert with_shooting.success and gaps(with_shooting.problem, with_shooting, 1e-4) < 1e-12


def test_refined_keeps_knots_and_terms_and_cuts_the_steps():
    problem = hop(substeps=2)
    finer = problem.refined(3)
    assert (finer.substeps, finer.horizon) == (6, problem.horizon)
    assert finer.knot_time == pytest.approx(problem.knot_time) and problem.sim.time_step == 0.025
    assert finer.costs[0] is not problem.costs[0]
    np.testing.assert_array_equal(finer.costs[0].weight, problem.costs[0].weight)
    for count in (0, 1.5, True):
        with pytest.raises(ValueError, match="expected a positive number of steps per step"):
            problem.refined(count)
