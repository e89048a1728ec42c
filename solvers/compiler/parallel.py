"""`@parallel_kernel`: loops over whole knots or rollouts, spread over the cores, that survive threads and forks.

Threads: two of them must not enter Numba's work queue at once, which ends the process; so one loop runs at a time.

Forks: a forked process, as Python makes them by default on Linux, has none of the threads of its parent. OpenMP ends it
at the next loop, others would wait for ever. Where loops have run before the fork, the child runs them on one core.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

import numba
from numba import prange
from numba.np.ufunc import parallel as layer

from solvers.compiler.kernels import FLAGS, cached, registered
from solvers.compiler.pipeline import PlainCompiler

__all__ = ["parallel_kernel", "prange", "threads"]

F = TypeVar("F", bound=Callable[..., Any])


class _Process:
    """Special conditions of this process."""

    def __init__(self) -> None:
        self.serial = False  # it has threads on paper only
        self.turn = threading.RLock()

    def forked(self) -> None:
        """In the child, after a fork."""
        self.serial = self.serial or layer._is_initialized
        self.turn = threading.RLock()  # the other may belong to a thread that is not here


_PROCESS = _Process()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_PROCESS.forked)


class ParallelKernel:
    """A loop in two forms: over the threads, and on one core."""

    def __init__(self, func: Callable[..., Any]) -> None:
        update_wrapper(self, func)
        self.py_func = func

    def __call__(self, *args: Any) -> Any:
        if _PROCESS.serial:
            return self.serial(*args)
        with _PROCESS.turn:
            return self.spread(*args)

    @cached_property
    def spread(self) -> Any:
        """Over the threads."""
        return cached(numba.njit(parallel=True, pipeline_class=PlainCompiler, **FLAGS)(self.py_func))

    @cached_property
    def serial(self) -> Any:
        """On one core."""
        return cached(numba.njit(pipeline_class=PlainCompiler, **FLAGS)(self.py_func), "serial")

    @property
    def signatures(self) -> set[Any]:
        """Signatures compiled or loaded so far, of both forms."""
        return {s for form in ("spread", "serial") if form in vars(self) for s in vars(self)[form].signatures}


def parallel_kernel(func: F) -> F:
    """Compile `func` with `prange` over the cores; allowed to allocate. Only for loops over whole knots or rollouts."""
    return func if numba.config.DISABLE_JIT else cast(F, registered(ParallelKernel(func)))


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Run `parallel_kernel` loops on `count` threads inside the block."""
    before = numba.get_num_threads()
    numba.set_num_threads(count)
    try:
        yield
    finally:
        numba.set_num_threads(before)
