"""Signals that come while Python is called by LLVM, or while files are read and written: their handlers run afterwards.

Python drops an exception that leaves a function called from C, such as those with which Numba takes compiled code from
LLVM or hands kept code to it: the kernel would be without its code, and Ctrl-C or an alarm would be lost.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from importlib import import_module
from typing import Any

__all__ = ["hold_while_translating", "signals_held"]

_plain = import_module("_signal")  # `signal` makes enums, which takes thirty times as long


class _Postponed:
    """A handler that notes its signal, and once released calls the one before."""

    def __init__(self, number: int, before: Callable[..., Any]) -> None:
        self._number, self._before = number, before
        self._frames: list[Any] = []
        self.holds = True

    def __call__(self, number: int, frame: Any) -> None:
        """Note the signal."""
        if self.holds:
            self._frames.append(frame)
        else:  # the handler of another signal raised before this one was replaced
            self._before(number, frame)

    def release(self) -> None:
        """Put back the handler before, and let it handle what came."""
        self.holds = False
        try:
            _plain.signal(self._number, self._before)
        finally:
            for frame in self._frames:
                self._before(self._number, frame)


@contextmanager
def signals_held() -> Iterator[None]:
    """Run handlers of signals at the end of the block, for parts of milliseconds, or during which LLVM hears none."""
    if threading.current_thread() is not threading.main_thread():  # where no handler runs
        yield
        return
    with ExitStack() as stack:  # which releases all, whatever a handler raises
        for number in range(1, signal.NSIG):
            before = _plain.getsignal(number)
            if callable(before) and not getattr(before, "holds", False):
                held = _Postponed(number, before)
                stack.callback(held.release)
                _plain.signal(number, held)
        yield


def hold_while_translating(engine: Any) -> None:
    """Let Numba's engine, which calls Python from LLVM as it translates modules, do so with signals held."""
    if "finalize_object" not in vars(engine):
        engine.finalize_object = wraps(engine.finalize_object)(signals_held()(engine.finalize_object))
