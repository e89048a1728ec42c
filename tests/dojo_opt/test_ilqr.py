"""iLQR on small systems: solutions, reports, refusals."""

import io

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation

from dojo_opt.constraint import ControlBounds, Goal, StateBounds
from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.ilqr import Solver, ilqr
from dojo_opt.planning.options import Options
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.problems import hop
from solvers.status import Status
from support.doubles import DoubleIntegrator, FreeBody, Pendulum
from support.small_problems import ONE_STAGE, gaps, lqr, swingup


def test_lqr_in_one_iteration():
    problem = lqr()
    plan = ilqr(problem)
    assert plan.success and plan.status == Status.SOLVED and plan.nit == 1
    assert plan.history[0]["alpha"] == 1.0 and np.abs(plan.k).max() < 1e-7
    # far from the end its gains equal the gains of the infinite horizon
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
    soft = ilqr(lqr(constraints=[ControlBounds(-0.6, 0.5)]), violation_tolerance=1e-6, tolerance=1e-9)
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


def test_warm_start_takes_over_multipliers():
    problem = swingup(constraints=[Goal([np.pi, 0.0])])
    plan = ilqr(problem)
    again = ilqr(problem, warm_start=plan, stages=ONE_STAGE)
    assert plan.success and again.success
    assert again.nit <= 3 < plan.nit
    np.testing.assert_allclose(again.fun, plan.fun, rtol=1e-2)
    with pytest.raises(ValueError, match="expected multipliers of shapes"):
        ilqr(swingup(), warm_start=plan)


def test_table_and_history():
    stream = io.StringIO()
    plan = ilqr(swingup(constraints=[Goal([np.pi, 0.0])]), verbose=True, stream=stream)
    lines = stream.getvalue().splitlines()
    assert lines[0].split() == "iter cost merit |grad| k_eval k_grad mu alpha gap viol ms".split()
    assert len({len(line) for line in lines[:-1]}) == 1 and len(lines) == plan.nit + 2
    assert lines[-1].startswith("SOLVED: ")
    assert plan.summary() == stream.getvalue().rstrip("\n")
    assert [r["iteration"] for r in plan.history] == list(range(1, plan.nit + 1))


@pytest.mark.slow
def test_the_refined_problem_may_ask_for_more_and_the_table_tells_both():
    problem, stream = hop(), io.StringIO()
    higher = ilqr(problem).x[10] + np.eye(15)[2] * 0.05
    problem.refinement = 2
    problem.refined_constraints = (Goal(higher, components="body z", knots=10),)
    plan = ilqr(problem, verbose=True, stream=stream)
    assert plan.success and plan.substeps == 2 and len(plan.multipliers) == 2
    assert plan.x[10, 2] == pytest.approx(higher[2], abs=1e-3)
    Solver(problem).reset(plan.multipliers, plan.penalties)  # of which it takes those that it has
    ends = [line.split(" iterations")[0] for line in stream.getvalue().splitlines() if " iterations, " in line]
    counts = [int(part) for part in ends[-1].split(" + ")]
    assert len(ends) == 3 and len(counts) == 2 and sum(counts) == plan.nit == len(plan.history)
    problem.refined_constraints = (Goal(higher + np.eye(15)[2] * 5.0, components="body z", knots=10),)
    plan = ilqr(problem)
    assert not plan.success
    assert "Largest violation: " in plan.message and "Goal of " in plan.message  # of this one, or of one it upset


@pytest.mark.slow
def test_a_plan_that_goes_away_from_what_the_refined_problem_asks_is_not_refined():
    """Jumps that stay on the ground used to be refined until the iteration limit."""
    problem, stream = hop(), io.StringIO()
    coarse = ilqr(problem)
    deeper = problem.start - np.eye(15)[2]  # the body is higher at the tenth knot than at first
    assert coarse.x[10, 2] > problem.start[2]
    problem.refinement, problem.advice = 2, "Try less."
    problem.refined_constraints = (Goal(deeper, components="body z", knots=10),)
    plan = ilqr(problem, verbose=True, stream=stream)
    assert plan.status == Status.INFEASIBLE and plan.nit == coarse.nit and plan.violation > 1.0
    assert "no less than the start" in plan.message and "Goal of body z at knot 10" in plan.message
    assert plan.message.endswith(" Try less.") and stream.getvalue().rstrip().endswith(plan.message)


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
        ({"max_iterations": -1}, r"ilqr\(max_iterations=...\): expected a whole number >= 0, got -1"),
        ({"on_kappa_change": "open"}, r"ilqr\(on_kappa_change=...\): 'open' is not one of: feedback, gaps"),
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
    with pytest.raises(TypeError, match=r"Problem\(cost=...\): entry 1 is a Goal, not a term of dojo.cost"):
        Problem(DoubleIntegrator(), [1.0, 0.0], 5, cost=[Effort(1.0), Goal([0.0, 0.0])])
    with pytest.raises(TypeError, match=r"Problem\(constraints=...\): entry 0 is a Effort, not a term"):
        Problem(DoubleIntegrator(), [1.0, 0.0], 5, constraints=[Effort(1.0)])


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
    solver.reset()
    # half the penalty: 10 times the curvature 4 of the position; the velocity has no weight and takes the largest
    np.testing.assert_allclose(problem.constraints[0].weight, [[20.0, 20.0]])


def test_refined_keeps_knots_and_terms_and_cuts_the_steps():
    problem = hop(substeps=2)
    finer = problem.refined(3)
    assert (finer.substeps, finer.horizon) == (6, problem.horizon)
    assert finer.knot_time == pytest.approx(problem.knot_time) and problem.sim.time_step == 0.025
    assert finer.costs[0] is not problem.costs[0]
    np.testing.assert_array_equal(finer.costs[0].weight, problem.costs[0].weight)
    for count in (0, 1.5, True):
        with pytest.raises(ValueError, match="expected a whole number >= 1"):
            problem.refined(count)


def test_regularized_gains_leave_the_plan_as_it_is():
    """As if the controls weighed more: at the last knot, whose value is the cost of the end alone, exactly so."""
    plain, problem = ilqr(lqr()), lqr()
    problem.gain_regularization = 10.0
    calm = ilqr(problem)
    np.testing.assert_array_equal(calm.x, plain.x)
    np.testing.assert_array_equal(calm.u, plain.u)
    lin = problem.sim.linearize_trajectory(plain.x[-2:-1], plain.u[-1:])
    A, B = lin.A[0], lin.B[0]
    for plan, weight in ((plain, 0.1), (calm, 1.1)):
        np.testing.assert_allclose(plan.K[-1], -np.linalg.solve(weight + B.T @ B, B.T @ A), rtol=1e-9)
