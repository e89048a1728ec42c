"""Programs that tests run in forks of one process, which has loaded Numba and compiled something: half the time of each.

For questions about this package's own code, which no fork has loaded. Whatever Numba reads when it is loaded, and whole
programs as a user starts them, need `programs.python`.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import IO

from support.programs import HOME

SERVER = """
import gc, json, os, sys, threading, traceback, warnings
import numba, numpy

numba.njit(lambda x: x + 1.0)(1.0)
gc.collect()
gc.freeze()  # a collection in a fork would copy all objects of Numba: half of its processor time


def fork():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # threads of the linear algebra: none holds a lock here
        return os.fork()


def answer(job):
    pipes = [os.pipe(), os.pipe()]
    child = fork()
    if child == 0:
        for number, (_, write) in enumerate(pipes, 1):
            os.dup2(write, number)
        os.environ.clear()
        os.environ.update(job["environment"])
        numba.core.config.reload_config()
        sys.pycache_prefix, sys.dont_write_bytecode = job["bytecode"]
        os.chdir(job["cwd"])
        sys.path[:0] = job["path"]
        code = 0
        try:
            exec(compile(job["program"], "<string>", "exec"), {"__name__": "__main__"})
        except BaseException:
            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        os._exit(code)
    found = [b"", b""]

    def read(k):
        with os.fdopen(pipes[k][0], "rb") as pipe:
            found[k] = pipe.read()

    for _, write in pipes:
        os.close(write)
    other = threading.Thread(target=read, args=(1,))
    other.start()
    read(0)
    other.join()
    return [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), *(text.decode() for text in found)]


for line in sys.stdin:
    print(json.dumps(answer(json.loads(line))), flush=True)
"""


@cache
def _server() -> tuple[IO[str], IO[str]]:
    """(its input, its output); it ends with this process."""
    server = subprocess.Popen(
        [sys.executable, "-W", "error", "-c", SERVER],
        env={**os.environ, "PYTHONPATH": "", "PYTHONSAFEPATH": "1", "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdin is not None and server.stdout is not None
    streams = server.stdin, server.stdout

    def end() -> None:
        streams[0].close()
        server.wait()
        streams[1].close()

    atexit.register(end)
    return streams


def forked(program: str, *, cwd: Path | None = None, home: Path = HOME, **environment: str) -> str:
    """Output of `program`, as `programs.python` has it; no variable that Numba reads as it is loaded."""
    if not hasattr(os, "fork"):
        from support.programs import python

        return python(program, cwd=cwd, home=home, **environment)
    kept = (sys.pycache_prefix, sys.dont_write_bytecode) if home == HOME else (None, False)  # a copy is the test's own
    job = {
        "program": program,
        "cwd": str(cwd or os.getcwd()),
        "path": [str(home)] if cwd is None else [str(cwd), str(home)],
        "bytecode": kept,
        "environment": {**os.environ, **environment},
    }
    send, receive = _server()
    send.write(json.dumps(job) + "\n")
    send.flush()
    code, out, error = json.loads(receive.readline())
    assert code == 0, error
    return str(out)
