"""A new process that simulates one scene: the seconds that it takes, and the kernels that it compiles."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from contextlib import nullcontext
from typing import Any

HEAVY = ("matplotlib", "meshcat", "mujoco", "scipy.optimize")  # imported only by those who use them

# One new process: a few steps and derivatives of one scene of `features`, and nothing else.
_PROGRAM = """
import json, sys, time
start = time.process_time()
import numpy as np
from benchmarks.studies.lean.lean_scenes import features, pendulum_scene
scene = pendulum_scene("", dict(features())[sys.argv[1]])
sim, us = scene.simulator, np.zeros((3, 1))
path = sim.rollout(scene.state, us)
sim.rollout_feedback(scene.state, us)
sim.linearize_trajectory(path.x, us)
seconds = time.process_time() - start
from solvers.compiler import compiled_signatures
assert path.success, path.message
print(json.dumps({"seconds": seconds, "kernels": sorted(compiled_signatures()),
                  "modules": [name for name in sys.argv[2:] if name in sys.modules]}))
"""


def new_process(feature: str, *, cold: bool) -> dict[str, Any]:
    """seconds of processor time, kernels, and heavy modules of a new process that simulates one scene of `features`.

    cold: with an empty cache and no shipped code, so that it compiles everything; otherwise it loads existing code.
    """
    with tempfile.TemporaryDirectory() if cold else nullcontext(None) as folder:
        path = os.pathsep.join(filter(None, sys.path))  # of the checkout, too
        cache = (
            {"NUMBA_CACHE_DIR": folder, "DOJO_OPT_CACHE": "1", "DOJO_OPT_SHIPPED": "0", "DOJO_OPT_JOBS": "1"}
            if folder
            else {}
        )
        environment = {**os.environ, "PYTHONPATH": path, **cache}
        command = [sys.executable, "-c", _PROGRAM, feature, *HEAVY]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"report lean: the measured process failed\n{done.stderr}")
    return json.loads(done.stdout)
