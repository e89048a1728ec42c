"""The box QP against SciPy's bounded least squares and against its optimality conditions."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from solvers.boxqp import box_qp
from solvers.status import Status

pytestmark = pytest.mark.kernel


def solve(H, g, lo, hi, x=None):
    n = len(g)
    x = np.zeros(n) if x is None else x.copy()
    free, work = np.full(n, -1), np.full(2 * n * n + 3 * n, np.nan)
    status, nfree = box_qp(H, g, lo, hi, x, free, work)
    return status, x, free[:nfree], work


@pytest.mark.parametrize("seed", range(40))
def test_same_minimum_as_scipy(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    M, b = rng.normal(size=(n + 2, n)), 3.0 * rng.normal(size=n + 2)
    lo, hi = -rng.random(n), rng.random(n)
    H, g = M.T @ M, -M.T @ b
    status, x, free, work = solve(H, g, lo, hi, rng.normal(size=n))
    assert status == Status.SOLVED
    np.testing.assert_allclose(x, lsq_linear(M, b, bounds=(lo, hi), tol=1e-14).x, atol=1e-6)
    gradient = H @ x + g
    held = np.setdiff1d(np.arange(n), free)
    assert np.abs(gradient[free]).max(initial=0.0) < 1e-9
    assert np.all(np.where(x[held] == lo[held], gradient[held] >= 0, (x[held] == hi[held]) & (gradient[held] <= 0)))
    f = len(free)
    L = np.tril(work[: f * f].reshape(f, f))
    np.testing.assert_allclose(L @ L.T, H[np.ix_(free, free)], atol=1e-9)


def test_without_limits_it_is_a_linear_solve():
    H, g = np.array([[4.0, 1.0], [1.0, 3.0]]), np.array([1.0, -2.0])
    status, x, free, _ = solve(H, g, np.full(2, -np.inf), np.full(2, np.inf))
    assert status == Status.SOLVED and len(free) == 2
    np.testing.assert_allclose(x, -np.linalg.solve(H, g), rtol=1e-12)


def test_all_controls_held():
    status, x, free, _ = solve(np.eye(2), np.array([5.0, -5.0]), -np.ones(2), np.ones(2))
    assert status == Status.SOLVED and len(free) == 0
    np.testing.assert_array_equal(x, [-1.0, 1.0])


def test_not_positive_definite_is_a_status():
    assert solve(-np.eye(2), np.ones(2), -np.ones(2), np.ones(2))[0] == Status.SINGULAR
    assert solve(np.full((2, 2), np.nan), np.ones(2), -np.ones(2), np.ones(2))[0] == Status.SINGULAR
