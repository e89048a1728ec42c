"""LU factors against NumPy."""

import numpy as np
import pytest

from solvers.lanes import LANES
from solvers.lu import lu_factor, lu_sign, lu_solve, lu_solve_lanes

pytestmark = pytest.mark.kernel


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_sign_of_the_determinant_and_solution(n):
    rng = np.random.default_rng(n)
    signs = set()
    for _ in range(20):
        A, b = rng.normal(size=(n, n)), rng.normal(size=n)
        factors, x = A.ravel().copy(), b.copy()
        swaps = lu_factor(factors, n)
        lu_solve(factors, n, swaps, x, 0)
        np.testing.assert_allclose(A @ x, b, rtol=1e-9, atol=1e-9)
        assert lu_sign(factors, n, swaps) == np.sign(np.linalg.det(A))
        signs.add(lu_sign(factors, n, swaps))
    assert signs == {-1, 1}


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_rows_of_right_hand_sides(n):
    rng = np.random.default_rng(n)
    exchanges = set()
    for _ in range(40):
        A, B = rng.normal(size=(n, n)), rng.normal(size=(n + 3, 2 * LANES))
        factors, X = A.ravel().copy(), B.copy()
        swaps = lu_factor(factors, n)
        exchanges.add(swaps)
        lu_solve_lanes(factors, n, swaps, X, 2, 3)
        inside = np.s_[2 : 2 + n, 3 : 3 + LANES]
        np.testing.assert_allclose(A @ X[inside], B[inside], rtol=1e-9, atol=1e-9)
        X[inside] = B[inside]
        np.testing.assert_array_equal(X, B)
    assert len(exchanges) >= min(n * (n - 1), 20)  # all orders of two and three rows


def test_a_singular_matrix_is_found():
    assert lu_factor(np.zeros(9), 3) == -1
