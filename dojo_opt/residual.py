"""A user's compiled residual r(x, u), evaluated and differentiated along a whole trajectory in one compiled call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.manifold import displace
from solvers.jit import local_kernel

Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]
Integers = NDArray[np.int64]

_STEP = float(np.cbrt(np.finfo(float).eps))


def _values_kernel(residual: Callable[..., Any]) -> Any:
    @local_kernel
    def values(xs, us, idle, knots, out):  # type: ignore[no-untyped-def]
        for row in range(knots.shape[0]):
            t = knots[row]
            residual(xs[t], us[t] if t < us.shape[0] else idle, out[row])

    return values


def _differences_kernel(residual: Callable[..., Any]) -> Any:
    @local_kernel
    def differences(layout, xs, us, idle, knots, scratch, out):  # type: ignore[no-untyped-def]
        n, m, d = layout.shape[0], us.shape[1], out.shape[1]
        x, u = scratch[0, : xs.shape[1]], scratch[1, :m]
        plus, minus = scratch[2, :d], scratch[3, :d]
        for row in range(knots.shape[0]):
            t = knots[row]
            now = us[t] if t < us.shape[0] else idle
            for i in range(n + m):
                value = xs[t, layout[i]] if i < n and layout[i] >= 0 else 1.0
                step = _STEP * max(1.0, abs(value if i < n else now[i - n]))
                for side in range(2):
                    signed = step if side == 0 else -step
                    for j in range(x.shape[0]):
                        x[j] = xs[t, j]
                    for j in range(m):
                        u[j] = now[j]
                    if i < n:
                        displace(layout, xs[t], i, signed, x)
                    else:
                        u[i - n] += signed
                    residual(x, u, plus if side == 0 else minus)
                for j in range(d):
                    out[row, j, i] = (plus[j] - minus[j]) / (2.0 * step)

    return differences


def _jacobians_kernel(jacobian: Callable[..., Any]) -> Any:
    @local_kernel
    def jacobians(xs, us, idle, knots, out):  # type: ignore[no-untyped-def]
        for row in range(knots.shape[0]):
            t = knots[row]
            jacobian(xs[t], us[t] if t < us.shape[0] else idle, out[row])

    return jacobians


class ResidualKernels:
    """Loops over knots around `residual(x, u, out)` and, if given, `jacobian(x, u, out)` with out (d, ndx + nu).

    Without a Jacobian, central differences on the manifold with step cbrt(eps) max(1, |x_i|). At the final knot u is
    zero. The loops are closures over the user's kernel, which Numba cannot cache: they compile once per process.
    """

    def __init__(self, residual: Callable[..., Any], jacobian: Callable[..., Any] | None, nu: int) -> None:
        self._values = _values_kernel(residual)
        self._exact = None if jacobian is None else _jacobians_kernel(jacobian)
        self._differences = _differences_kernel(residual) if jacobian is None else None
        self._idle = np.zeros(nu)
        self._out: Stack | None = None

    def values(self, xs: Matrix, us: Matrix, knots: Integers, out: Matrix) -> None:
        """out[i] = r(x, u) at knots[i]."""
        self._values(xs, us, self._idle, knots, out)

    def jacobians(self, layout: Integers, xs: Matrix, us: Matrix, knots: Integers, d: int) -> Stack:
        """(m, d, ndx + nu) derivative by tangent state and control; overwritten by the next call."""
        if self._out is None or self._out.shape[:2] != (knots.size, d):
            self._out = np.zeros((knots.size, d, layout.size + us.shape[1]))
            self._scratch = np.empty((4, max(xs.shape[1], us.shape[1], d)))
        if self._exact is not None:
            self._exact(xs, us, self._idle, knots, self._out)
        else:
            assert self._differences is not None
            self._differences(layout, xs, us, self._idle, knots, self._scratch, self._out)
        return self._out
