"""Code that the first step of a scene compiles, by feature, from an empty cache and without shipped code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import Any

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Table
from sim.mechanism.mechanism import Mechanism

_FOREIGN = {  # rooms with kernels that a scene needs only with the feature
    "contacts": ("sim.contact.", "solvers.cones"),
    "pairs": ("sim.contact.pairs.", "sim.contact.collision."),
    "loops": ("sim.dynamics.loops.", "sim.solve.loop_branch"),
}
_PROGRAM = """
import json, sys, time
begin = time.process_time()
import dojo_opt as dojo
from benchmarks.studies.timing.cold_features import SCENES
sim = dojo.Simulator(SCENES[sys.argv[1]](), time_step=0.01)
found = sim.step(sim.neutral())
seconds = time.process_time() - begin
from solvers.compiler import compiled
assert found.success, found.message
print(json.dumps({"seconds": seconds, "functions": compiled()}))
"""


def _hinged(limits: tuple[float, float] | None) -> Mechanism:
    joint = dojo.Joint("revolute", None, "rod", axis=(0.0, 1.0, 0.0), child_point=(0.0, 0.0, 0.5), limits=limits)
    return dojo.Mechanism([dojo.Body("rod", 1.0, (0.1, 0.1, 0.01))], [joint])


def _balls() -> Mechanism:
    bodies = [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in "ab"]
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    apart = {"b": (0.25, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)}
    return dojo.Mechanism(bodies, joints, collisions=[dojo.Collision("a", "b")], neutral=apart)


SCENES: dict[str, Callable[[], Mechanism]] = {
    "pendulum": lambda: _hinged(None),
    "pendulum with a limit": lambda: _hinged((-1.0, 1.0)),
    "block on the ground": dojo.models.block,
    "four-bar": dojo.models.fourbar,
    "two balls that may touch": _balls,
}


def cold_step(name: str) -> dict[str, Any]:
    """seconds of processor time and functions compiled of a new process that makes one step of a scene."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.pathsep.join(filter(None, sys.path))  # of the checkout, too
        own = {"PYTHONPATH": path, "NUMBA_CACHE_DIR": folder, "DOJO_OPT_CACHE": "1", "DOJO_OPT_SHIPPED": "0"}
        own["DOJO_OPT_JOBS"] = "1"  # no helper, whose functions and seconds would not be counted
        command = [sys.executable, "-c", _PROGRAM, name]
        done = subprocess.run(command, env={**os.environ, **own}, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"report compile: the measured process failed\n{done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def cold_table(measured: dict[str, dict[str, Any]]) -> Table:
    """The results of `cold_step` by scene, with the functions from rooms that few scenes need."""
    rows: list[list[Cell]] = []
    for name, found in measured.items():
        kernels = found["functions"]
        foreign = [sum(kernel.startswith(rooms) for kernel in kernels) for rooms in _FOREIGN.values()]
        rows.append([name, found["seconds"], len(kernels), *foreign])
    header = ["scene", "processor time [s]", "functions", *(f"of {room}" for room in _FOREIGN)]
    return Table("First step of a scene, from an empty cache and without shipped code", header, rows)
