"""A notice at the terminal during compilation, which happens once and takes a while."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["compiling"]

_PATIENCE = 2.0  # [s] of compilation before a word about it
_TEXT = "dojo_opt: compiling, for up to a minute; kept on disk where it can be. `dojo-opt warmup` does it ahead of time"


class _Clock:
    """Time spent on compilations so far; those of its callees are part of that of a kernel."""

    def __init__(self) -> None:
        self.depth = 0
        self.spent = 0.0
        self.begin = 0.0
        self.told = False

    def look(self) -> None:
        """Print the notice once, if compilation takes long and a user waits: at a terminal or in a notebook."""
        if self.told or self.spent + time.perf_counter() - self.begin < _PATIENCE:
            return
        self.told = True
        if "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty()):
            print(_TEXT, file=sys.stderr, flush=True)


_CLOCK = _Clock()


@contextmanager
def compiling() -> Iterator[None]:
    """Around the compilation of one function."""
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
