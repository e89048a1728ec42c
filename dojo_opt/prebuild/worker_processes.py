"""Worker processes that compile for a target into one cache; each takes the next task when it finishes one.

A worker reads names of tasks and answers each with a line. It ends where its input ends, or with the process that
started it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from dojo_opt.prebuild.tasks import run
from solvers.compiler import compiled
from solvers.compiler.helper_process import end_with
from solvers.compiler.targets import build_environment

__all__ = ["BuildError", "Done", "compile_tasks", "work"]

_ROOT = str(Path(__file__).resolve().parents[2])
_ANSWER = "done"


class BuildError(RuntimeError):
    """A task failed, or its worker did."""


class Done(NamedTuple):
    """A task that is done."""

    task: str
    seconds: float
    compiled: int  # functions


def work() -> int:
    """Carry out tasks, named line by line at the standard input, until it ends."""
    threading.Thread(target=end_with, args=(os.getppid(),), daemon=True).start()
    for line in sys.stdin:
        begin, before = time.perf_counter(), len(compiled())
        run(line.strip())
        print(_ANSWER, f"{time.perf_counter() - begin:.3f}", len(compiled()) - before, flush=True)
    return 0


def _environment(target: str, cache: Path, systems: Sequence[str]) -> dict[str, str]:
    """Of a worker: Numba's variables, and no code but its own."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "DOJO_OPT_"))}
    path = os.pathsep.join([_ROOT, *filter(None, [os.environ.get("PYTHONPATH")])])
    own = {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(cache), "DOJO_OPT_SHIPPED": "0", "OPENBLAS_NUM_THREADS": "1"}
    own["DOJO_OPT_JOBS"] = "1"  # a worker has no helper
    own["DOJO_OPT_CROSS"] = " ".join(systems)
    return {**inherited, **own, **build_environment(target)}


class _Worker:
    """One process."""

    def __init__(self, environment: dict[str, str]) -> None:
        command = [sys.executable, "-m", "dojo_opt.prebuild", "--worker"]
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=_ROOT
        )

    def tell(self, task: str) -> Done:
        """Have a task carried out.  BuildError: that failed; the standard error says why."""
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            print(task, file=self._process.stdin, flush=True)
        except BrokenPipeError:
            pass
        for line in self._process.stdout:  # output of a task comes before its answer
            words = line.split()
            if len(words) == 3 and words[0] == _ANSWER:
                return Done(task, float(words[1]), int(words[2]))
        raise BuildError(f"task {task!r} failed with exit status {self._process.wait()}")

    def close(self) -> None:
        """Let it end."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()


def compile_tasks(
    tasks: Sequence[str],
    target: str,
    cache: Path,
    jobs: int,
    progress: Callable[[Done, int], None],
    systems: Sequence[str] = (),
) -> None:
    """Carry out the tasks in worker processes.

    Args:
        tasks: by name, the longest first.
        target: the processor to compile for, one of `targets.FEATURES`.
        cache: folder that the workers share.
        jobs: number of processes.
        progress: called with each task that is done, and the number of those that remain.
        systems: others to translate for, of `crossing.SYSTEMS`; each has a folder of its own in the cache.

    Raises:
        BuildError: a task failed.
    """
    environment, left = _environment(target, cache, systems), deque(tasks)

    def carry_out() -> Iterator[Done]:
        worker = _Worker(environment)
        try:
            while True:
                try:
                    task = left.popleft()
                except IndexError:
                    return
                yield worker.tell(task)
        except BaseException:
            left.clear()
            raise
        finally:
            worker.close()

    def serve() -> None:
        for done in carry_out():
            progress(done, len(left))

    with ThreadPoolExecutor(jobs) as pool:
        for future in [pool.submit(serve) for _ in range(jobs)]:
            future.result()
