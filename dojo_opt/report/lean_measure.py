"""What one scene costs: unknowns, memory, microseconds; and what a new process compiles for it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_opt.report.clock import interleave
from dojo_opt.report.lean_scenes import Scene
from sim.model.layout import allocate_data, sizes_of
from sim.model.model import Law

KNOTS = 50  # steps per call
HEAVY = ("matplotlib", "meshcat", "mujoco", "scipy.optimize")  # imported only by those who use them

# One new process: a few steps and derivatives of one scene of `features`, and nothing else.
_PROGRAM = """
import json, sys, time
start = time.process_time()
import numpy as np
from dojo_opt.report.lean_scenes import features, pendulum_scene
scene = pendulum_scene("", dict(features())[sys.argv[1]])
sim, us = scene.simulator, np.zeros((3, 1))
path = sim.rollout(scene.state, us)
sim.closed_loop(scene.state, us)
sim.linearize_trajectory(path.x, us)
seconds = time.process_time() - start
from solvers.compiler import compiled_signatures
print(json.dumps({"seconds": seconds, "success": path.success, "kernels": sorted(compiled_signatures()),
                  "modules": [name for name in sys.argv[2:] if name in sys.modules]}))
"""

_VARIABLES = {Law.IMPACT: 2, Law.NONLINEAR: 4, Law.LINEAR: 12}  # of the interior point, per contact; 2 per limit


class Cost(NamedTuple):
    """What a step of one scene takes."""

    name: str
    velocities: int  # unknowns of every step
    variables: int  # of limits and near contacts
    far: int  # contacts left out
    bytes: int  # of the numbers of the mechanism, and of the scratch of one thread
    iterations: float  # per step
    step: NDArray[np.float64]  # (rounds,) [s] of a motion, each step looking from where the one before ended
    knot: NDArray[np.float64]  # (rounds,) [s] a step and its derivatives, along the same motion
    gradient: NDArray[np.float64]  # (rounds,) [s] the derivatives alone
    message: str  # why the motion ended early, or nothing

    @property
    def total(self) -> NDArray[np.float64]:
        """(rounds,) [s] of a step and of derivatives, as a planner takes both."""
        return self.step + self.gradient


def costs(scenes: Sequence[Scene], rounds: int) -> list[Cost]:
    """Costs of all scenes, timed in interleaved rounds; NaN where not even the first step is solved.

    The derivatives alone are a knot less a step that starts, as the one of a knot does, from the next velocity of the
    motion.
    """
    cases: dict[str, Callable[[], Any]] = {}
    paths = []
    for k, scene in enumerate(scenes):
        sim, x = scene.simulator, scene.state
        path = sim.rollout(x, np.zeros((KNOTS, sim.nu)))
        paths.append(path)
        if path.knot:
            us, xs = np.zeros((path.knot, sim.nu)), path.x
            cases[f"step {k}"] = lambda sim=sim, x=x, us=us: sim.closed_loop(x, us)  # type: ignore[misc]
            cases[f"known {k}"] = lambda sim=sim, x=x, us=us, xs=xs: sim.closed_loop(x, us, xs)  # type: ignore[misc]
            cases[f"knot {k}"] = lambda sim=sim, us=us, xs=xs: sim.linearize_trajectory(xs, us)  # type: ignore[misc]
    seconds = interleave(cases, rounds)
    out = []
    for k, (scene, path) in enumerate(zip(scenes, paths, strict=True)):
        nothing = np.full(rounds, np.nan)
        step, known, knot = (
            seconds.get(f"{what} {k}", nothing) / max(path.knot, 1) for what in ("step", "known", "knot")
        )
        iterations = float(np.mean(path.iterations)) if path.knot else float("nan")
        message = "" if path.success else path.message
        out.append(Cost(scene.name, *_sizes(scene, path.knot > 0), iterations, step, knot, knot - known, message))
    return out


def _sizes(scene: Scene, solved: bool) -> tuple[int, int, int, int]:
    """(velocities, variables, far, bytes) of the first step; nothing is far when it is not solved."""
    sim = scene.simulator
    far = sim.left_out(scene.state) if solved else ()
    laws = {name: Law(int(law)) for name, law in zip(sim.mechanism.contact_names, sim.model.contact_law, strict=True)}
    near = sum(_VARIABLES[law] for name, law in laws.items() if name not in far)
    near += 2 * len(sim.model.limit_dof)
    size = sum(a.nbytes for a in sim.model) + sum(a.nbytes for a in allocate_data(sizes_of(sim.model)))
    return sim.nv, near, len(far), size


def new_process(feature: str, *, cold: bool) -> dict[str, Any]:
    """seconds of processor time, kernels, and heavy modules of a new process that simulates one scene of `features`.

    cold: with an empty cache, so that it compiles everything; otherwise it loads what it finds in the cache.
    """
    with tempfile.TemporaryDirectory() if cold else nullcontext(None) as folder:
        environment = {**os.environ, **({"NUMBA_CACHE_DIR": folder, "DOJO_OPT_CACHE": "1"} if folder else {})}
        command = [sys.executable, "-c", _PROGRAM, feature, *HEAVY]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"report lean: the measured process failed\n{done.stderr}")
    return json.loads(done.stdout)
