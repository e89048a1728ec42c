"""Programs that tests run in separate processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import dojo_opt as dojo

PACKAGES = ("dojo_opt", "sim", "solvers")
HOME = Path(dojo.__file__).resolve().parent.parent  # where the three packages are: the source tree, or an installation


def python(program: str, *, cwd: Path | None = None, home: Path = HOME, **environment: str) -> str:
    """Output of `program` in a new process that finds the packages below `home`."""
    if home == HOME and sys.pycache_prefix:  # not of copies, which are read once
        environment = {"PYTHONPYCACHEPREFIX": sys.pycache_prefix, "PYTHONDONTWRITEBYTECODE": "", **environment}
    path = os.pathsep.join([str(home)] if cwd is None else [str(cwd), str(home)])
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env={**os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "1", "DOJO_OPT_JOBS": "1", **environment},
        cwd=cwd,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
