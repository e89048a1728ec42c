"""Backward pass of iLQR on stacked arrays, with gaps, regularisation and control limits, and what it promises.

    dx_{t+1} = A_t dx_t + B_t du_t + gap_{t+1},                              dx_0 = 0
    min  sum_t  l_x dx + l_u du + 1/2 (dx^T l_xx dx + 2 du^T l_ux dx + du^T l_uu du)

gives du = k + K dx. A step size a scales k and the closed share of each gap, so dx and du scale with a and the predicted
change of cost is a d0 + a^2/2 d1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solvers.boxqp import box_qp
from solvers.dense import (
    add_mul,
    add_mul_tn,
    add_mul_tn_upper,
    add_mul_tn_vector,
    add_mul_vector,
    cholesky,
    cholesky_solve,
    cholesky_solve_vector,
    copy,
    copy_vector,
    dot,
    fill,
    mirror_upper,
    mul,
)
from solvers.jit import kernel
from solvers.status import Status

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]


class Quadratic(NamedTuple):
    """Linear-quadratic model of a horizon of T knots, n tangent states, m controls."""

    A: Stack  # (T, n, n)
    B: Stack  # (T, n, m)
    lx: Matrix  # (T + 1, n)
    lu: Matrix  # (T, m)
    lxx: Stack  # (T + 1, n, n)
    luu: Stack  # (T, m, m)
    lux: Stack  # (T, m, n)
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
    VA: Matrix  # (n, n)
    VB: Matrix  # (n, m)
    Qxx: Matrix  # (n, n)
    Qx: Vector  # (n,)
    Quu: Matrix  # (m, m)
    Qu: Vector  # (m,)
    Qux: Matrix  # (m, n)
    H: Matrix  # (m, m) regularised Quu
    G: Matrix  # (m, n) regularised Qux; packed solution on free rows
    W: Matrix  # (m, n) Quu K + Qux
    w: Vector  # (m,) Quu k + Qu
    dx: Vector  # (n,)
    dx_next: Vector  # (n,)
    du: Vector  # (m,)
    row: Vector  # (n,)
    box: Vector  # (2 m^2 + 3 m,)


def work_size(n: int, m: int) -> int:
    """Floats of scratch that `backward` needs."""
    return 3 * n * n + 4 * n * m + 5 * n + 3 * m + 4 * m * m + 3 * m


@kernel
def _work_view(buffer: Vector, n: int, m: int) -> _Work:
    """Named views into one flat buffer of `work_size(n, m)` floats."""
    nn, nm, mm = n * n, n * m, m * m
    mats = 3 * nn
    mixed = mats + 4 * nm
    small = mixed + 2 * mm
    rows = small + 5 * n
    ends = rows + 3 * m
    return _Work(
        buffer[:nn].reshape((n, n)),
        buffer[small : small + n],
        buffer[nn : 2 * nn].reshape((n, n)),
        buffer[mats : mats + nm].reshape((n, m)),
        buffer[2 * nn : mats].reshape((n, n)),
        buffer[small + n : small + 2 * n],
        buffer[mixed : mixed + mm].reshape((m, m)),
        buffer[rows : rows + m],
        buffer[mats + nm : mats + 2 * nm].reshape((m, n)),
        buffer[mixed + mm : small].reshape((m, m)),
        buffer[mats + 2 * nm : mats + 3 * nm].reshape((m, n)),
        buffer[mats + 3 * nm : mixed].reshape((m, n)),
        buffer[rows + m : rows + 2 * m],
        buffer[small + 2 * n : small + 3 * n],
        buffer[small + 3 * n : small + 4 * n],
        buffer[rows + 2 * m : ends],
        buffer[small + 4 * n : rows],
        buffer[ends : ends + 2 * mm + 3 * m],
    )


@kernel
def _action_value(quad: Quadratic, t: int, work: _Work) -> None:
    """Q = l + f^T v+ and f^T V f at knot t, with v+ = v + V gap_{t+1}."""
    A, B = quad.A[t], quad.B[t]
    add_mul_tn_vector(work.V, quad.gaps[t + 1], work.v)
    mul(work.V, A, work.VA)
    mul(work.V, B, work.VB)
    copy_vector(quad.lx[t], work.Qx)
    add_mul_tn_vector(A, work.v, work.Qx)
    copy_vector(quad.lu[t], work.Qu)
    add_mul_tn_vector(B, work.v, work.Qu)
    copy(quad.lxx[t], work.Qxx)
    add_mul_tn_upper(A, work.VA, work.Qxx)
    copy(quad.luu[t], work.Quu)
    add_mul_tn(B, work.VB, work.Quu)
    copy(quad.lux[t], work.Qux)
    add_mul_tn(B, work.VA, work.Qux)


@kernel
def _regularize(quad: Quadratic, t: int, reg: Regularization, work: _Work) -> None:
    """H = Q_uu + control diag(damping) + value B^T B,  G = Q_ux + value B^T A."""
    copy(work.Quu, work.H)
    copy(work.Qux, work.G)
    n, m = quad.B[t].shape
    for i in range(m):
        work.H[i, i] += reg.control * reg.damping[i]
    if reg.value > 0.0:
        for i in range(n):
            for j in range(m):
                work.VB[i, j] = reg.value * quad.B[t, i, j]
        add_mul_tn(work.VB, quad.B[t], work.H)
        add_mul_tn(work.VB, quad.A[t], work.G)


@kernel
def _free_gains(work: _Work, K: Matrix, k: Vector) -> Status:
    """k = -H^-1 Q_u, K = -H^-1 G without control limits."""
    m, n = K.shape
    factor = work.box[: m * m].reshape((m, m))
    if cholesky(work.H, factor) < m:
        return Status.SINGULAR
    for i in range(m):
        k[i] = -work.Qu[i]
        for j in range(n):
            K[i, j] = -work.G[i, j]
    cholesky_solve_vector(factor, k)
    cholesky_solve(factor, K)
    return Status.SOLVED


@kernel
def _limited_gains(work: _Work, lo: Vector, hi: Vector, free: NDArray[np.int64], K: Matrix, k: Vector) -> Status:
    """k from the box QP, started at the last k; K = -H_ff^-1 G_f on free rows and zero on rows held by a limit."""
    m, n = K.shape
    status, nfree = box_qp(work.H, work.Qu, lo, hi, k, free, work.box)
    if status != Status.SOLVED:
        return status
    for i in range(nfree):
        for j in range(n):
            work.W[i, j] = -work.G[free[i], j]
    fill(0.0, K)
    for i in range(m):
        work.w[i] = 0.0
    cholesky_solve(work.box[: nfree * nfree].reshape((nfree, nfree)), work.W[:nfree])
    for i in range(nfree):
        work.w[free[i]] = 1.0
        for j in range(n):
            K[free[i], j] = work.W[i, j]
    return Status.SOLVED


@kernel
def _value(work: _Work, K: Matrix, k: Vector) -> None:
    """V = Q_xx + K^T (Q_uu K + Q_ux) + Q_ux^T K and v = Q_x + K^T (Q_uu k + Q_u) + Q_ux^T k: exact for any gains."""
    copy(work.Qux, work.W)
    add_mul(work.Quu, K, work.W)
    copy_vector(work.Qu, work.w)
    add_mul_vector(work.Quu, k, work.w)
    copy(work.Qxx, work.V)
    add_mul_tn_upper(K, work.W, work.V)
    add_mul_tn_upper(work.Qux, K, work.V)
    mirror_upper(work.V)
    copy_vector(work.Qx, work.v)
    add_mul_tn_vector(K, work.w, work.v)
    add_mul_tn_vector(work.Qux, k, work.v)


@kernel
def _quadratic_form(H: Matrix, x: Vector, y: Vector) -> float:
    """y^T H x"""
    total = 0.0
    for i in range(y.shape[0]):
        if y[i] != 0.0:
            total += y[i] * dot(H[i], x)
    return total


@kernel
def _predict(quad: Quadratic, K: Stack, k: Matrix, work: _Work) -> tuple[float, float]:
    """(d0, d1) from the linear rollout of the full step."""
    T = k.shape[0]
    d0, d1 = 0.0, 0.0
    for i in range(work.dx.shape[0]):
        work.dx[i] = 0.0
    for t in range(T):
        copy_vector(k[t], work.du)
        add_mul_vector(K[t], work.dx, work.du)
        d0 += dot(quad.lx[t], work.dx) + dot(quad.lu[t], work.du)
        d1 += _quadratic_form(quad.lxx[t], work.dx, work.dx) + _quadratic_form(quad.luu[t], work.du, work.du)
        d1 += 2.0 * _quadratic_form(quad.lux[t], work.dx, work.du)
        copy_vector(quad.gaps[t + 1], work.dx_next)
        add_mul_vector(quad.A[t], work.dx, work.dx_next)
        add_mul_vector(quad.B[t], work.du, work.dx_next)
        copy_vector(work.dx_next, work.dx)
    d0 += dot(quad.lx[T], work.dx)
    d1 += _quadratic_form(quad.lxx[T], work.dx, work.dx)
    return d0, d1


@kernel
def backward(quad: Quadratic, reg: Regularization, K: Stack, k: Matrix, free: NDArray[np.int64], buffer: Vector) -> Promise:
    """Gains K (T, m, n), k (T, m) of the regularised model, and what the full step promises.

    With limits, k on entry is the guess of the box QPs. free: (m,) integer scratch; buffer: (work_size(n, m),).
    """
    T, m = k.shape
    n = quad.lx.shape[1]
    limited = quad.lo.shape[0] > 0
    work = _work_view(buffer, n, m)
    copy(quad.lxx[T], work.V)
    copy_vector(quad.lx[T], work.v)
    gradient = 0.0
    for t in range(T - 1, -1, -1):
        _action_value(quad, t, work)
        _regularize(quad, t, reg, work)
        if limited:
            status = _limited_gains(work, quad.lo[t], quad.hi[t], free, K[t], k[t])
        else:
            status = _free_gains(work, K[t], k[t])
        if status != Status.SOLVED:
            return Promise(status, t, 0.0, 0.0, gradient)
        for i in range(m):
            if not limited or work.w[i] != 0.0:
                gradient = max(gradient, abs(work.Qu[i]))
        _value(work, K[t], k[t])
    d0, d1 = _predict(quad, K, k, work)
    if not (abs(d0) < np.inf and abs(d1) < np.inf):
        return Promise(Status.NOT_FINITE, 0, d0, d1, gradient)
    return Promise(Status.SOLVED, 0, d0, d1, gradient)
