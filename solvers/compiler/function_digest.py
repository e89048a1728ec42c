"""Functions of the user by content: by all that decides their compiled code, and not by where or when they were made.

That is the byte code, the values that it reads from outside, and the same of each compiled function among them.

    fingerprint        of this process, where anything else counts as itself
    function_digest    of every process: none if there is anything else

Numba makes a constant of an outside value. The text of a number, a string, a tuple, an array or an enum says all about
it, and NumPy's and Python's own functions count by name. A module, an object or a plain function of the user can change
in a file that nobody looks at here, and so can code that others have given to Numba (`numba.extending.overload`).
"""

from __future__ import annotations

import builtins
import dis
import hashlib
from collections.abc import Callable, Hashable, Iterator
from enum import Enum
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core.registry import CPUDispatcher
from numba.core.typing.templates import builtin_registry

__all__ = ["CompiledFunction", "fingerprint", "function_digest"]

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis))
_LIBRARIES = ("builtins", "cmath", "math", "numba", "numpy", "operator")  # the first is that of `abs`
_NAMED = (ModuleType, BuiltinFunctionType, FunctionType, type, np.ufunc)  # that count by name, if they are theirs
_OURS = (*_LIBRARIES, "dojo_opt", "sim", "solvers")  # their sources are in the digest of the folder, or in a version
_LOADS = ("LOAD_GLOBAL", "LOAD_NAME")


class CompiledFunction:
    """A function that this package compiles: `py_func`, by `flags`."""

    py_func: Callable[..., Any]
    flags: dict[str, Any]


def fingerprint(func: Callable[..., Any]) -> Hashable:
    """Equal for functions that compile to the same code in this process.

    Args:
        func: a function, plain or compiled.

    Returns:
        Its content, and the objects in it that count as themselves.
    """
    walk = _Walk([])
    try:
        content = _flags_of(func), walk.function(func, ())
    except _UnknownError:
        return _Held(func)
    return repr(content), tuple(walk.held or ())


def function_digest(func: Callable[..., Any], flags: dict[str, Any]) -> str | None:
    """Digest of a function to be compiled with flags, the same in every process.

    Args:
        func: the function.
        flags: of its compilation.

    Returns:
        24 hexadecimal digits; None if something decides the code that has no text.
    """
    if _is_extended():
        return None
    try:
        content = _text_of(flags), _Walk(None).function(func, ())
    except _UnknownError:
        return None
    return hashlib.sha256(repr(content).encode()).hexdigest()[:24]


class _UnknownError(Exception):
    """A value without a text that says all about it."""


class _Held:
    """An object that counts as itself; kept, so that its address is not given to another."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Held) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


def _text_of(flags: dict[str, Any]) -> list[tuple[str, str]]:
    """Flags in order; those of `fastmath` are a set, whose order differs from process to process."""
    ordered = ((name, sorted(value) if isinstance(value, set) else value) for name, value in flags.items())
    return sorted((name, repr(value)) for name, value in ordered)


def _flags_of(func: Any) -> list[tuple[str, str]]:
    """The flags of a compiled function; none of a plain one."""
    if isinstance(func, CompiledFunction):
        return _text_of(func.flags)
    return _text_of(func.targetoptions) if isinstance(func, CPUDispatcher) else []


_EXTENDED: dict[tuple[int, ...], bool] = {}  # by the numbers of registrations


def _is_extended() -> bool:
    """Whether anybody but Numba and this package has registered functions, methods or attributes with Numba."""
    functions, attributes, names = builtin_registry.functions, builtin_registry.attributes, builtin_registry.globals
    key = len(functions), len(attributes), len(names)
    if key not in _EXTENDED:
        of_names = (template for _, kind in names for template in getattr(kind, "templates", ()))
        every = (*functions, *attributes, *of_names)
        _EXTENDED[key] = any(_owner(each) not in _OURS for each in every)
    return _EXTENDED[key]


def _owner(template: Any) -> str:
    """The package that has registered a template: that of its code, or else of its key."""
    code = getattr(template, "_overload_func", None) or getattr(template, "_definition_func", None)
    if isinstance(code, FunctionType):
        return str(code.__globals__.get("__name__", "")).partition(".")[0]
    return _root(template if template.__module__ != "abc" else template.key)  # "abc": a class that Numba makes


def _root(value: Any) -> str:
    """The package of a value."""
    return str(getattr(value, "__module__", "") or "").partition(".")[0]


class _Walk:
    """The contents of functions; unknown objects are held, or where nothing can be, an error."""

    def __init__(self, held: list[_Held] | None) -> None:
        self.held = held

    def function(self, func: Any, above: tuple[FunctionType, ...]) -> tuple[Any, ...]:
        """Code, defaults and outside values; a function within itself is known by its depth."""
        text = getattr(func, "py_func", func)
        if not isinstance(text, FunctionType):
            raise _UnknownError
        if text in above:
            return "itself", above.index(text)
        above = (*above, text)
        defaults = (text.__defaults__ or (), *sorted((text.__kwdefaults__ or {}).items()))
        outside = [(name, self._value(value, above)) for name, value in _outside(text)]
        return _code(text.__code__), self._value(defaults, above), outside

    def _value(self, value: Any, above: tuple[FunctionType, ...]) -> Any:
        """Equal only for values that Numba compiles alike."""
        kind = type(value)
        if kind in _PLAIN:
            return kind.__name__, repr(value)
        if isinstance(value, np.generic | np.ndarray) and not value.dtype.hasobject:
            flags = str(value.flags) if isinstance(value, np.ndarray) else ""
            return kind.__name__, repr(value.dtype), value.shape, flags, hashlib.sha256(value.tobytes()).hexdigest()
        if isinstance(value, tuple) and (kind is tuple or hasattr(kind, "_fields")):
            fields = getattr(kind, "_fields", ())
            return kind.__qualname__, fields, [self._value(part, above) for part in value]
        if isinstance(value, Enum):
            return value.name, self._enum(kind, above)
        if isinstance(value, type) and issubclass(value, Enum):
            return "class", self._enum(value, above)
        name = value.__name__ if isinstance(value, ModuleType) else f"{_root(value)}.{getattr(value, '__name__', '')}"
        if isinstance(value, _NAMED) and name.partition(".")[0] in _LIBRARIES:
            return kind.__name__, name
        if isinstance(value, CompiledFunction | CPUDispatcher):
            return kind.__name__, _flags_of(value), self.function(value, above)
        if self.held is None:
            raise _UnknownError
        self.held.append(_Held(value))
        return "held", len(self.held)

    def _enum(self, kind: Any, above: tuple[FunctionType, ...]) -> tuple[Any, ...]:
        """An enum, by its members."""
        members = [(name, self._value(member.value, above)) for name, member in kind.__members__.items()]
        return kind.__qualname__, [base.__name__ for base in kind.__mro__], members


def _outside(text: FunctionType) -> Iterator[tuple[str, Any]]:
    """Names and values of the closure, and of the globals that a function, or one inside it, reads."""
    for name, cell in zip(text.__code__.co_freevars, text.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # nothing yet
            raise _UnknownError from None
    for name in sorted({name for code in _codes(text.__code__) for name in _globals(code)}):
        if name in text.__globals__:
            yield name, text.__globals__[name]
        elif not hasattr(builtins, name):
            raise _UnknownError


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function, and of the functions inside it."""
    yield code
    for value in code.co_consts:
        if isinstance(value, CodeType):
            yield from _codes(value)


def _globals(code: CodeType) -> set[str]:
    return {step.argval for step in dis.get_instructions(code) if step.opname in _LOADS}


def _code(code: CodeType) -> tuple[Any, ...]:
    """The parts of Python's code that Numba reads; its place is none of them."""
    names = code.co_name, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    constants = [_code(value) if isinstance(value, CodeType) else _constant(value) for value in code.co_consts]
    return code.co_code, getattr(code, "co_exceptiontable", b""), names, counts, constants


def _constant(value: Any) -> Any:
    """A constant of Python's code: plain, or a tuple or a set of such."""
    if isinstance(value, tuple):
        return [_constant(part) for part in value]
    if isinstance(value, frozenset):
        return sorted(repr(_constant(part)) for part in value)
    return type(value).__name__, repr(value)
