"""Motions of MuJoCo that examples draw next to ours; each takes our simulator of the same mechanism."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.engines import mujoco_scene
from benchmarks.engines.mujoco_warnings import quiet
from sim.simulator.simulator import Simulator
from solvers.types import Floats

_REST = 200  # steps until a body rests on the ground


def slide(sim: Simulator, cone: str, velocity: Floats, steps: int) -> Floats:
    """(steps + 1, 2) path of a block on the ground with a cone of friction, from its own rest [m]."""
    model, data = _rested(sim, cone)
    begin, path = data.qpos[:2].copy(), np.zeros((steps + 1, 2))
    data.qvel[:] = velocity
    for k in range(steps):
        _mujoco().mj_step(model, data)
        path[k + 1] = data.qpos[:2] - begin
    return path


def drop(sim: Simulator, x: Floats, steps: int) -> Floats:
    """(steps + 1, nq) coordinates of a motion without inputs from the state x (nx,)."""
    model = mujoco_scene.load(sim.model, sim.time_step, integrator="implicitfast")
    data = mujoco_scene.state(model, x)
    path = np.zeros((steps + 1, sim.nq))
    path[0] = data.qpos
    for k in range(steps):
        _mujoco().mj_step(model, data)
        path[k + 1] = data.qpos
    return path


def push_rate(sim: Simulator, axis: int, force: float, steps: int, change: float = 1e-4) -> float:
    """d(displacement)/d(force) along an axis by a central difference, from its own rest [m/N]."""
    places = []
    for f in (force - change, force + change):
        model, data = _rested(sim, "elliptic")
        data.ctrl[axis] = f
        _mujoco().mj_step(model, data, steps)
        places.append(float(data.qpos[axis]))
    return (places[1] - places[0]) / (2.0 * change)


def drift(sim: Simulator, us: Floats, integrator: str, driven: int) -> tuple[float, float]:
    """(largest |momentum| [N m s], range of the energy over it after the first `driven` steps), from rest in space."""
    mujoco = _mujoco()
    with quiet():
        model = mujoco_scene.load(sim.model, sim.time_step, hinges=True, integrator=integrator)
        data, seen = mujoco_scene.state(model, sim.neutral()), np.empty((len(us), 2))
        for k, u in enumerate(us):
            data.ctrl[:] = u
            for derive in (mujoco.mj_step, mujoco.mj_forward, mujoco.mj_subtreeVel, mujoco.mj_energyVel):
                derive(model, data)
            seen[k] = np.abs(data.subtree_angmom[0]).max(), data.energy[1]
    energy = seen[driven:, 1]
    return float(seen[:, 0].max()), float(np.ptp(energy) / energy[0])


def _rested(sim: Simulator, cone: str) -> tuple[Any, Any]:
    """(model, data) at rest."""
    model = mujoco_scene.load(sim.model, sim.time_step, integrator="implicitfast", cone=cone)
    data = mujoco_scene.state(model, sim.neutral())
    _mujoco().mj_step(model, data, _REST)
    return model, data


def _mujoco() -> Any:
    import mujoco

    return mujoco
