"""The backward pass against a slow NumPy recursion, a dense solve of the horizon, and SciPy's Riccati solution."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from solvers.riccati import Quadratic, Regularization, backward, work_size
from solvers.status import Status


def random_model(T, n, m, seed, limit=np.inf):
    rng = np.random.default_rng(seed)
    M = rng.normal(size=(T + 1, n + m, n + m))
    H, g = M @ M.transpose(0, 2, 1) + 0.1 * np.eye(n + m), rng.normal(size=(T + 1, n + m))
    g[T, n:], H[T, n:], H[T, :, n:] = 0.0, 0.0, 0.0
    A, B = rng.normal(size=(T, n, n)) / np.sqrt(n), rng.normal(size=(T, n, m))
    return Quadratic(A, B, g, H, rng.normal(size=(T + 1, n)), np.full((T, m), -limit), np.full((T, m), limit))


def run(model, control=0.0, value=0.0, unit=None):
    T, n, m = model.B.shape
    K, k = np.full((T, m, n), np.nan), np.zeros((T, m))
    reg = Regularization(control, value, np.ones(m) if unit is None else unit)
    buffer = np.full(work_size(n, m), np.nan)
    return backward(model, reg, K, k, np.zeros(m, dtype=np.int64), buffer), K, k


def numpy_gains(model, control=0.0, value=0.0):
    """Riccati recursion with the value update that holds for any gains."""
    T, n, m = model.B.shape
    V, v = model.H[T, :n, :n], model.g[T, :n]
    K, k = np.zeros((T, m, n)), np.zeros((T, m))
    for t in reversed(range(T)):
        F = np.hstack([model.A[t], model.B[t]])
        Q = model.H[t] + F.T @ V @ F
        q = model.g[t] + F.T @ (v + V @ model.gaps[t + 1])
        R = Q + value * F.T @ F
        Huu = R[n:, n:] + control * np.eye(m)
        K[t], k[t] = -np.linalg.solve(Huu, R[n:, :n]), -np.linalg.solve(Huu, q[n:])
        Z = np.vstack([np.eye(n), K[t]])
        V, v = Z.T @ Q @ Z, Z.T @ (q + Q[:, n:] @ k[t])
    return K, k


def linear_rollout(model, K, k, alpha=1.0):
    """Change of cost along the gains, with the share alpha of every gap closed."""
    T, n, _ = model.B.shape
    dx, change = np.zeros(n), 0.0
    for t in range(T):
        z = np.concatenate([dx, alpha * k[t] + K[t] @ dx])
        change += model.g[t] @ z + 0.5 * z @ model.H[t] @ z
        dx = model.A[t] @ dx + model.B[t] @ z[n:] + alpha * model.gaps[t + 1]
    return change + model.g[T, :n] @ dx + 0.5 * dx @ model.H[T, :n, :n] @ dx


@pytest.mark.parametrize("n, m", [(1, 1), (4, 2), (14, 3), (36, 12)])
@pytest.mark.parametrize("control, value", [(0.0, 0.0), (0.7, 0.0), (0.2, 0.5)])
def test_gains_of_the_slow_recursion(n, m, control, value):
    model = random_model(8, n, m, seed=n)
    predicted, K, k = run(model, control, value)
    K_ref, k_ref = numpy_gains(model, control, value)
    assert predicted.status == Status.SOLVED
    np.testing.assert_allclose(K, K_ref, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(k, k_ref, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("alpha", [1.0, 0.5, 0.1])
def test_the_prediction_is_the_change_of_the_linear_rollout(alpha):
    model = random_model(9, 5, 2, seed=3)
    predicted, K, k = run(model, control=0.3)
    expected = linear_rollout(model, K, k, alpha)
    np.testing.assert_allclose(alpha * predicted.d0 + 0.5 * alpha**2 * predicted.d1, expected, rtol=1e-9)


def test_full_step_solves_the_dense_problem_with_gaps():
    T, n, m = 5, 3, 2
    model = random_model(T, n, m, seed=5)
    _, K, k = run(model)
    # x stacked as affine function of u stacked, then one dense solve
    effect, offset = np.zeros((T + 1, n, T * m)), np.zeros((T + 1, n))
    for t in range(T):
        effect[t + 1] = model.A[t] @ effect[t]
        effect[t + 1][:, t * m : (t + 1) * m] += model.B[t]
        offset[t + 1] = model.A[t] @ offset[t] + model.gaps[t + 1]
    hessian, gradient = np.zeros((T * m, T * m)), np.zeros(T * m)
    for t in range(T + 1):
        pick = np.zeros((m, T * m))
        if t < T:
            pick[:, t * m : (t + 1) * m] = np.eye(m)
        Z, z = np.vstack([effect[t], pick]), np.concatenate([offset[t], np.zeros(m)])
        hessian += Z.T @ model.H[t] @ Z
        gradient += Z.T @ (model.g[t] + model.H[t] @ z)
    u = -np.linalg.solve(hessian, gradient).reshape(T, m)
    dx = np.zeros(n)
    for t in range(T):
        du = k[t] + K[t] @ dx
        np.testing.assert_allclose(du, u[t], rtol=1e-8, atol=1e-9)
        dx = model.A[t] @ dx + model.B[t] @ du + model.gaps[t + 1]


def test_gains_converge_to_the_riccati_solution():
    rng = np.random.default_rng(7)
    n, m, T = 4, 2, 200
    A, B = rng.normal(size=(n, n)) / 2, rng.normal(size=(n, m))
    Qx, R = np.diag(rng.random(n) + 0.1), np.diag(rng.random(m) + 0.1)
    H = np.zeros((T + 1, n + m, n + m))
    H[:, :n, :n] = Qx
    H[:T, n:, n:] = R
    free = np.full((T, m), np.inf)
    model = Quadratic(
        np.tile(A, (T, 1, 1)), np.tile(B, (T, 1, 1)), np.zeros((T + 1, n + m)), H, np.zeros((T + 1, n)), -free, free
    )
    _, K, _ = run(model)
    P = solve_discrete_are(A, B, Qx, R)
    np.testing.assert_allclose(K[0], -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), rtol=1e-9, atol=1e-10)


def test_limits_hold_and_held_rows_have_no_feedback():
    model = random_model(10, 6, 3, seed=9, limit=0.2)
    predicted, K, k = run(model)
    assert predicted.status == Status.SOLVED
    assert np.abs(k).max() <= 0.2
    held = np.all(K == 0.0, axis=2)
    assert held.any() and not held.all()
    np.testing.assert_allclose(np.abs(k[held]), 0.2)
    assert np.all(np.abs(k[~held]) < 0.2)


def test_indefinite_control_hessian_names_the_knot():
    model = random_model(6, 3, 2, seed=11)
    model.H[3, 3:, 3:] = -1e6 * np.eye(2)
    predicted, _, _ = run(model)
    assert predicted.status == Status.SINGULAR and predicted.knot == 3
    assert run(model, control=1e7)[0].status == Status.SOLVED


def test_nan_is_reported():
    model = random_model(6, 3, 2, seed=12)
    model.A[2, 0, 0] = np.nan
    assert run(model)[0].status in (Status.SINGULAR, Status.NOT_FINITE)
    model = random_model(6, 3, 2, seed=12)
    model.g[2, 0] = np.nan
    assert run(model)[0].status != Status.SOLVED
