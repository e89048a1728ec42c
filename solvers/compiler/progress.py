"""Progress messages during compilation, and the count of compiled functions.

dojo_opt: compiling, once: no code is shipped; kept in /home/me/.cache/dojo_opt/0123456789abcdef
dojo_opt: compiling function 34 of about 120 (5 s so far, part 2 of 14): the active set of contacts with the ground

The second line is written again and again while it lasts; its words are the first ones of the module of the kernel that
Python, or the table of optional kernels, asked for. It is for users who wait at a terminal or in a notebook; elsewhere
there is the first line alone.

DOJO_OPT_QUIET=1 says nothing.
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

__all__ = ["because", "compiled", "compiling", "expect", "parts"]

_PATIENCE = 1.0  # [s] of compilation before a word about it, and between two of them
_WIDTH = 118
T = TypeVar("T")


def _is_quiet() -> bool:
    return os.environ.get("DOJO_OPT_QUIET", "0") not in ("", "0") or sys.stderr is None


def _is_watched() -> bool:
    """Whether a user sees lines that are written again."""
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())


def _topic(func: Callable[..., Any]) -> str:
    """The feature that a kernel belongs to, in words: the docstring of its module up to the first stop; or its name."""
    text = " ".join((getattr(sys.modules.get(func.__module__), "__doc__", None) or "").split())
    words = re.split(r"[:;.](?:\s|$)| \(", text, maxsplit=1)[0]
    if not words:
        return f"{func.__module__}.{func.__qualname__}"
    return words if words[1:2].isupper() else words[0].lower() + words[1:]


class _Clock:
    """Time spent on compilations so far; those of its callees are part of that of a kernel."""

    def __init__(self) -> None:
        self.names: list[tuple[str, bool]] = []
        self.depth = 0
        self.spent = 0.0
        self.begin = 0.0
        self.next_word = _PATIENCE
        self.reason = ""
        self.topic = ""
        self.part = ""
        self.expected = 0  # functions, with those before
        self.told = self.written = False

    def look(self) -> None:
        """Print the present work, if compilation takes long and a user waits."""
        spent = self.spent + time.perf_counter() - self.begin
        if spent < self.next_word:
            return
        self.next_word = spent + _PATIENCE
        if _is_quiet() or (self.told and not _is_watched()):
            return
        if not self.told:
            self.told = True
            print(f"dojo_opt: compiling, once{self.reason}", file=sys.stderr, flush=True)
            if not _is_watched():
                return
        count = f"{len(self.names)} of about {self.expected}" if self.expected else f"{len(self.names)}"
        text = f"dojo_opt: compiling function {count} ({spent:.0f} s so far{self.part}): {self.topic}"
        print(f"\r{text[:_WIDTH]:<{_WIDTH}}", end="", file=sys.stderr, flush=True)
        self.written = True

    def clear(self) -> None:
        """Remove the line when nothing is compiled any more."""
        if self.written:
            self.written = False
            print(f"\r{'':<{_WIDTH}}\r", end="", file=sys.stderr, flush=True)


_CLOCK = _Clock()


@contextmanager
def compiling(func: Callable[..., Any], own: bool = True) -> Iterator[None]:
    """Around the compilation of one function; own: it is not the user's."""
    _CLOCK.names.append((f"{func.__module__}.{func.__qualname__}", own))
    if _CLOCK.depth == 0:
        _CLOCK.begin = time.perf_counter()
        _CLOCK.topic = _topic(func) if own else f"{func.__module__}.{func.__qualname__}"
    _CLOCK.depth += 1
    _CLOCK.look()
    try:
        yield
    finally:
        _CLOCK.depth -= 1
        if _CLOCK.depth == 0:
            _CLOCK.spent += time.perf_counter() - _CLOCK.begin
            _CLOCK.clear()


def because(reason: str) -> None:
    """Say, where something is said at all, why this process compiles, and where the code is kept."""
    _CLOCK.reason = f": {reason}"


def expect(count: int) -> None:
    """Say, where something is said at all, how many more functions there are, about; those of a helper count."""
    _CLOCK.expected = len(_CLOCK.names) + count


def parts(items: Iterable[T], count: int) -> Iterator[T]:
    """The items, as parts of a task that may compile each of them."""
    try:
        for k, item in enumerate(items):
            _CLOCK.part = f", part {k + 1} of {count}" if count > 1 else ""
            yield item
    finally:
        _CLOCK.part, _CLOCK.expected = "", 0


def compiled(users: bool = False) -> list[str]:
    """Functions that this process compiled, in the order in which it began; those loaded from disk are not there.

    Args:
        users: whether to count functions of the user, and the loops around them.

    Returns:
        Their names.
    """
    return [name for name, own in _CLOCK.names if own or users]
