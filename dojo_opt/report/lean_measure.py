"""What one scene costs: unknowns, memory, microseconds; and what a new process compiles for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_opt.report.clock import interleave
from dojo_opt.report.lean_scenes import Scene
from sim.layout import allocate_work, sizes_of
from sim.model import Law

KNOTS = 50  # steps per call
HEAVY = ("matplotlib", "meshcat", "mujoco", "scipy.optimize", "llvmlite.ir._utils_absent")[:4]

# One new process: a few steps and derivatives of the pendulum, or of the pendulum on a floor, and nothing else.
_PROGRAM = """
import json, sys, time
start = time.process_time()
import numpy as np
from dojo_opt.report.lean_scenes import features, pendulum_scene
scene = pendulum_scene("", features()[int(sys.argv[1])][1])
us = np.zeros((3, scene.simulator.nu))
path = scene.simulator.rollout(scene.state, us)
scene.simulator.linearize_trajectory(path.x, us)
seconds = time.process_time() - start
from solvers.jit import compiled_signatures
print(json.dumps({"seconds": seconds, "success": path.success, "kernels": sorted(compiled_signatures()),
                  "modules": [m for m in sys.argv[2].split(",") if m in sys.modules]}))
"""


class Times(NamedTuple):
    """Seconds per step in each round, shape (rounds,)."""

    step: NDArray[np.float64]  # of a motion
    gradient: NDArray[np.float64]  # of a state at rest in its last step: a linearised knot without its step


def unknowns(scene: Scene) -> dict[str, int]:
    """Unknowns of a step of the scene: velocities, and variables of near contacts and limits; and what is far."""
    sim = scene.simulator
    near, contacts, limits = sim.left_out(scene.state)
    per = {Law.IMPACT: 2, Law.NONLINEAR: 4, Law.LINEAR: 12}
    inside = sum(per[Law(int(law))] for law, is_near in zip(sim.model.contact_law, near, strict=True) if is_near)
    return {
        "velocities": sim.nv,
        "variables": inside + 2 * (len(sim.model.limit_dof) - limits),
        "far contacts": contacts,
        "far limits": limits,
    }


def memory(scene: Scene) -> int:
    """Bytes of the numbers of the mechanism, and of the scratch of one thread."""
    model = scene.simulator.model
    return sum(a.nbytes for a in model) + sum(a.nbytes for a in allocate_work(sizes_of(model)))


def times(scenes: Sequence[Scene], rounds: int) -> tuple[list[Times], list[float]]:
    """Times of the scenes, interleaved, and iterations per step.

    A scene whose motion ends early is timed as far as it goes; one that does not get anywhere has NaN.
    """
    cases: dict[str, Callable[[], Any]] = {}
    knots, iterations = [], []
    for k, scene in enumerate(scenes):
        sim, x = scene.simulator, scene.state
        path = sim.rollout(x, np.zeros((KNOTS, sim.nu)))
        knots.append(max(path.knot, 1))
        iterations.append(float(np.mean(path.iterations)) if path.knot else float("nan"))
        if not path.knot:
            continue
        us = np.zeros((path.knot, sim.nu))
        still = np.tile(path.x[-2], (path.knot, 1))
        cases[f"step {k}"] = lambda sim=sim, x=x, us=us: sim.closed_loop(x, us)  # type: ignore[misc]
        cases[f"one {k}"] = lambda sim=sim, x=still, us=us: _each(sim, x, us, 1)  # type: ignore[misc]
        cases[f"two {k}"] = lambda sim=sim, x=still, us=us: _each(sim, x, us, 2)  # type: ignore[misc]
    seconds = interleave(cases, rounds)
    nothing = np.full(rounds, np.nan)
    out = [Times(*(seconds.get(f"{what} {k}", nothing) / n for what in ("step", "one"))) for k, n in enumerate(knots)]
    return out, iterations
