"""A helper: a second process that compiles kernels beside this one, into the same cache, on another core.

Each of the two takes the largest kernel that is left, and loads the results of the helper from the cache. A helper
that fails, or ends, leaves its kernels to this process. Nothing is started where one core is available, where the code
is not kept on disk, or where fewer than two kernels have to be compiled.

    DOJO_OPT_JOBS=1    no helper
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numba

from solvers.compiler.cache import STORE
from solvers.compiler.garbage import seldom_collected
from solvers.compiler.progress import expect

__all__ = ["divided", "end_with", "serve"]

_JOBS = "DOJO_OPT_JOBS"
_PROGRAM = "from solvers.compiler.optional import help_out; help_out()"
_ANSWER = "done"
_LOOK = 0.5  # [s] between two looks for the process that started a helper


class Job(Protocol):
    """A kernel to compile."""

    name: str  # module:function
    func: Callable[..., Any]

    def at_hand(self) -> bool:
        """Whether it was compiled before."""

    def address(self) -> int:
        """Load it or compile it."""


J = TypeVar("J", bound=Job)


def divided(jobs: Sequence[J]) -> Generator[J, None, None]:
    """The jobs, in an order in which a helper has done those that come late."""
    missing = [job for job in jobs if not job.at_hand()]
    callees: set[str] = set()
    for job in missing:
        _size(job.func, callees)
    expect(len(missing) + len(callees))
    yield from (job for job in jobs if job not in missing)
    if len(missing) < 2 or not _possible():
        yield from missing
        return
    left = deque(sorted(missing, key=lambda job: _size(job.func, set()), reverse=True))
    helper = _Helper(left)
    try:
        while left:
            try:
                job = left.popleft()
            except IndexError:  # the helper took the last one
                break
            yield job
    except BaseException:  # of the caller, too, who compiles the rest
        helper.stop()
        raise
    yield from helper.finish()


def _size(func: Callable[..., Any], seen: set[str]) -> int:
    """Bytes of Python's code of a kernel, and of all kernels that it calls: a measure of the time that it takes."""
    found: list[Any] = [func.__globals__.get(name) for name in func.__code__.co_names]
    called = {callee.__qualname__: callee.py_func for callee in found if hasattr(callee, "py_func")}
    new = {name: callee for name, callee in called.items() if name not in seen}
    seen |= set(new)
    return len(func.__code__.co_code) + sum(_size(callee, seen) for callee in new.values())


def _possible() -> bool:
    """Whether a helper can be started, and would save time."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    python = Path(sys.executable or "").name.lower().startswith("python")  # not a program with a Python inside
    wanted = os.environ.get(_JOBS, "2") != "1" and not numba.config.DISABLE_JIT
    return wanted and python and cores > 1 and STORE.folder is not None


class _Helper:
    """The process, and a thread that gives it a job of the queue whenever it is done with one."""

    def __init__(self, left: deque[Any]) -> None:
        self._left, self._taken = left, list[Any]()
        self._process: subprocess.Popen[str] | None = None
        self._thread = threading.Thread(target=self._feed, daemon=True)
        self._thread.start()

    def finish(self) -> list[Any]:
        """Wait for the present job; all that the helper was given."""
        self._thread.join()
        return self._taken

    def stop(self) -> None:
        """End it, in the middle of a job."""
        self._left.clear()
        if self._process is not None:
            self._process.kill()
        self._thread.join()

    def _feed(self) -> None:
        """Until the queue is empty, or the helper fails."""
        folders = [os.path.abspath(folder) for folder in sys.path]  # an empty one is the present one
        own = {"PYTHONPATH": os.pathsep.join(folders), _JOBS: "1", "DOJO_OPT_QUIET": "1", "OPENBLAS_NUM_THREADS": "1"}
        try:
            self._process = process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM],
                env={**os.environ, **own},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError:  # the system refuses another process
            return
        with process:
            try:
                while self._left and self._give(process):
                    pass
            except (IndexError, OSError):  # this process was faster, or the helper ended
                pass

    def _give(self, process: subprocess.Popen[str]) -> bool:
        """Have the next job done; whether the helper is alive."""
        assert process.stdin is not None and process.stdout is not None
        if process.stdout.readline().strip() != _ANSWER:  # ready, after its imports
            return False
        job = self._left.popleft()
        self._taken.append(job)
        print(job.name, file=process.stdin, flush=True)
        return True


def serve(job: Callable[[Any], Job]) -> None:
    """Compile the kernels that the standard input names, until it ends.   job: that of a kernel."""
    threading.Thread(target=end_with, args=(os.getppid(),), daemon=True).start()
    print(_ANSWER, flush=True)
    with seldom_collected():
        for line in sys.stdin:
            module, name = line.strip().split(":")
            job(vars(import_module(module))[name]).address()
            print(_ANSWER, flush=True)


def end_with(parent: int) -> None:
    """End this process, in the middle of a job, when the one that started it is gone. Files are written atomically."""
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(1)
