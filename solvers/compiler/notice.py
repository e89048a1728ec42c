"""Signs of life during compilation, which happens once and takes a while; and the count of what was compiled.

    dojo_opt: compiling sim.solve.interior_point (number 34, 5 s so far; part 2 of 14)

    DOJO_OPT_QUIET=1    say nothing
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

__all__ = ["compiled", "compiling", "each"]

_PATIENCE = 1.0  # [s] of compilation before a word about it, and between two of them
_TEXT = (
    "dojo_opt: compiling what this needs, once; kept on disk where it can be. `dojo-opt warmup` does it ahead of time"
)
T = TypeVar("T")


class _Clock:
    """Time spent on compilations so far; those of its callees are part of that of a kernel."""

    def __init__(self) -> None:
        self.depth = 0
        self.spent = 0.0
        self.begin = 0.0
        self.next = _PATIENCE
        self.told = False
        self.part = ""
        self.names: list[str] = []

    def look(self) -> None:
        """Print what goes on, if compilation takes long and a user waits: at a terminal or in a notebook."""
        spent = self.spent + time.perf_counter() - self.begin
        if spent < self.next:
            return
        self.next = spent + _PATIENCE
        if os.environ.get("DOJO_OPT_QUIET", "0") not in ("", "0"):
            return
        notebook = "ipykernel" in sys.modules
        if not notebook and (sys.stderr is None or not sys.stderr.isatty()):
            return
        if not self.told:
            self.told = True
            print(_TEXT, file=sys.stderr, flush=True)
        line = f"dojo_opt: compiling {self.names[-1]} (number {len(self.names)}, {spent:.0f} s so far{self.part})"
        # one line that is written again and again; wide enough for the longest name
        print(f"\r{line:<110}", end="", file=sys.stderr, flush=True)
        self.line = True

    line = False

    def done(self) -> None:
        """End the line when nothing is being compiled any more."""
        if self.line:
            self.line = False
            print(f"\r{'':<110}\r", end="", file=sys.stderr, flush=True)


_CLOCK = _Clock()


@contextmanager
def compiling(func: Callable[..., Any]) -> Iterator[None]:
    """Around the compilation of one function."""
    _CLOCK.names.append(f"{func.__module__}.{func.__qualname__}")
    if _CLOCK.depth == 0:
        _CLOCK.begin = time.perf_counter()
    _CLOCK.depth += 1
    _CLOCK.look()
    try:
        yield
    finally:
        _CLOCK.depth -= 1
        if _CLOCK.depth == 0:
            _CLOCK.spent += time.perf_counter() - _CLOCK.begin
            _CLOCK.done()


def each(items: Iterable[T]) -> Iterator[T]:
    """The items, as parts of a task that may compile each of them."""
    every = list(items)
    try:
        for k, item in enumerate(every):
            _CLOCK.part = f"; part {k + 1} of {len(every)}"
            yield item
    finally:
        _CLOCK.part = ""


def compiled() -> list[str]:
    """Kernels that this process compiled, in the order in which it began; those loaded from disk are not among them."""
    return list(_CLOCK.names)
