"""Fingerprints of users' functions: their code, and the outside values that Numba compiles into them."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from inspect import getclosurevars
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

_PLAIN = (bool, int, float, complex, str, bytes, np.generic, type(None))


def fingerprint(func: Callable[..., Any]) -> Hashable:
    """Equal for functions that compile to the same code; Numba makes constants of the outside values they read."""
    text = getattr(func, "py_func", func)
    if not isinstance(text, FunctionType):
        return id(func), _Held(func)
    flags = getattr(func, "flags", None) or getattr(func, "targetoptions", {})
    return text.__code__, str(sorted(flags.items(), key=str)), _outside(text, (text,))


def _outside(text: FunctionType, above: tuple[FunctionType, ...]) -> Hashable:
    """Names and values of the globals and closure variables that a function reads, and its defaults."""
    around = getclosurevars(text)
    found = sorted({**around.globals, **around.nonlocals}.items())
    return _value(text.__defaults__, above), tuple((name, _value(value, above)) for name, value in found)


def _value(value: Any, above: tuple[FunctionType, ...]) -> Hashable:
    """A value that is equal for values that Numba compiles alike."""
    if isinstance(value, _PLAIN):
        return type(value).__name__, repr(value)
    if isinstance(value, tuple):
        return tuple(_value(part, above) for part in value)
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, ModuleType):
        return value.__name__
    text = getattr(value, "py_func", value)
    if isinstance(text, FunctionType) and text not in above:
        return text.__code__, _outside(text, (*above, text))
    return _Held(value)


class _Held:
    """Anything else: itself only, and kept, so that its address is not given to another."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Held) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)
