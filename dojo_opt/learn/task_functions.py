"""Task functions: one call of each, uncompiled, before they are compiled, where mistakes have the clearest messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.planning.residual import of_the_compiler, read_only
from sim.mechanism import checks
from solvers.compiler import CompilationError

__all__ = ["check_number", "check_observation", "compiled_call"]

_POISON = (3.0e7, -5.0e7)  # in observations before they are written
_OWN = __name__.rpartition(".")[0]  # whose functions are tested, and call compiled ones that wheels do not ship alone

Arrays = dict[str, NDArray[np.float64]]


def check_observation(function: Any, x: NDArray[np.float64], size: int) -> None:
    """Refuse an observation that does not write all its entries.

    Args:
        function: of (x, out).
        x: (nx,) state.
        size: number of entries.

    Raises:
        ValueError: naming the function, when it fails, writes into x, or leaves an entry of out as it was.
    """
    call = "Task(observation=...)"
    first, second = np.full(size, _POISON[0]), np.full(size, _POISON[1])
    for out in (first, second):
        if _tried(call, function, {"x": read_only(x), "out": out}) is _SHIPPED:
            return
    unset = np.flatnonzero((first == _POISON[0]) & (second == _POISON[1]))
    if unset.size:
        raise ValueError(f"{call}: {_name(function)} does not write out[{unset[0]}]; it is to write {size} entries")


def check_number(name: str, function: Any, arguments: Arrays, kind: str) -> None:
    """Refuse a function that does not return one number.

    Args:
        name: of the argument of the Task.
        function: the function.
        arguments: its arguments, by name.
        kind: what it is to return.

    Raises:
        ValueError: naming the function, when it fails, writes into an argument, or returns anything else.
    """
    call = f"Task({name}=...)"
    value = _tried(call, function, {key: read_only(array) for key, array in arguments.items()})
    number = isinstance(value, bool | int | float | np.bool_ | np.integer | np.floating)
    if value is not _SHIPPED and not number and not (isinstance(value, np.ndarray) and value.shape == ()):
        got = f"an array of shape {value.shape}" if isinstance(value, np.ndarray) else checks.shown(value)
        raise ValueError(f"{call}: {_name(function)} returns {got}; expected {kind}; {_called_with(arguments)}")


def compiled_call(name: str, loop: Callable[..., Any], *arguments: Any) -> Any:
    """A call of a loop around functions of a task; what Numba refuses in them names the argument of the Task.

    Args:
        name: of the argument, or of several.
        loop: the loop.
        *arguments: its arguments.

    Returns:
        The result of the loop.

    Raises:
        ValueError: Numba cannot compile a function.
    """
    try:
        return loop(*arguments)
    except CompilationError as error:
        raise ValueError(f"Task({name}=...): {of_the_compiler(error)}") from error


_SHIPPED = object()  # instead of a result


def _tried(call: str, function: Any, arguments: Arrays) -> Any:
    """The result of a function of the user."""
    plain = getattr(function, "py_func", function)
    if str(getattr(plain, "__module__", "")).startswith(_OWN):
        return _SHIPPED
    try:
        with np.errstate(all="ignore"):
            return plain(*arguments.values())
    except Exception as error:
        if "read-only" in str(error):
            kept = ", ".join(key for key in arguments if key != "out")
            raise ValueError(f"{call}: {_name(function)} writes into {kept}; write into a copy: x.copy()") from error
        text = f"{call}: {_name(function)}: {type(error).__name__}: {error}; {_called_with(arguments)}"
        raise ValueError(text) from error


def _called_with(arguments: Arrays) -> str:
    return "it is called with " + ", ".join(f"{key} {array.shape}" for key, array in arguments.items())


def _name(function: Any) -> str:
    return repr(str(getattr(function, "__name__", function)))
