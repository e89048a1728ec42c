"""Backward pass of iLQR on stacked arrays, with gaps, regularisation and control limits; its predicted cost change.

With z = (dx, du), F = [A B] and n, m the sizes of dx and du:

    dx_{t+1} = F_t z_t + gap_{t+1},   dx_0 = 0,        min  sum_t  g_t . z_t + 1/2 z_t^T H_t z_t

gives du = k + K dx. A step size a scales k and the closed share of each gap, so z scales with a, and the predicted
change of cost is a d0 + a^2/2 d1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solvers.boxqp import box_qp
from solvers.compiler import PAUSE, inlined, kernel, seconds
from solvers.dense import add_mul_tn, axpy, cholesky_solve, dot
from solvers.status import Status
from solvers.types import Integers, Matrix, Stack, Vector

_SOLVED, _NOT_FINITE = int(Status.SOLVED), int(Status.NOT_FINITE)
_LOOK = 16  # knots between two looks at the clock


class Quadratic(NamedTuple):
    """Linear-quadratic model of a horizon of T knots; row T of `g` and `H` has no controls."""

    A: Stack  # (T, n, n)
    B: Stack  # (T, n, m)
    g: Matrix  # (T + 1, n + m) gradient of the cost
    H: Stack  # (T + 1, n + m, n + m) its Hessian, symmetric
    gaps: Matrix  # (T + 1, n), first row unused
    lo: Matrix  # (T, m) lower limit of du, -inf without one
    hi: Matrix  # (T, m) upper limit of du, inf without one


class Regularization(NamedTuple):
    """Regularisation of the model for the gains; the value function stays exact."""

    control: float  # times diag(unit), added to Q_uu
    value: float  # times I, added to V_xx inside Q_uu and Q_ux
    unit: Vector  # (m,) unit of `control`


class PredictedChange(NamedTuple):
    """Result of the backward pass."""

    status: Status  # SOLVED, SINGULAR (Q_uu not positive definite) or NOT_FINITE
    knot: int  # where it stopped
    d0: float  # predicted change of cost per step size, first order
    d1: float  # second order
    gradient: float  # largest |Q_u| over controls that no limit holds


def work_size(n: int, m: int) -> int:
    """Floats of scratch that `backward` needs."""
    p = n + m
    return n * n + 2 * n * p + p * p + 5 * m * n + m * m + 2 * n + 3 * p + m + 2 * m * m + 3 * m


def value_hessian(buffer: Vector, n: int) -> Matrix:
    """(n, n) Hessian of the value at the first knot, from the scratch of the last `backward`."""
    return buffer[: n * n].reshape((n, n))


@inlined
def _action_value(quad: Quadratic, t: int, V: Matrix, v: Vector, FV: Stack, Q: Matrix, q: Vector) -> None:
    """Q = H + F^T V F and q = g + F^T (v + V gap_{t+1}) at knot t.   FV: (2, n, n + m) scratch."""
    n = v.shape[0]
    F, VF = FV[0], FV[1]
    for i in range(n):
        a, b, f, fb, vf = quad.A[t, i], quad.B[t, i], F[i], F[i, n:], VF[i]
        for j in range(n):
            f[j] = a[j]
        for j in range(b.shape[0]):
            fb[j] = b[j]
        for j in range(vf.shape[0]):
            vf[j] = 0.0
        if quad.gaps[t + 1, i] != 0.0:
            axpy(quad.gaps[t + 1, i], V[i], v)
    for i in range(q.shape[0]):
        q[i] = quad.g[t, i]
        h, out = quad.H[t, i], Q[i]
        for j in range(q.shape[0]):
            out[j] = h[j]
    add_mul_tn(V, F, VF, False)
    add_mul_tn(F, VF, Q, True)
    for i in range(n):
        axpy(v[i], F[i], q)


@inlined
def _regularize(reg: Regularization, F: Matrix, Q: Matrix, Huu: Matrix, Z: Matrix) -> None:
    """Huu = Q_uu + control diag(unit) + value B^T B,  Z = -(Q_ux + value B^T A)."""
    m, n = Z.shape
    for i in range(m):
        for j in range(m):
            Huu[i, j] = Q[n + i, n + j]
        for j in range(n):
            Z[i, j] = -Q[n + i, j]
        Huu[i, i] += reg.control * reg.unit[i]
        if reg.value > 0.0:
            for k in range(n):
                b = reg.value * F[k, n + i]
                for j in range(m):
                    Huu[i, j] += b * F[k, n + j]
                for j in range(n):
                    Z[i, j] -= b * F[k, j]


@inlined
def _gains(Z: Matrix, free: Integers, nfree: int, factor: Vector, K: Matrix) -> None:
    """K = L^-T L^-1 Z on free rows, zero on the others; L packed (nfree, nfree) in `factor`. Z is used up."""
    m, n = K.shape
    for i in range(nfree):
        for j in range(n):
            Z[i, j] = Z[free[i], j]  # free is sorted, so no row is overwritten before it is read
    cholesky_solve(factor[: nfree * nfree].reshape((nfree, nfree)), Z[:nfree])
    for i in range(m):
        for j in range(n):
            K[i, j] = 0.0
    for i in range(nfree):
        for j in range(n):
            K[free[i], j] = Z[i, j]


@inlined
def _value(
    gains: tuple[Matrix, Vector],
    Q: Matrix,
    q: Vector,
    scratch: tuple[Stack, Matrix, Vector],
    V: Matrix,
    v: Vector,
) -> None:
    """V = Q_xx + K^T W + Q_xu K and v = q_x + K^T w + Q_xu k with W = Q_ux + Q_uu K, w = q_u + Q_uu k: exact for any
    gains (K, k).   scratch: CD (2, 2 m, n), for (K, Q_ux) and (W, K), whose product is the change of Q_xx; Quu (m, m);
    w (m,).
    """
    (K, k), (CD, Quu, w) = gains, scratch
    m, n = K.shape
    C, D = CD[0], CD[1]
    for r in range(m):
        w[r] = q[n + r] + dot(Q[n + r, n:], k)
        a, b = K[r], Q[n + r]
        c, d, e, f = C[r], C[m + r], D[r], D[m + r]
        for j in range(n):
            c[j] = a[j]
            f[j] = a[j]
            d[j] = b[j]
            e[j] = b[j]
        for i in range(m):
            Quu[r, i] = Q[n + r, n + i]
    add_mul_tn(Quu, K, D[:m], False)
    for i in range(n):
        v[i] = q[i]
        a, b = V[i], Q[i]
        for j in range(n):
            a[j] = b[j]
    for r in range(m):
        axpy(w[r], K[r], v)
        axpy(k[r], C[m + r], v)
    add_mul_tn(C, D, V, True)


@inlined
def _predict(quad: Quadratic, K: Stack, k: Matrix, z: Vector, y: Vector, dx: Vector) -> tuple[float, float]:
    """(d0, d1) from the linear rollout of the full step."""
    T, m, n = K.shape
    d0, d1 = 0.0, 0.0
    for i in range(n):
        dx[i] = 0.0
    for t in range(T + 1):
        for i in range(n):
            z[i] = dx[i]
        for i in range(m):
            z[n + i] = k[t, i] + dot(K[t, i], dx) if t < T else 0.0
        for i in range(n + m):
            y[i] = 0.0
        for i in range(n + m):
            if z[i] != 0.0:
                axpy(z[i], quad.H[t, i], y)
        d0 += dot(quad.g[t], z)
        d1 += dot(y, z)
        if t < T:
            for i in range(n):
                dx[i] = quad.gaps[t + 1, i] + dot(quad.A[t, i], z[:n]) + dot(quad.B[t, i], z[n:])
    return d0, d1


def backward(
    quad: Quadratic, reg: Regularization, K: Stack, k: Matrix, free: Integers, buffer: Vector
) -> PredictedChange:
    """Gains K (T, m, n), k (T, m) of the regularised model, and the change predicted for the full step.

    k on entry is the guess of the box QPs. free: (m,) integer scratch; buffer: (work_size(n, m),). The horizon is
    processed in pieces, so that Python can handle Ctrl-C between them.
    """
    left, gradient = len(K), 0.0
    while True:
        until = (left, gradient, seconds() + PAUSE)
        status, left, d0, d1, gradient = backward_knots(quad, reg, K, k, free, buffer, until)
        if left == 0 or status != _SOLVED:
            return PredictedChange(Status(status), max(left - 1, 0), d0, d1, gradient)


@kernel
def backward_knots(
    quad: Quadratic, reg: Regularization, K: Stack, k: Matrix, free: Integers, buffer: Vector,
    until: tuple[int, float, float],
) -> tuple[int, int, float, float, float]:  # fmt: skip
    """`backward` for a first part of the knots, once the others are done.

    until: the number of these knots, the gradient so far, and the moment to pause [s].

    Returns the fields of the PredictedChange, with the number of knots that are left in the place of the knot.
    """
    T, m, n = K.shape
    p = n + m
    a = n * n
    b = a + 2 * n * p
    c = b + p * p
    d = c + m * n
    e = d + 4 * m * n
    f = e + m * m
    h = f + 2 * n
    V, FV, Q = buffer[:a].reshape((n, n)), buffer[a:b].reshape((2, n, p)), buffer[b:c].reshape((p, p))
    Z, CD = buffer[c:d].reshape((m, n)), buffer[d:e].reshape((2, 2 * m, n))
    Huu, v, dx = buffer[e:f].reshape((m, m)), buffer[f : f + n], buffer[f + n : h]
    q, z, y = buffer[h : h + p], buffer[h + p : h + 2 * p], buffer[h + 2 * p : h + 3 * p]
    w, box = buffer[h + 3 * p : h + 3 * p + m], buffer[h + 3 * p + m :]
    left, gradient, deadline = until
    if left == T:
        for i in range(n):
            v[i] = quad.g[T, i]
            for j in range(n):
                V[i, j] = quad.H[T, i, j]
    for t in range(left - 1, -1, -1):
        _action_value(quad, t, V, v, FV, Q, q)
        _regularize(reg, FV[0], Q, Huu, Z)
        status, nfree = box_qp(Huu, q[n:], quad.lo[t], quad.hi[t], k[t], free, box)
        if status != _SOLVED:
            return status, t + 1, 0.0, 0.0, gradient
        for i in range(nfree):
            gradient = max(gradient, abs(q[n + free[i]]))
        _gains(Z, free, nfree, box, K[t])
        _value((K[t], k[t]), Q, q, (CD, Huu, w), V, v)
        if t % _LOOK == _LOOK - 1 and seconds() > deadline:
            return _SOLVED, t, 0.0, 0.0, gradient
    d0, d1 = _predict(quad, K, k, z, y, dx)
    finite = abs(d0) < np.inf and abs(d1) < np.inf
    return _SOLVED if finite else _NOT_FINITE, 0, d0, d1, gradient
