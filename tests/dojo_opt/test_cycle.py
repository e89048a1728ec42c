"""Gains of motions that repeat themselves, and plans in a row."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from dojo_opt.constraint import Goal, Periodic
from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.ilqr import ilqr
from dojo_opt.planning.ilqr_start import periodic_gains
from dojo_opt.planning.options import Stage
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from solvers.riccati import Quadratic
from support.doubles import DoubleIntegrator

ONE_STAGE = (Stage(1e-4, 1e-4),)


def model(A, B, Q, R):
    T, n, m = B.shape
    H = np.zeros((T + 1, n + m, n + m))
    H[:-1, :n, :n], H[:-1, n:, n:] = Q, R
    lo, hi = np.full((T, m), -np.inf), np.full((T, m), np.inf)
    return Quadratic(A, B, np.zeros((T + 1, n + m)), H, np.zeros((T + 1, n)), lo, hi)


def test_constant_cycle_has_the_stationary_gains():
    rng = np.random.default_rng(0)
    A, B = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
    Q, R = np.diag([1.0, 2.0, 0.5]), np.diag([0.3, 0.7])
    K = periodic_gains(model(np.tile(A, (4, 1, 1)), np.tile(B, (4, 1, 1)), Q, R))
    P = solve_discrete_are(A, B, Q, R)
    expected = -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    np.testing.assert_allclose(K, np.tile(expected, (4, 1, 1)), atol=1e-7)


def test_gains_stabilize_an_unstable_cycle():
    rng = np.random.default_rng(1)
    T, n = 5, 3
    A, B = 2.0 * rng.normal(size=(T, n, n)), rng.normal(size=(T, n, 2))
    assert np.abs(np.linalg.eigvals(np.linalg.multi_dot(A[::-1]))).max() > 1.0
    K = periodic_gains(model(A, B, np.eye(n), np.eye(2)))
    closed = np.linalg.multi_dot((A + B @ K)[::-1])
    assert np.abs(np.linalg.eigvals(closed)).max() < 1.0


def test_no_gains_where_inputs_do_not_reach():
    A = np.tile(np.diag([2.0, 0.5]), (3, 1, 1))
    B = np.tile(np.array([[0.0], [1.0]]), (3, 1, 1))
    assert periodic_gains(model(A, B, np.eye(2), np.eye(1))) is None


def oscillator(constraints, **settings):
    t = np.linspace(0.0, 2.0 * np.pi, 11)
    reference = np.stack([np.sin(t) + 0.3 * t, np.cos(t)], axis=1)
    cost = [Tracking(reference, 1.0), Effort(0.1)]
    return Problem(DoubleIntegrator(), reference[0], 10, cost=cost, constraints=constraints, **settings)


def test_a_periodic_plan_in_a_row():
    stride = np.array([0.6 * np.pi, 0.0])
    problem = oscillator([Periodic(stride)], free_start=True)
    plan = ilqr(problem, stages=ONE_STAGE)
    assert plan.success
    np.testing.assert_array_equal(plan.stride, stride)
    row = plan.repeated(3)
    assert row.x.shape == (31, 2) and row.u.shape == (30, 1) and row.K.shape == (30, 1, 2)
    np.testing.assert_allclose(row.x[20:], plan.x + 2.0 * stride, atol=1e-2)
    np.testing.assert_allclose(row.stride, 3.0 * stride)
    off = problem.sim.rollout_feedback(row.x[0] + 0.1, row.u, xs=row.x, Ks=row.K).x - row.x
    assert np.abs(off[-1]).max() < 1e-2  # of the 0.1 at the start


def test_a_periodic_plan_survives_a_file(tmp_path):
    plan = ilqr(oscillator([Periodic([0.6 * np.pi, 0.0])], free_start=True), stages=ONE_STAGE)
    plan.save(tmp_path / "plan.npz")
    loaded = Plan.load(tmp_path / "plan.npz")
    np.testing.assert_array_equal(loaded.stride, plan.stride)
    with pytest.raises(ValueError, match="expected a plan with its simulator"):
        loaded.repeated(2)


def test_other_plans_do_not_repeat():
    plan = ilqr(oscillator([Goal([0.0, 0.0])]), stages=ONE_STAGE)
    assert plan.stride is None
    with pytest.raises(ValueError, match="expected a periodic plan"):
        plan.repeated(2)
    part = ilqr(oscillator([Periodic(components=[1])], free_start=True), stages=ONE_STAGE)
    assert part.stride is None
    periodic = ilqr(oscillator([Periodic([0.6 * np.pi, 0.0])], free_start=True), stages=ONE_STAGE)
    with pytest.raises(ValueError, match="whole number >= 1, got 0"):
        periodic.repeated(0)
