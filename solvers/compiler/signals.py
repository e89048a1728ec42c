"""Signals that come while Python is called by LLVM, or while files are read and written: their handlers run afterwards.

Python drops an exception that leaves a function called from C, such as those with which Numba takes compiled code from
LLVM or hands kept code to it: the kernel would be without its code, and Ctrl-C or an alarm would be lost.

Of a compilation, which takes seconds, that holds for the moments in which a block begins or ends, or an object is
deleted. Locks of Numba and LLVM are taken and left by Python's `__enter__` and `__exit__`: an exception after the lock
was taken and before the block begins would leave it closed for ever, and the next thread that compiles would wait.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from importlib import import_module
from typing import Any, TypeVar, cast

from llvmlite import binding

__all__ = ["hold_while_translating", "signals_held", "signals_outside_locks"]

F = TypeVar("F", bound=Callable[..., Any])

_plain = import_module("_signal")  # `signal` makes enums, which takes thirty times as long
_OF_LLVM = os.path.dirname(binding.__file__)


def _put_back(number: int, ours: Any, before: Any) -> None:
    """Replace our handler by the one before; not one that a handler of the user has put there meanwhile."""
    if _plain.getsignal(number) is ours:
        _plain.signal(number, before)


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
            _put_back(self._number, self, self._before)
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


# functions that take and leave locks, or whose exceptions Python drops
_DELICATE = frozenset(("__enter__", "__exit__", "__del__", "acquire", "release", "enter_context"))
_FINALIZER = weakref.finalize.__call__.__code__  # which calls what Numba does when a dispatcher is deleted


def _is_delicate(code: Any) -> bool:
    """One of these functions, or one that makes the owner of an object of LLVM. Calls of LLVM may take a second."""
    of_llvm = code.co_name == "__init__" and code.co_filename.startswith(_OF_LLVM)
    return of_llvm or code.co_name in _DELICATE or code is _FINALIZER


class _Selective:
    """A handler that calls the one before, but notes its signal where that would do harm."""

    def __init__(self, number: int, before: Callable[..., Any], base: Any) -> None:
        self._number, self._before, self._base = number, before, base
        self._frames: list[Any] = []

    def __call__(self, number: int, frame: Any) -> None:
        """Look for delicate functions that run: frames within that of the compilation."""
        each = frame
        while each is not None and each is not self._base:
            if _is_delicate(each.f_code):
                self._frames.append(frame)
                return
            each = each.f_back
        self._before(number, frame)

    def handle(self) -> None:
        """Handle what came."""
        while self._frames:
            self._before(self._number, self._frames.pop())

    def release(self) -> None:
        """Put back the handler before, and let it handle what came."""
        try:
            _put_back(self._number, self, self._before)
        finally:
            self.handle()


_SELECTIVE: list[_Selective] = []  # of the compilation of the main thread


def signals_outside_locks(compilation: F) -> F:
    """The function, during which no handler of a signal runs while a lock is taken or left, or an object is deleted.

    It runs at the end of the next call of such a function: of those that the compilation of a kernel makes, for one.
    """

    @wraps(compilation)
    def call(*args: Any, **kwargs: Any) -> Any:
        if threading.current_thread() is not threading.main_thread():  # where no handler runs
            return compilation(*args, **kwargs)
        if _SELECTIVE:
            out = compilation(*args, **kwargs)
            for each in _SELECTIVE:
                each.handle()
            return out
        with ExitStack() as stack:
            stack.callback(_SELECTIVE.clear)
            for number in range(1, signal.NSIG):
                before = _plain.getsignal(number)
                if callable(before) and not getattr(before, "holds", False):
                    _SELECTIVE.append(_Selective(number, before, sys._getframe()))
                    stack.callback(_SELECTIVE[-1].release)
                    _plain.signal(number, _SELECTIVE[-1])
            return compilation(*args, **kwargs)

    return cast(F, call)


def hold_while_translating(engine: Any) -> None:
    """Let Numba's engine, which calls Python from LLVM as it translates modules, do so with signals held while a kernel
    is compiled; for other code of the process it stays as it is.
    """
    if "finalize_object" in vars(engine):
        return
    plain = engine.finalize_object
    held = signals_held()(plain)
    engine.finalize_object = wraps(plain)(lambda: held() if _SELECTIVE else plain())
