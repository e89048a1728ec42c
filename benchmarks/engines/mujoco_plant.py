"""A plant of closed loops that MuJoCo moves, with its default contacts: soft, with its own solver and friction cone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.engines.mujoco_scene import mjcf, without_reset
from dojo_opt.plant.perturbation import Perturbation
from dojo_opt.plant.plant import Plant
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, Capsule, Cylinder, HalfSpace, Solid, Sphere
from sim.mechanism.terrain import Terrain
from sim.simulator.results import StepResult
from sim.simulator.simulator import Simulator
from solvers.status import Status
from solvers.types import Vector

__all__ = ["MujocoPlant"]

_ROW = 11  # numbers of a contact of a step: impulse 3, point 3, gap, slip speed, normal 3
_GAP = 6
_ACROSS = 0.5 * np.arange(-20.0, 21.0)  # [m] grid lines across a height field that is the same for all y
_BASE = 0.1  # [m] of a height field below its lowest point


class MujocoPlant(Plant):
    """A robot in MuJoCo's world: measured and commanded as a `dojo.Plant` is, but moved by MuJoCo.

    Bodies, joints and actuators come from the simulator's mechanism; contacts are MuJoCo's own, with its default
    solref and solimp, between the shapes of the mechanism's contacts and collisions and nothing else. The contacts of
    the record have gaps, negative where bodies overlap, and no impulses.

    Args:
        sim: mechanism and time step.
        start: (nx,) first state.
        **options: attributes of MJCF's <option>, such as impratio="10" (default: MuJoCo's own, so a pyramidal cone).

    Raises:
        ImportError: MuJoCo is not installed.
        ValueError: for a mechanism that cannot be written for MuJoCo.
    """

    def __init__(self, sim: Simulator, start: Vector, **options: str) -> None:
        import mujoco

        self._step = mujoco.mj_step
        self._model, self._index = _scene(sim, {"cone": "pyramidal", **options})
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
        self._data.qpos[:], self._data.qvel[:] = self.x[: self.nominal.nq], self.x[self.nominal.nq :]
        mujoco.mj_forward(self._model, self._data)

    def step(self, command: Vector) -> tuple[Vector, StepResult]:
        """One time step of MuJoCo; see `Plant.step`."""
        u, data = np.clip(command, *self._limits), self._data
        data.ctrl[:] = u
        self._step(self._model, data)
        x = np.concatenate([data.qpos, data.qvel])
        rows = np.zeros((self.nominal.ncontact, _ROW))
        rows[:, _GAP] = np.inf
        for k in range(data.ncon):
            contact = data.contact[k]
            at = self._index[frozenset((int(contact.geom1), int(contact.geom2)))]
            rows[at, _GAP] = min(rows[at, _GAP], float(contact.dist))
        status = Status.SOLVED if np.all(np.isfinite(x)) else Status.NOT_FINITE
        result = StepResult(x, status, 0, 0.0, 0.0, (self.nominal.mechanism, self.nominal.time_step, rows))
        if status == Status.SOLVED:
            self.x = x
            self.steps += 1
        return u, result


def _scene(sim: Simulator, options: dict[str, str]) -> tuple[Any, dict[frozenset[int], int]]:
    """(MjModel, number of our contact by the numbers of its two geoms)."""
    import mujoco

    mechanism: Mechanism = replace(sim.mechanism, collisions=(), contacts=_on_planes(sim.mechanism))
    bare = Simulator(mechanism, time_step=sim.time_step)
    spec = mujoco.MjSpec.from_string(mjcf(bare.model, sim.time_step, hinges=False, **options))
    names = sim.mechanism.body_names
    first: dict[str, int] = {}  # number of the first contact point of a collision
    for k, candidate in enumerate(sim.mechanism.contact_candidates):
        first.setdefault(candidate.collision, len(sim.mechanism.contacts) + k)
    pairs = {}
    for k, collision in enumerate(sim.mechanism.collisions):
        geoms = []
        for side, (name, shape) in enumerate(_sides(sim.mechanism, collision)):
            body = spec.worldbody if name == "world" else spec.body(f"body{names.index(name)}")
            place = {"pos": np.asarray(shape.center), "quat": np.asarray(shape.orientation), "mass": 0.0}
            kind = _mesh(spec, shape) if isinstance(shape, Polytope) else _geom(shape)
            geom = body.add_geom(name=f"collision{k}_{side}", contype=0, conaffinity=0, **kind, **place)
            geoms.append(geom.name)
        mu = float(collision.friction or 0.0)
        friction = [mu, mu, 0.005, 1e-4, 1e-4]
        spec.add_pair(geomname1=geoms[0], geomname2=geoms[1], condim=3 if mu else 1, friction=friction)
        pairs[k] = geoms
    hills = _height_fields(spec, sim.mechanism)
    model = without_reset(spec.compile())
    number = {name: mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in _geom_names(mujoco, model)}
    index: dict[frozenset[int], int] = {}
    for name, geom in number.items():
        if name.startswith("contact"):
            index |= {frozenset((geom, number[p])): int(name[7:]) for p in number if p.startswith("plane")}
    index |= {frozenset((number[f"contact{k}"], number[geom])): k for k, geom in hills.items()}
    for k, geoms in pairs.items():
        index[frozenset(number[g] for g in geoms)] = first[sim.mechanism.collisions[k].name]
    return model, index


def _on_planes(mechanism: Mechanism) -> list[Contact]:
    """The contacts, on a plane at the lowest height of their terrain."""
    return [
        contact
        if contact.terrain is None
        else replace(contact, terrain=None, height=float(np.min(np.asarray(contact.terrain.heights))))
        for contact in mechanism.contacts
    ]


def _height_fields(spec: Any, mechanism: Mechanism) -> dict[int, str]:
    """Add a height field per terrain, paired with the contacts on it: the name of its geom by number of the contact."""
    import mujoco

    terrains: list[Terrain] = []
    geoms: dict[int, str] = {}
    for k, contact in enumerate(mechanism.contacts):
        if contact.terrain is None:
            continue
        if contact.terrain not in terrains:
            terrains.append(contact.terrain)
        name = f"terrain{terrains.index(contact.terrain)}"
        if name not in geoms.values():
            spec.add_hfield(name=name, **_grid(contact.terrain))
            geom = spec.worldbody.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=name)
            geom.pos, geom.quat = _middle(contact.terrain)
            geom.contype = geom.conaffinity = 0
        mu = float(contact.friction)
        spec.add_pair(geomname1=name, geomname2=f"contact{k}", condim=3, friction=[mu, mu, 0.005, 1e-4, 1e-4])
        geoms[k] = name
    return geoms


def _across(terrain: Terrain) -> tuple[Vector, Vector]:
    """Heights (nx, ny) [m] and places (ny,) of the grid lines across [m]."""
    heights = np.asarray(terrain.heights)
    if heights.shape[1] == 1:
        return np.repeat(heights, len(_ACROSS), axis=1), _ACROSS
    return heights, np.asarray(terrain.spacing)[1] * np.arange(heights.shape[1])


def _grid(terrain: Terrain) -> dict[str, Any]:
    """Size and data of MuJoCo's height field, which has rows along y.

    ValueError: the ground beyond it is not level at its lowest height.
    """
    heights, y = _across(terrain)
    low, high = float(heights.min()), float(heights.max())
    edges = [heights[0], heights[-1]] + (
        [heights[:, 0], heights[:, -1]] if np.asarray(terrain.heights).shape[1] > 1 else []
    )
    if terrain.plane is not None or high <= low or not np.allclose(np.concatenate(edges), low):
        raise ValueError(f"MujocoPlant: expected a terrain that rises from level ground, got {terrain!r}")
    half = 0.5 * np.asarray(terrain.spacing)[0] * (len(heights) - 1), 0.5 * np.ptp(y)
    nx, ny = heights.shape
    return {"nrow": ny, "ncol": nx, "size": [*half, high - low, _BASE], "userdata": heights.T.ravel()}


def _middle(terrain: Terrain) -> tuple[Vector, Vector]:
    """Place of the middle of the height field at its lowest height [m], and its quaternion."""
    heights, y = _across(terrain)
    c, s = np.asarray(terrain.direction)
    along, across = 0.5 * np.asarray(terrain.spacing)[0] * (len(heights) - 1), 0.5 * (y[0] + y[-1])
    place = np.asarray(terrain.origin) + along * np.array([c, s]) + across * np.array([-s, c])
    half = 0.5 * np.arctan2(s, c)
    return np.array([*place, heights.min()]), np.array([np.cos(half), 0.0, 0.0, np.sin(half)])


def _geom_names(mujoco: Any, model: Any) -> list[str]:
    return [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, g) for g in range(model.ngeom)]


def _sides(mechanism: Mechanism, collision: Collision) -> list[tuple[str, Solid]]:
    """Body and shape of both sides."""
    shapes = {body.name: body.shapes for body in mechanism.bodies}
    out = []
    for name, shape in ((collision.a, collision.shape_a), (collision.b or "world", collision.shape_b)):
        out.append((name, shapes[name][0] if shape is None else shape))
    return out


def _mesh(spec: Any, shape: Polytope) -> dict[str, Any]:
    """Type and mesh of a geom whose convex hull is a polytope; the mesh is added once per polytope."""
    import mujoco

    corners = np.ravel(shape.vertices)
    name = f"hull{hash(shape.vertices)}"
    if spec.mesh(name) is None:
        spec.add_mesh(name=name, uservert=corners)
    return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": name}


def _geom(shape: Solid) -> dict[str, Any]:
    """Type and size of a geom."""
    import mujoco

    kinds = mujoco.mjtGeom
    match shape:
        case Sphere():
            return {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0]}
        case Capsule():
            return {"type": kinds.mjGEOM_CAPSULE, "size": [shape.radius, 0.5 * shape.length, 0.0]}
        case Cylinder():
            return {"type": kinds.mjGEOM_CYLINDER, "size": [shape.radius, 0.5 * shape.length, 0.0]}
        case Box():
            return {"type": kinds.mjGEOM_BOX, "size": [0.5 * shape.x, 0.5 * shape.y, 0.5 * shape.z]}
        case HalfSpace():
            return {"type": kinds.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0]}
    raise ValueError(f"MujocoPlant: no geom for a {type(shape).__name__}")
