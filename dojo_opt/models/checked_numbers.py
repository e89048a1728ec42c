"""`checked_numbers`: functions that build models and problems refuse wrong arguments by the call that the user made."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np

from sim.mechanism import checks

F = TypeVar("F", bound=Callable[..., Any])
_INNER = re.compile(r"(Legs|gaits\.\w+|problems\.\w+)(?=\()|Feet\.place\(targets\)")  # called on the way


def _check(call: str, kind: str, value: Any) -> None:
    """Check a value by the annotation of its argument."""
    kind, _, optional = kind.partition(" | ")
    if value is None and optional == "None":
        return
    if kind == "float":
        checks.number(call, value)
    elif kind == "int" and (isinstance(value, bool) or not isinstance(value, int | np.integer)):
        raise ValueError(f"{call}: expected a whole number, got {checks.shown(value)}")
    elif kind == "bool" and not isinstance(value, bool | np.bool_):
        raise TypeError(f"{call}: expected True or False, got {checks.shown(value)}")


def checked_numbers(room: str) -> Callable[[F], F]:
    """A decorator: arguments that are annotated as float, int or bool are such, or the error names room.function(...).

    Ranges are for the function to check; numbers so large that they overflow in it are refused here. The errors of the
    gaits, legs and problems that the function calls name it, too: its user called none of them.
    """

    def decorate(function: F) -> F:
        call, code = f"{room}.{function.__name__}", function.__code__
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        kinds = {name: str(function.__annotations__[name]) for name in names}

        @wraps(function)
        def checked(*args: Any, **kwargs: Any) -> Any:
            given = {**dict(zip(names, args, strict=False)), **kwargs}
            for name, value in given.items():
                if name in kinds:
                    _check(f"{call}({name}=...)", kinds[name], value)
            try:
                with np.errstate(over="raise"):
                    return function(*args, **kwargs)
            except (OverflowError, FloatingPointError) as error:
                large = ", ".join(f"{name}={checks.shown(value)}" for name, value in given.items())
                raise ValueError(f"{call}({large}): numbers overflow") from error
            except (TypeError, ValueError) as error:
                inner = _INNER.match(str(error))
                if inner is None or inner[0] == call or type(error) not in (TypeError, ValueError):
                    raise
                outer = call if inner[1] else f"{call}(...)"
                raise type(error)(outer + str(error)[inner.end() :]) from error

        return cast(F, checked)

    return decorate
