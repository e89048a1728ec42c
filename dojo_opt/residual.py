"""A user's compiled residual r(x, u), evaluated and differentiated along a whole trajectory in one compiled call."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.manifold import displace
from sim.pace import rows
from solvers.jit import CompilationError, users_kernel

Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]
Integers = NDArray[np.int64]

__all__ = ["ResidualKernels", "kernel"]

_STEP = float(np.cbrt(np.finfo(float).eps))
_NOISE = re.compile(r"Failed in|During:|File \"|<source|def values|def differences|\^|$")  # of Numba's messages
_LONG = 600  # letters of them
_POISON = (3.0e7, -5.0e7)  # what an output holds before it is written


def kernel(func: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a residual r(x, u, out), or its Jacobian, or what these call; as a decorator:

        @dojo.kernel
        def keep_away(x, u, out):
            out[0] = 0.3 - np.hypot(x[0] - 1.0, x[1])

    Costs and constraints take plain functions as well, and compile them; other functions that those call have to be
    kernels. What Numba understands of Python and NumPy is allowed. Compiled once per process.
    """
    return users_kernel(func)


def check_residual(call: str, function: Any, dimension: Any, jacobian: Any, sim: Any) -> None:
    """Call the user's functions once, uncompiled, in the neutral state: compiled code would write past the end of out.

    ValueError, naming the function, when it fails there, or leaves an entry of out as it was.
    """
    if not isinstance(dimension, int | np.integer) or dimension < 1:
        raise ValueError(f"{call}(dimension=...): expected a whole number >= 1, got {dimension!r}")
    first, second = (_tried(f"{call}(function=...)", function, (int(dimension),), sim, poison) for poison in _POISON)
    unset = np.flatnonzero((first == _POISON[0]) & (second == _POISON[1]))
    if unset.size:
        raise ValueError(f"{call}(function=...): {_name(function)!r} does not write out[{unset[0]}]")
    if jacobian is not None:
        _tried(f"{call}(jacobian=...)", jacobian, (int(dimension), sim.ndx + sim.nu), sim, 0.0)


def _tried(call: str, function: Any, shape: tuple[int, ...], sim: Any, poison: float) -> NDArray[np.float64]:
    """What a function of the user makes of an output full of poison."""
    if not callable(function):
        raise ValueError(f"{call}: expected a function of (x, u, out), got {function!r}")
    x, u, out = np.array(sim.neutral(), dtype=np.float64), np.zeros(sim.nu), np.full(shape, poison)
    try:
        getattr(function, "py_func", function)(x, u, out)
    except Exception as error:
        expected = f"it is called with x {x.shape}, u {u.shape}, out {shape}"
        raise ValueError(f"{call}: {_name(function)!r}: {type(error).__name__}: {error}; {expected}") from error
    return out


def _name(function: Any) -> str:
    return str(getattr(function, "__name__", function))


def _values_kernel(residual: Callable[..., Any]) -> Any:
    @users_kernel
    def values(xs, us, idle, knots, out):  # type: ignore[no-untyped-def]
        for row in range(knots.shape[0]):
            t = knots[row]
            residual(xs[t], us[t] if t < us.shape[0] else idle, out[row])

    return values


def _differences_kernel(residual: Callable[..., Any]) -> Any:
    @users_kernel
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
    @users_kernel
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
        self._names = " or ".join(repr(_name(f)) for f in (residual, jacobian) if f is not None)
        residual, jacobian = kernel(residual), None if jacobian is None else kernel(jacobian)
        self._values = _values_kernel(residual)
        self._exact = None if jacobian is None else _jacobians_kernel(jacobian)
        self._differences = _differences_kernel(residual) if jacobian is None else None
        self._idle = np.zeros(nu)
        self._out: Stack | None = None

    def values(self, xs: Matrix, us: Matrix, knots: Integers, out: Matrix) -> None:
        """out[i] = r(x, u) at knots[i]."""
        with self._named():
            for part in rows(len(knots)):
                self._values(xs, us, self._idle, knots[part], out[part])

    def jacobians(self, layout: Integers, xs: Matrix, us: Matrix, knots: Integers, d: int) -> Stack:
        """(m, d, ndx + nu) derivative by tangent state and control; overwritten by the next call."""
        if self._out is None or self._out.shape[:2] != (knots.size, d):
            self._out = np.zeros((knots.size, d, layout.size + us.shape[1]))
            self._scratch = np.empty((4, max(xs.shape[1], us.shape[1], d)))
        with self._named():
            for part in rows(len(knots)):
                if self._exact is not None:
                    self._exact(xs, us, self._idle, knots[part], self._out[part])
                else:
                    assert self._differences is not None
                    self._differences(layout, xs, us, self._idle, knots[part], self._scratch, self._out[part])
        return self._out

    @contextmanager
    def _named(self) -> Iterator[None]:
        """An error of the compiler as one that names the user's function."""
        try:
            yield
        except CompilationError as error:
            why = [line.strip() for line in str(error).splitlines() if line.strip()]
            said = "; ".join(dict.fromkeys(line for line in why if not _NOISE.match(line)))
            raise ValueError(f"residual {self._names}: Numba cannot compile it: {said[:_LONG]}") from error
