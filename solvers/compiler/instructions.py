"""Functions with a form of their own in kernels: the instructions of an intrinsic, in place of a call.

Numba's `overload` would compile a function around them, for every list of types, and inline it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Any, TypeVar, cast

from numba.core.registry import cpu_target

__all__ = ["compiled_as"]

Function = TypeVar("Function", bound=Callable[..., Any])


class _Twin:
    """The function for Python, and the intrinsic for kernels."""

    def __init__(self, func: Callable[..., Any], intrinsic: Any) -> None:
        update_wrapper(self, func)
        self._func, self._intrinsic = func, intrinsic

    def __call__(self, *args: Any) -> Any:
        return self._func(*args)

    @property
    def _numba_type_(self) -> Any:
        return cpu_target.typing_context.resolve_value_type(self._intrinsic)


def compiled_as(intrinsic: Any) -> Callable[[Function], Function]:
    """A decorator: kernels that call the function get the instructions of this intrinsic."""

    def decorate(func: Function) -> Function:
        return cast(Function, _Twin(func, intrinsic))

    return decorate
