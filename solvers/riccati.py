"""Backward pass of iLQR on stacked arrays, with gaps, regularisation and control limits, and what it promises.

With z = (dx, du), F = [A B] and n, m the sizes of dx and du:

    dx_{t+1} = F_t z_t + gap_{t+1},   dx_0 = 0,        min  sum_t  g_t . z_t + 1/2 z_t^T H_t z_t

gives du = k + K dx. A step size a scales k and the closed share of each gap, so z scales with a, and the predicted
change of cost is a d0 + a^2/2 d1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solvers.boxqp import box_qp, factor_free
from solvers.dense import add_mul_tn_symmetric, add_mul_tn_vector, add_mul_vector, cholesky_solve, copy, dot, mul
from solvers.jit import kernel
from solvers.status import Status

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]
Integers = NDArray[np.int64]


class Quadratic(NamedTuple):
    """Linear-quadratic model of a horizon of T knots; row T of `g` and `H` has no controls."""

    A: Stack  # (T, n, n)
    B: Stack  # (T, n, m)
    g: Matrix  # (T + 1, n + m) gradient of the cost
    H: Stack  # (T + 1, n + m, n + m) its Hessian, symmetric
    gaps: Matrix  # (T + 1, n), first row unused
    lo: Matrix  # (T, m) lower limit of du, or (0, m) without limits
    hi: Matrix  # (T, m)


class Regularization(NamedTuple):
    """What is added to the model while the gains are computed; the value function stays exact."""

    control: float  # times diag(damping), added to Q_uu
    value: float  # times I, added to V_xx inside Q_uu and Q_ux
    damping: Vector  # (m,) unit of `control`


class Promise(NamedTuple):
    """Result of the backward pass."""

    status: Status  # SOLVED, SINGULAR (Q_uu not positive definite) or NOT_FINITE
    knot: int  # where it stopped
    d0: float  # predicted change of cost per step size, first order
    d1: float  # second order
    gradient: float  # largest |Q_u| over controls that no limit holds


class _Work(NamedTuple):
    V: Matrix  # (n, n) Hessian of the value function at t + 1, then at t
    v: Vector  # (n,) its gradient
    F: Matrix  # (n, n + m) [A B]
    VF: Matrix  # (n, n + m)
    Q: Matrix  # (n + m, n + m) Hessian of the action value
    q: Vector  # (n + m,) its gradient
    Huu: Matrix  # (m, m) regularised block of Q
    Z: Matrix  # (m, n) regularised block -Q_ux, then packed rows of K
    W: Matrix  # (m, n) Q_uu K + Q_ux
    w: Vector  # (m,) Q_uu k + Q_u
    z: Vector  # (n + m,) linear rollout
    dx: Vector  # (n,)
    box: Vector  # (2 m^2 + 3 m,)


def work_size(n: int, m: int) -> int:
    """Floats of scratch that `backward` needs."""
    return n * n + 2 * n * (n + m) + (n + m) * (n + m) + m * m + 2 * n * m + 4 * n + 3 * m + 2 * m * m + 3 * m


@kernel
def _work_view(buffer: Vector, n: int, m: int) -> _Work:
    """Named views into one flat buffer of `work_size(n, m)` floats."""
    p = n + m
    a = n * n
    b = a + 2 * n * p
    c = b + p * p
    d = c + m * m
    e = d + 2 * n * m
    f = e + 2 * n
    g = f + 2 * p
    return _Work(
        buffer[:a].reshape((n, n)),
        buffer[e : e + n],
        buffer[a : a + n * p].reshape((n, p)),
        buffer[a + n * p : b].reshape((n, p)),
        buffer[b:c].reshape((p, p)),
        buffer[f : f + p],
        buffer[c:d].reshape((m, m)),
        buffer[d : d + n * m].reshape((m, n)),
        buffer[d + n * m : e].reshape((m, n)),
        buffer[g : g + m],
        buffer[f + p : g],
        buffer[e + n : f],
        buffer[g + m : g + 4 * m + 2 * m * m],
    )


@kernel
def _action_value(quad: Quadratic, t: int, work: _Work) -> None:
    """Q = H + F^T V F and q = g + F^T (v + V gap_{t+1}) at knot t."""
    n, m = quad.B[t].shape
    v, q = work.v, work.q
    for i in range(n):
        for j in range(n):
            work.F[i, j] = quad.A[t, i, j]
            v[j] += work.V[i, j] * quad.gaps[t + 1, i]
        for j in range(m):
            work.F[i, n + j] = quad.B[t, i, j]
    mul(work.V, work.F, work.VF)
    copy(quad.H[t], work.Q)
    add_mul_tn_symmetric(work.F, work.VF, work.Q)
    for j in range(n + m):
        q[j] = quad.g[t, j]
    add_mul_tn_vector(work.F, v, q)


@kernel
def _regularize(reg: Regularization, work: _Work) -> None:
    """Huu = Q_uu + control diag(damping) + value B^T B,  Z = -(Q_ux + value B^T A)."""
    m, n = work.Z.shape
    for i in range(m):
        for j in range(m):
            work.Huu[i, j] = work.Q[n + i, n + j]
        for j in range(n):
            work.Z[i, j] = -work.Q[n + i, j]
        work.Huu[i, i] += reg.control * reg.damping[i]
    if reg.value > 0.0:
        for k in range(n):
            for i in range(m):
                b = reg.value * work.F[k, n + i]
                for j in range(m):
                    work.Huu[i, j] += b * work.F[k, n + j]
                for j in range(n):
                    work.Z[i, j] -= b * work.F[k, j]


@kernel
def _gains(quad: Quadratic, t: int, K: Matrix, k: Vector, free: Integers, work: _Work) -> tuple[Status, int]:
    """k = argmin of the regularised Q over the limits, K = -Huu_ff^-1 Z_f on free rows f and zero on the others."""
    m, n = K.shape
    q = work.q
    nfree = m
    if quad.lo.shape[0] > 0:
        status, nfree = box_qp(work.Huu, q[n:], quad.lo[t], quad.hi[t], k, free, work.box)
        if status != Status.SOLVED:
            return status, nfree
    else:
        for i in range(m):
            free[i] = i
            k[i] = -q[n + i]
        if not factor_free(work.Huu, free, m, work.box[m * m :], work.box):
            return Status.SINGULAR, m
        cholesky_solve(work.box[: m * m].reshape((m, m)), k.reshape((m, 1)))
    for i in range(m):
        for j in range(n):
            K[i, j] = 0.0
    for i in range(nfree):
        for j in range(n):
            work.Z[i, j] = work.Z[free[i], j]  # free is sorted, so no row is overwritten before it is read
    cholesky_solve(work.box[: nfree * nfree].reshape((nfree, nfree)), work.Z[:nfree])
    for i in range(nfree):
        for j in range(n):
            K[free[i], j] = work.Z[i, j]
    return Status.SOLVED, nfree


@kernel
def _value(K: Matrix, k: Vector, work: _Work) -> None:
    """V = Q_xx + K^T (Q_uu K + Q_ux) + Q_xu K and v = q_x + K^T (Q_uu k + q_u) + Q_xu k: exact for any gains."""
    m, n = K.shape
    v, q = work.v, work.q
    for r in range(m):
        work.w[r] = q[n + r]
        for j in range(m):
            work.w[r] += work.Q[n + r, n + j] * k[j]
        for j in range(n):
            work.W[r, j] = work.Q[n + r, j]
        for i in range(m):
            a = work.Q[n + r, n + i]
            for j in range(n):
                work.W[r, j] += a * K[i, j]
    for i in range(n):
        v[i] = q[i]
        for j in range(i, n):
            work.V[i, j] = work.Q[i, j]
        for r in range(m):
            a, b = K[r, i], work.Q[n + r, i]
            v[i] += a * work.w[r] + b * k[r]
            for j in range(i, n):
                work.V[i, j] += a * work.W[r, j] + b * K[r, j]
    for i in range(n):
        for j in range(i):
            work.V[i, j] = work.V[j, i]


@kernel
def _predict(quad: Quadratic, K: Stack, k: Matrix, work: _Work) -> tuple[float, float]:
    """(d0, d1) from the linear rollout of the full step."""
    T, m, n = K.shape
    d0, d1 = 0.0, 0.0
    for i in range(n):
        work.dx[i] = 0.0
    for t in range(T + 1):
        for i in range(n):
            work.z[i] = work.dx[i]
        for i in range(m):
            work.z[n + i] = k[t, i] + dot(K[t, i], work.dx) if t < T else 0.0
        d0 += dot(quad.g[t], work.z)
        for i in range(n + m):
            if work.z[i] != 0.0:
                d1 += work.z[i] * dot(quad.H[t, i], work.z)
        if t < T:
            for i in range(n):
                work.dx[i] = quad.gaps[t + 1, i] + dot(quad.A[t, i], work.z) + dot(quad.B[t, i], work.z[n:])
    return d0, d1


@kernel
def backward(quad: Quadratic, reg: Regularization, K: Stack, k: Matrix, free: Integers, buffer: Vector) -> Promise:
    """Gains K (T, m, n), k (T, m) of the regularised model, and what the full step promises.

    With limits, k on entry is the guess of the box QPs. free: (m,) integer scratch; buffer: (work_size(n, m),).
    """
    T, m, n = K.shape
    work = _work_view(buffer, n, m)
    for i in range(n):
        work.v[i] = quad.g[T, i]
        for j in range(n):
            work.V[i, j] = quad.H[T, i, j]
    gradient = 0.0
    for t in range(T - 1, -1, -1):
        _action_value(quad, t, work)
        _regularize(reg, work)
        status, nfree = _gains(quad, t, K[t], k[t], free, work)
        if status != Status.SOLVED:
            return Promise(status, t, 0.0, 0.0, gradient)
        for i in range(nfree):
            gradient = max(gradient, abs(work.q[n + free[i]]))
        _value(K[t], k[t], work)
    d0, d1 = _predict(quad, K, k, work)
    finite = abs(d0) < np.inf and abs(d1) < np.inf
    return Promise(Status.SOLVED if finite else Status.NOT_FINITE, 0, d0, d1, gradient)
