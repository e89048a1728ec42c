"""A user's compiled residual r(x, u), evaluated and differentiated along a whole trajectory in one compiled call."""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.planning.manifold import displace
from sim.mechanism.memory_limit import room_for
from sim.model.interruptible_loops import rows
from sim.simulator.simulator import Simulator
from solvers.compiler import CompilationError, fingerprint, users_kernel, users_loop
from solvers.types import Integers, Matrix, Stack

__all__ = ["ResidualKernels", "jit"]

_STEP = float(np.cbrt(np.finfo(float).eps))
_NOISE = re.compile(r"Failed in|During:|File \"|<source|def evaluate|\^|$")  # of Numba's messages
_LONG = 600  # letters of them
_READ_ONLY = re.compile(r"read-?only", re.IGNORECASE)  # of NumPy's and Numba's messages
_WRITES = "writes into its argument x or u; write into out only, or into a copy such as x.copy()"
_KEPT = 64  # loops
_NO_ROWS = np.zeros((0, 0, 0))
_POISON = (3.0e7, -5.0e7)  # in outputs before they are written


def jit(func: Callable[..., Any] | None = None, *, boundscheck: bool = True) -> Any:
    """Compile a residual r(x, u, out), its Jacobian, or a function that these call; as a decorator:

        @dojo.jit
        def keep_away(x, u, out):
            out[0] = 0.3 - np.hypot(x[0] - 1.0, x[1])

    Costs and constraints also take plain functions, and compile them. Other functions that those call need the
    decorator. Everything that Numba supports of Python and NumPy is allowed, except writing into x and u. Functions
    with the same text and the same captured values are compiled once, and kept on disk with the kernels; those that
    capture something other than numbers, strings, tuples, arrays, enums and compiled functions of such (the compiled
    kinematics, for one) once per process. Numba never frees code: each new text or captured value keeps about 2 MiB
    until the process ends.

    Args:
        func: function of (x (nx,), u (nu,), out (dimension,)).
        boundscheck: whether an index beyond the end of an array raises an error that names function and knot. Without
            the check, which takes a twentieth to a quarter of the time of a residual, such an index reads or writes
            other memory.

    Returns:
        The compiled function.
    """
    if func is None:
        return partial(users_kernel, boundscheck=boundscheck)
    return users_kernel(func, boundscheck)


def check_residual(call: str, function: Any, dimension: Any, jacobian: Any, sim: Simulator) -> None:
    """Call the user's functions once, uncompiled, in the neutral state, where mistakes have the clearest messages.

    ValueError, naming the function, when it fails there, writes into x or u, or leaves an entry of out as it was.
    """
    each = 8.0 * (sim.ndx + sim.nu)  # of the derivative
    dimension = room_for(f"{call}(dimension=...)", dimension, each, noun="entries")
    first, second = (_tried(f"{call}(function=...)", function, (int(dimension),), sim, poison) for poison in _POISON)
    unset = np.flatnonzero((first == _POISON[0]) & (second == _POISON[1]))
    if unset.size:
        raise ValueError(f"{call}(function=...): {_name(function)!r} does not write out[{unset[0]}]")
    if jacobian is not None:
        _tried(f"{call}(jacobian=...)", jacobian, (int(dimension), sim.ndx + sim.nu), sim, 0.0)


def _tried(call: str, function: Any, shape: tuple[int, ...], sim: Simulator, poison: float) -> NDArray[np.float64]:
    """Results of a user's function for an output full of poison and arguments that must not be written to."""
    if not callable(function):
        raise ValueError(f"{call}: expected a function of (x, u, out), got {function!r}")
    x, u = (read_only(np.array(a, dtype=np.float64)) for a in (sim.neutral(), np.zeros(sim.nu)))
    out = np.full(shape, poison)
    try:
        getattr(function, "py_func", function)(x, u, out)
    except Exception as error:
        if _READ_ONLY.search(str(error)):
            raise ValueError(f"{call}: {_name(function)!r} {_WRITES} ({error})") from error
        expected = f"it is called with x {x.shape}, u {u.shape}, out {shape}"
        raise ValueError(f"{call}: {_name(function)!r}: {type(error).__name__}: {error}; {expected}") from error
    return out


def read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """A view that must not be written to: compiled code that tries does not compile."""
    view = array.view()
    view.flags.writeable = False
    return view


def _name(function: Any) -> str:
    return str(getattr(function, "__name__", function))


def _residual_loop(residual: Callable[..., Any]) -> Any:
    @users_loop
    def evaluate(layout, xs, us, knots, scratch, frozen, values, out):  # type: ignore[no-untyped-def]
        """values[i] = r at knots[i]; with rows in out, its central differences instead. frozen views scratch."""
        n, nx, m, d = layout.shape[0], xs.shape[1], us.shape[1], values.shape[1]
        for row in range(knots.shape[0]):
            t = knots[row]
            now = us[t] if t < us.shape[0] else frozen[4, :m]
            if out.shape[0] == 0:
                residual(xs[t], now, values[row])
                continue
            for i in range(n + m):
                value = xs[t, layout[i]] if i < n and layout[i] >= 0 else 1.0
                step = _STEP * max(1.0, abs(value if i < n else now[i - n]))
                for side in range(2):
                    signed = step if side == 0 else -step
                    for j in range(nx):
                        scratch[0, j] = xs[t, j]
                    for j in range(m):
                        scratch[1, j] = now[j]
                    if i < n:
                        displace(layout, xs[t], i, signed, scratch[0, :nx])
                    else:
                        scratch[1, i - n] += signed
                    residual(frozen[0, :nx], frozen[1, :m], scratch[2 + side, :d])
                for j in range(d):
                    out[row, j, i] = (scratch[2, j] - scratch[3, j]) / (2.0 * step)

    return evaluate


def _jacobian_loop(jacobian: Callable[..., Any]) -> Any:
    @users_loop
    def evaluate(layout, xs, us, knots, scratch, frozen, values, out):  # type: ignore[no-untyped-def]
        """out[i] = dr/d(dx, du) at knots[i]."""
        m = us.shape[1]
        for row in range(knots.shape[0]):
            t = knots[row]
            jacobian(xs[t], us[t] if t < us.shape[0] else frozen[4, :m], out[row])

    return evaluate


_loops: OrderedDict[Any, Any] = OrderedDict()  # loops by fingerprints, the most recently used last


def _loop(make: Callable[[Any], Any], function: Callable[..., Any]) -> Any:
    """The loop around a function, the same one for functions that compile to the same code."""
    key = make, fingerprint(function)
    if key not in _loops:
        _loops[key] = make(jit(function))
        if len(_loops) > _KEPT:
            _loops.popitem(last=False)
    _loops.move_to_end(key)
    return _loops[key]


class ResidualKernels:
    """Loops over knots around `residual(x, u, out)` and, if given, `jacobian(x, u, out)` with out (d, ndx + nu).

    Without a Jacobian, central differences on the manifold with step cbrt(eps) max(1, |x_i|). At the final knot u is
    zero. The loops are kept on disk by the content of the user's functions (solvers/compiler/users_cache.py).
    x and u are read-only, so that a function which writes into them does not compile.
    """

    def __init__(self, residual: Callable[..., Any], jacobian: Callable[..., Any] | None, nu: int) -> None:
        self._residual = _name(residual), _loop(_residual_loop, residual)
        self._jacobian = None if jacobian is None else (_name(jacobian), _loop(_jacobian_loop, jacobian))
        self._nu = nu
        self._out: Stack = _NO_ROWS
        self._layout = np.zeros(0, dtype=np.int64)
        self._scratch = self._frozen = np.zeros((0, 0))

    @property
    def name(self) -> str:
        """Name of the user's residual."""
        return self._residual[0]

    def values(self, xs: Matrix, us: Matrix, knots: Integers, out: Matrix) -> None:
        """out[i] = r(x, u) at knots[i]."""
        self._run(self._residual, self._layout, xs, us, knots, out, _NO_ROWS)

    def jacobians(self, layout: Integers, xs: Matrix, us: Matrix, knots: Integers, d: int) -> Stack:
        """(m, d, ndx + nu) derivative by tangent state and control; overwritten by the next call."""
        if self._out.shape[:2] != (knots.size, d):
            self._out = np.zeros((knots.size, d, layout.size + us.shape[1]))
        values = np.empty((0, d))
        self._run(self._jacobian or self._residual, layout, xs, us, knots, values, self._out)
        return self._out

    def _run(
        self,
        named: tuple[str, Any],
        layout: Integers,
        xs: Matrix,
        us: Matrix,
        knots: Integers,
        values: Matrix,
        out: Stack,
    ) -> None:
        """One loop; its errors as ones that name the user's function, and the knot."""
        width = max(xs.shape[1], us.shape[1], values.shape[1])
        if self._scratch.shape[1] < width:
            self._scratch = np.zeros((5, width))  # x, u, both sides of a difference, u of the final knot
            self._frozen = read_only(self._scratch)
        (name, loop), x, u = named, read_only(xs), read_only(us)
        try:
            for part in rows(len(knots)):
                loop(layout, x, u, knots[part], self._scratch, self._frozen, values[part], out[part])
        except CompilationError as error:
            raise ValueError(f"residual {name!r} {of_the_compiler(error)}") from error
        except Exception as error:
            for row in range(knots.size):
                part = slice(row, row + 1)
                try:
                    loop(layout, x, u, knots[part], self._scratch, self._frozen, values[part], out[part])
                except Exception as again:
                    at = f"residual {name!r} at knot {knots[row]}: {type(again).__name__}: {again}"
                    raise ValueError(at) from again
            raise ValueError(f"residual {name!r}: {type(error).__name__}: {error}") from error


def of_the_compiler(error: Exception) -> str:
    """The message of the compiler, without the part about the compiler."""
    if _READ_ONLY.search(str(error)):
        return _WRITES
    why = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"cannot be compiled by Numba: {'; '.join(dict.fromkeys(s for s in why if not _NOISE.match(s)))[:_LONG]}"
