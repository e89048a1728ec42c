"""GeomGroup: bodies of an MJCF file that are welded together, as one body of the mechanism."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sim.io.meshes.reduced_hull import reduced_hull
from sim.io.urdf.inertia import RigidInertia, combined
from sim.io.urdf.solids import named
from sim.mechanism.polytope import Polytope
from sim.mechanism.pose import HERE, Pose
from sim.mechanism.shapes import Box, Capsule, Cylinder, Ellipsoid, Solid, Sphere, rotation_matrix
from solvers.types import Floats

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = 0, 2, 3, 4, 5, 6, 7  # mjtGeom
NO_SHAPE = {1: "height field", 8: "signed distance field"}


@dataclass
class GeomGroup:
    """A body that joints carry, and the bodies without joints that hang on it; all in the frame of the first."""

    name: str
    body: int  # its first one in the file
    parent: GeomGroup | None  # None: the world
    pose: Pose  # of its frame in that of the parent, all joints at zero displacement
    inertia: RigidInertia = field(default_factory=lambda: combined([]))
    members: dict[int, Pose] = field(default_factory=dict)

    @property
    def com(self) -> Floats:
        """Centre of mass, in the group's frame [m]."""
        return self.inertia.com


Where = dict[
    int, tuple[GeomGroup | None, Pose]
]  # of every body of the file, its group (None: the world) and pose in it


def name_of(model: Any, kind: str, index: int) -> str:
    """Name of a body, joint, geom or actuator; made from its number where the file gives none."""
    given = getattr(model, kind)(index).name if hasattr(model, kind) else ""  # flexes have none
    return str(given) if given else f"{kind}_{index}"


def pose_of(position: Floats, quaternion: Floats) -> Pose:
    """Pose from MuJoCo's arrays."""
    unit = np.asarray(quaternion, dtype=np.float64)
    return Pose(rotation_matrix(unit / np.linalg.norm(unit)), np.array(position, dtype=np.float64))


def find_groups(model: Any) -> tuple[list[GeomGroup], Where]:
    """Groups with parents before children; and of every body of the file its group (None: the world) and its pose.

    model: a mujoco.MjModel.
    """
    groups: list[GeomGroup] = []
    where: Where = {0: (None, HERE)}
    parts: dict[int, list[RigidInertia]] = {}
    for b in range(1, model.nbody):
        carrier, at = where[int(model.body_parentid[b])]
        pose = at.then(pose_of(model.body_pos[b], model.body_quat[b]))
        if model.body_jntnum[b] > 0:
            group = GeomGroup(name_of(model, "body", b), b, carrier, pose)
            groups.append(group)
            where[b] = (group, HERE)
            parts[id(group)] = []
        else:
            where[b] = (carrier, pose)
        owner, frame = where[b]
        if owner is not None:
            own = RigidInertia(float(model.body_mass[b]), np.zeros(3), np.diag(model.body_inertia[b]))
            parts[id(owner)].append(own.seen_from(frame.then(pose_of(model.body_ipos[b], model.body_iquat[b]))))
            owner.members[b] = frame
    for group in groups:
        group.inertia = combined(parts[id(group)])
    return groups, where


def turning_lengths(condim: int, torsional: float, rolling: float) -> tuple[float, float]:
    """Torsional and rolling friction of a contact of this dimension [m]."""
    return torsional if condim >= 4 else 0.0, rolling if condim >= 6 else 0.0


def body_shapes(model: Any, group: GeomGroup, turning: bool) -> tuple[Solid, ...]:
    """All primitives among the geoms of the group that collide; without one the largest of the others, if any.

    turning: with their torsional and rolling friction.
    """
    found: tuple[list[Solid], list[Solid]] = ([], [])
    for b, frame in group.members.items():
        start = int(model.body_geomadr[b])
        for g in range(start, start + int(model.body_geomnum[b])):
            solid = solid_of(model, g, frame, group.com)
            collides = model.geom_contype[g] | model.geom_conaffinity[g]
            if solid is not None:
                mu = 0.0 if int(model.geom_condim[g]) == 1 else float(model.geom_friction[g, 0])
                solid = replace(solid, name=name_of(model, "geom", g), friction=mu)
                if turning:
                    lengths = turning_lengths(int(model.geom_condim[g]), *map(float, model.geom_friction[g, 1:]))
                    solid = replace(solid, torsional_friction=lengths[0], rolling_friction=lengths[1])
                found[0 if collides else 1].append(solid)
    if found[0]:
        return named(found[0])
    return (max(found[1], key=lambda shape: shape.volume()),) if found[1] else ()


def solid_of(model: Any, g: int, frame: Pose, com: Floats | float) -> Solid | None:
    """A geom as a shape in its body, from the centre of mass com; None for a plane or a field."""
    at = frame.then(pose_of(model.geom_pos[g], model.geom_quat[g]))
    r, s, t = (float(x) for x in model.geom_size[g])
    center, turn = at.point - com, at.quaternion
    kind = int(model.geom_type[g])
    if kind == SPHERE:
        return Sphere(r, center=center, orientation=turn)
    if kind == CAPSULE:
        return Capsule(r, 2.0 * s, center=center, orientation=turn)
    if kind == CYLINDER:
        return Cylinder(r, 2.0 * s, center=center, orientation=turn)
    if kind == BOX:
        return Box(2.0 * r, 2.0 * s, 2.0 * t, center=center, orientation=turn)
    if kind == ELLIPSOID:
        return Ellipsoid(r, s, t, center=center, orientation=turn)
    if kind == MESH:
        return Polytope(mesh_corners(model, g)[0], center=center, orientation=turn)
    return None


def mesh_corners(model: Any, g: int) -> tuple[Floats, float]:
    """Corners (n, 3) of the reduced convex hull of a mesh in the frame of its geom, and its Hausdorff distance [m]."""
    k = int(model.geom_dataid[g])
    first = int(model.mesh_vertadr[k])
    points = np.array(model.mesh_vert[first : first + int(model.mesh_vertnum[k])], dtype=np.float64)
    return reduced_hull(points)
