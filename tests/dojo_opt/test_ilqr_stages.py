"""iLQR through stages of smoothing, with gaps that open and close."""

import numpy as np
import pytest

from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.options import Options, Stage
from dojo_opt.planner import Solver, ilqr
from dojo_opt.problem import Problem
from dojo_opt.shooting import Shooting
from solvers.status import Status
from support.doubles import Pendulum, SmoothedWall
from support.small_problems import ONE_STAGE, gaps, lqr, swingup


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


def test_a_good_guess_of_states_skips_the_smooth_stages():
    problem = Problem(SmoothedWall(), [1.0, 0.0], 20, cost=[Tracking([-1.0, 0.0], 1.0), Effort(0.01)])
    plan = ilqr(problem)
    assert plan.history[0]["kappa_eval"] == 3e-2
    again = ilqr(problem, controls=plan.u, states=plan.x)
    assert {r["kappa_eval"] for r in again.history} <= {1e-6}
    poor = ilqr(problem, controls=plan.u, states=np.tile([1.0, 0.0], (21, 1)))
    assert poor.history[0]["kappa_eval"] == 3e-2
    assert again.success and poor.success


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
