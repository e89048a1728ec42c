"""Dense kernels against NumPy, with poisoned outputs."""

import numpy as np
import pytest

from solvers import dense

pytestmark = pytest.mark.kernel


@pytest.mark.parametrize("n, p, m", [(1, 1, 1), (3, 4, 5), (7, 9, 2), (14, 14, 17), (12, 8, 6), (13, 6, 8), (9, 5, 23)])
def test_add_mul_tn(n, p, m):
    rng = np.random.default_rng(0)
    A, B, start = rng.normal(size=(p, n)), rng.normal(size=(p, m)), rng.normal(size=(n, m))
    memory = np.full(n * m + 16, np.nan)
    out = memory[8:-8].reshape(n, m)
    out[:] = start
    dense.add_mul_tn(A, B, out, False)
    np.testing.assert_allclose(out, start + A.T @ B, rtol=1e-12, atol=1e-12)
    assert np.isnan(memory[:8]).all() and np.isnan(memory[-8:]).all()


@pytest.mark.parametrize("p, n", [(1, 1), (4, 3), (6, 7), (14, 17), (8, 12), (5, 8), (7, 22)])
def test_add_mul_tn_symmetric(p, n):
    rng = np.random.default_rng(1)
    A, S = rng.normal(size=(p, n)), rng.normal(size=(p, p))
    S, start = S + S.T, rng.normal(size=(n, n))
    start = start + start.T
    out = start.copy()
    dense.add_mul_tn(A, S @ A, out, True)
    np.testing.assert_allclose(out, start + A.T @ S @ A, rtol=1e-12, atol=1e-12)


def test_dot():
    assert dense.dot(np.array([1.0, 2.0]), np.array([3.0, -4.0])) == -5.0
    assert dense.dot(np.arange(7.0), np.arange(7.0)) == 91.0


def test_copy_and_axpy():
    A, out = np.arange(6.0).reshape(2, 3), np.full((2, 3), np.nan)
    dense.copy(A, out)
    dense.axpy(2.0, A[0], out[1])
    np.testing.assert_array_equal(out, [[0.0, 1.0, 2.0], [3.0, 6.0, 9.0]])
    dense.copy_vector(A[1], out[0])
    np.testing.assert_array_equal(out[0], A[1])


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_cholesky_and_solve(n):
    rng = np.random.default_rng(2)
    M = rng.normal(size=(n, n))
    A, L = M @ M.T + np.eye(n), np.full((n, n), np.nan)
    assert dense.cholesky(A, L) == n
    np.testing.assert_allclose(np.tril(L), np.linalg.cholesky(A), rtol=1e-12, atol=1e-12)
    X = rng.normal(size=(n, 3))
    out = X.copy()
    dense.cholesky_solve(L, out)
    np.testing.assert_allclose(A @ out, X, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_cholesky_names_the_row_that_is_not_positive(bad):
    A = np.diag([1.0, 2.0, bad, 1.0])
    assert dense.cholesky(A, np.full((4, 4), np.nan)) == 2
