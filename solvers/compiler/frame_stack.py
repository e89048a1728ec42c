"""Room for Python's frames during a compilation.

CPython keeps the frames of functions in pieces of 16 KiB. A call that does not fit into the present piece maps a new
one, and unmaps it as it returns. Compilations call each other to a depth of hundreds of frames, so that many of their
innermost calls happen to stand at such an edge: 270,000 pairs of `mmap` and `munmap` in the cold start of two balls, a
fourteenth of its processor time. A piece is as long as its first frame needs, up to the next power of two. So a first
frame of little more than one mebibyte, of which no page is ever touched, leaves nearly another one for those above it.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

__all__ = ["with_room"]

_SLOTS = 2**17 + 1024  # of eight bytes


def _call(function: Callable[..., Any], *args: Any) -> Any:
    return function(*args)


_call_first = FunctionType(_call.__code__.replace(co_stacksize=_SLOTS), globals())
_HAS_ROOM: list[bool] = []  # while a call below has made it


def with_room(function: Callable[..., Any], *args: Any) -> Any:
    """Call a function with room for all frames that it needs.

    Args:
        function: what to call, once per process at a time: the caller holds the lock of the compiler.
        args: its arguments.

    Returns:
        Its result.
    """
    if _HAS_ROOM:
        return function(*args)
    try:
        _HAS_ROOM.append(True)
        return _call_first(function, *args)
    finally:
        _HAS_ROOM.clear()
