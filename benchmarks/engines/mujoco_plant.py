"""A plant of closed loops that MuJoCo moves, with its default contacts: soft, with its own solver and friction cone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.engines.mujoco_scene import mjcf
from dojo_opt.plant.perturbation import Perturbation
from dojo_opt.plant.plant import Plant
from sim.mechanism.collision import Collision
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Capsule, Cylinder, HalfSpace, Solid, Sphere
from sim.simulator.results import StepResult
from sim.simulator.simulator import Simulator
from solvers.status import Status
from solvers.types import Vector

__all__ = ["MujocoPlant"]

_ROW = 11  # numbers of a contact of a step: impulse 3, point 3, gap, slip speed, normal 3
_GAP = 6


class MujocoPlant(Plant):
    """A robot in MuJoCo's world: measured and commanded as a `dojo.Plant` is, but moved by MuJoCo.

    Bodies, joints and actuators come from the simulator's mechanism; contacts are MuJoCo's own, with its default
    solref and solimp, between the shapes of the mechanism's contacts and collisions and nothing else. The contacts of
    the record have gaps, negative where bodies overlap, and no impulses.

    Args:
        sim: mechanism and time step.
        start: (nx,) first state.

    Raises:
        ImportError: MuJoCo is not installed.
        ValueError: for a mechanism that cannot be written for MuJoCo.
    """

    def __init__(self, sim: Simulator, start: Vector) -> None:
        import mujoco

        self._step = mujoco.mj_step
        self._model, self._index = _scene(sim)
        self._data = mujoco.MjData(self._model)
        super().__init__(sim, start)
        places = sim.maximal(self.x)[:, :3]
        mujoco.mj_kinematics(self._model, self._data)
        if not np.allclose(self._data.xipos[1:], places, atol=1e-9):
            raise ValueError(f"MujocoPlant: the bodies of {sim.mechanism.name!r} are elsewhere in MuJoCo")

    def perturbed(self, perturbation: Perturbation) -> Plant:
        """Refused: a perturbation changes our simulator, not MuJoCo's model."""
        raise ValueError("MujocoPlant.perturbed: only the start of this plant can be chosen")

    def reset(self) -> None:
        """Put the robot back to its start."""
        super().reset()
        import mujoco

        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:] = self.x[: self.sim.nq], self.x[self.sim.nq :]
        mujoco.mj_forward(self._model, self._data)

    def step(self, command: Vector) -> tuple[Vector, StepResult]:
        """One time step of MuJoCo; see `Plant.step`."""
        u, data = np.clip(command, *self._limits), self._data
        data.ctrl[:] = u
        self._step(self._model, data)
        x = np.concatenate([data.qpos, data.qvel])
        rows = np.zeros((self.sim.ncontact, _ROW))
        rows[:, _GAP] = np.inf
        for k in range(data.ncon):
            contact = data.contact[k]
            at = self._index[frozenset((int(contact.geom1), int(contact.geom2)))]
            rows[at, _GAP] = min(rows[at, _GAP], float(contact.dist))
        status = Status.SOLVED if np.all(np.isfinite(x)) else Status.NOT_FINITE
        result = StepResult(x, status, 0, 0.0, 0.0, (self.sim.mechanism, self.sim.time_step, rows))
        if status == Status.SOLVED:
            self.x = x
            self.steps += 1
        return u, result


def _scene(sim: Simulator) -> tuple[Any, dict[frozenset[int], int]]:
    """(MjModel, number of our contact by the numbers of its two geoms)."""
    import mujoco

    mechanism: Mechanism = replace(sim.mechanism, collisions=())
    bare = Simulator(mechanism, time_step=sim.time_step)
    spec = mujoco.MjSpec.from_string(mjcf(bare.model, sim.time_step, cone="pyramidal"))
    names = sim.mechanism.body_names
    first: dict[str, int] = {}  # number of the first contact point of a collision
    for k, touch in enumerate(sim.mechanism.touches):
        first.setdefault(touch.collision, len(sim.mechanism.contacts) + k)
    pairs = {}
    for k, collision in enumerate(sim.mechanism.collisions):
        geoms = []
        for side, (name, shape) in enumerate(_sides(sim.mechanism, collision)):
            body = spec.worldbody if name == "world" else spec.body(f"body{names.index(name)}")
            geom = body.add_geom(name=f"collision{k}_{side}", contype=0, conaffinity=0, mass=0.0, **_geom(shape))
            geoms.append(geom.name)
        mu = float(collision.friction or 0.0)
        friction = [mu, mu, 0.005, 1e-4, 1e-4]
        spec.add_pair(geomname1=geoms[0], geomname2=geoms[1], condim=3 if mu else 1, friction=friction)
        pairs[k] = geoms
    model = spec.compile()
    number = {name: mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in _geom_names(mujoco, model)}
    index: dict[frozenset[int], int] = {}
    for name, geom in number.items():
        if name.startswith("contact"):
            index |= {frozenset((geom, number[p])): int(name[7:]) for p in number if p.startswith("plane")}
    for k, geoms in pairs.items():
        index[frozenset(number[g] for g in geoms)] = first[sim.mechanism.collisions[k].name]
    return model, index


def _geom_names(mujoco: Any, model: Any) -> list[str]:
    return [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, g) for g in range(model.ngeom)]


def _sides(mechanism: Mechanism, collision: Collision) -> list[tuple[str, Solid]]:
    """Body and shape of both sides."""
    shapes = {body.name: body.shapes for body in mechanism.bodies}
    out = []
    for name, shape in ((collision.a, collision.shape_a), (collision.b or "world", collision.shape_b)):
        out.append((name, shapes[name][0] if shape is None else shape))
    return out


def _geom(shape: Solid) -> dict[str, Any]:
    """Type, size and place of a geom."""
    import mujoco

    kinds = mujoco.mjtGeom
    place = {"pos": np.asarray(shape.center), "quat": np.asarray(shape.orientation)}
    match shape:
        case Sphere():
            return {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0], **place}
        case Capsule():
            return {"type": kinds.mjGEOM_CAPSULE, "size": [shape.radius, 0.5 * shape.length, 0.0], **place}
        case Cylinder():
            return {"type": kinds.mjGEOM_CYLINDER, "size": [shape.radius, 0.5 * shape.length, 0.0], **place}
        case Box():
            return {"type": kinds.mjGEOM_BOX, "size": [0.5 * shape.x, 0.5 * shape.y, 0.5 * shape.z], **place}
        case HalfSpace():
            return {"type": kinds.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0], **place}
    raise ValueError(f"MujocoPlant: no geom for a {type(shape).__name__}")
