"""Apart: call engines that may end their process, as libraries in C do, in a separate process.

One process serves all calls, so that its start and the loading of compiled code are paid once; it measures its own
processor time. It is started by the first call, and again by the one after it has ended.
"""

from __future__ import annotations

import atexit
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from typing import Any, TypeVar

Simulate = TypeVar("Simulate", bound=Callable[..., Any])

_PROGRAM = "from benchmarks.engines.separate_process import serve; serve()"
_PATIENCE = 10.0  # [s] for the process to end at exit


class ProcessEnded(Exception):
    """The process of an engine ended during a call; the message has the signal."""


class _EngineProcess:
    """The process, and the pipes to and from it."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, request: Any) -> Any:
        """The process's answer.   ProcessEnded: it ended instead."""
        if self._process is None:
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
            command, pipe = [sys.executable, "-c", _PROGRAM], subprocess.PIPE
            self._process = subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe)
        try:
            return _exchange(self._process, pickle.dumps(request))
        except (EOFError, OSError, pickle.UnpicklingError):
            raise ProcessEnded(self._end()) from None
        except BaseException:  # as an interrupt: an answer that is still to come belongs to no later request
            self._process.kill()
            self._end()
            raise

    def _end(self) -> str:
        """Wait for a process that is ending, and describe its end."""
        process, self._process = self._process, None
        assert process is not None
        with suppress(OSError):  # the unread rest of a request
            process.communicate()
        code = process.returncode
        return f"ended with exit status {code}" if code >= 0 else f"ended by signal {-code} ({signal.strsignal(-code)})"

    def stop(self) -> None:
        """End the process."""
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.close()
            self._process.wait(_PATIENCE)
            self._process = None


def _exchange(process: subprocess.Popen[bytes], request: bytes) -> Any:
    """The answer of the process."""
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(request)
    process.stdin.flush()
    return pickle.load(process.stdout)


_worker = _EngineProcess()
_serving = False
atexit.register(_worker.stop)


def apart(simulate: Simulate) -> Simulate:
    """A `simulate` that runs in the process of the engines; its exceptions are raised here.

    The engine has to be picklable.   ProcessEnded: it ended the process.
    """

    @wraps(simulate)
    def run(engine: Any, *given: Any, **named: Any) -> Any:
        if _serving:
            return simulate(engine, *given, **named)
        answer, error = _worker.ask((os.getcwd(), engine, simulate.__name__, given, named))
        if error is not None:
            raise error
        return answer

    return run  # type: ignore[return-value]


def serve() -> None:
    """Answer requests from standard input until it is closed; output of libraries goes to standard error."""
    global _serving
    _serving = True
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while True:
        try:
            folder, engine, method, given, named = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        os.chdir(folder)
        try:
            answer = pickle.dumps((getattr(engine, method)(*given, **named), None))
        except Exception as error:
            answer = pickle.dumps((None, error))
        answers.write(answer)
        answers.flush()
