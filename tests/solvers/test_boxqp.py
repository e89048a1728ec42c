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


def test_a_start_near_the_solution_is_finished():
    """The remaining decrease is below the rounding error of the value, so comparing values decides nothing."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        n = 12
        M, g = rng.normal(size=(3, n)), 2.0 * rng.normal(size=n)
        H = np.eye(n) + 0.1 * M.T @ M
        lo, hi = np.full(n, -60.0), np.where(np.arange(n) == 9, 0.0, 60.0)
        _, exact, _, _ = solve(H, g, lo, hi)
        for off in (3e-9, 1e-9, 3e-10, 1e-10):
            status, x, _, _ = solve(H, g, lo, hi, exact * (1.0 + off * rng.normal(size=n)))
            assert status == Status.SOLVED
            np.testing.assert_allclose(x, exact, atol=1e-11)


def test_terms_that_cancel_are_solved_to_their_rounding():
    """The free gradient is the difference of terms 1e9 times larger than it and g are."""
    H = np.array([[1e6, -1e6, 0.3], [-1e6, 1e6 + 1.0, 0.1], [0.3, 0.1, 1.0]])
    g = np.array([1e-6, 1e-6, -10.0])
    status, x, _, _ = solve(H, g, np.full(3, -100.0), np.full(3, 100.0))
    assert status == Status.SOLVED
    np.testing.assert_allclose(H @ x + g, 0.0, atol=1e-8)


def test_all_controls_held():
    status, x, free, _ = solve(np.eye(2), np.array([5.0, -5.0]), -np.ones(2), np.ones(2))
    assert status == Status.SOLVED and len(free) == 0
    np.testing.assert_array_equal(x, [-1.0, 1.0])


def test_not_positive_definite_is_a_status():
    assert solve(-np.eye(2), np.ones(2), -np.ones(2), np.ones(2))[0] == Status.SINGULAR
    assert solve(np.full((2, 2), np.nan), np.ones(2), -np.ones(2), np.ones(2))[0] == Status.SINGULAR
