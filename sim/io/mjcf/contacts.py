"""Contacts from the geoms of an MJCF file: balls and points that cannot enter its planes.

    sphere      one ball
    capsule     two balls
    box         its eight corners
    cylinder    points on both rims
    mesh        the corners of its convex hull, reduced to 32 at most
    ellipsoid   none: the point that touches moves over it; a collision with a half-space (collisions.py)

A plane counts where it is fixed to the world; a geom touches it if MuJoCo's contype and conaffinity allow it and no
<exclude> names both bodies, or if a <pair> names both geoms. Friction is the larger of both, or that of the geom with
priority, or of the <pair>; condim 1 is without, and condim 4 and 6 have torsional and rolling friction likewise. The
margins of both geoms keep their surfaces as far apart, and the contact is in the middle between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from sim.io.loader_choices import LoaderChoices
from sim.io.mjcf.flags import contacts_disabled
from sim.io.mjcf.welded_bodies import (
    BOX,
    CAPSULE,
    CYLINDER,
    MESH,
    NO_SHAPE,
    PLANE,
    SPHERE,
    GeomGroup,
    Where,
    mesh_corners,
    name_of,
    pose_of,
    turning_lengths,
)
from sim.io.urdf.report import Notes
from sim.mechanism.contact import Contact
from sim.mechanism.pose import Pose
from solvers.types import Floats

STANDING = (SPHERE, CAPSULE, BOX, CYLINDER, MESH)  # on balls and points
_UNLESS = "are no obstacles (collisions=True makes them)"


class Rubbing(NamedTuple):
    """How two geoms touch."""

    friction: float
    slippery: bool  # whether there is no friction
    margin: float  # distance of their surfaces [m]
    lengths: tuple[float, float]  # torsional and rolling friction [m]

    def turning(self, choices: LoaderChoices) -> dict[str, Any]:
        """The fields of a contact or collision for them, if they were asked for."""
        fields = ("torsional_friction", "rolling_friction")
        return dict(zip(fields, self.lengths, strict=True)) if choices.turning_friction else {}


def find_contacts(model: Any, where: Where, choices: LoaderChoices, collisions: bool, notes: Notes) -> list[Contact]:
    """The contacts of all geoms with all planes.

    collisions: whether the other fixed geoms are obstacles, by sim/io/mjcf/collisions.py.
    """
    planes, pairs = fixed_planes(model, where), listed(model)
    out: list[Contact] = []
    for g in range(model.ngeom):
        group, frame = where[int(model.geom_bodyid[g])]
        if group is None:
            solid = model.geom_type[g] != PLANE and model.geom_contype[g] | model.geom_conaffinity[g]
            if solid and not collisions:
                notes.add(f"geoms fixed to the world other than planes {_UNLESS}", [name_of(model, "geom", g)])
            continue
        rough = {p: rubbed for p in planes if (rubbed := rubbing(model, pairs, g, p))}
        if not rough:
            continue
        kind = int(model.geom_type[g])
        if kind in NO_SHAPE:
            notes.add(f"no contact from geoms of kind {NO_SHAPE[kind]}", [name_of(model, "geom", g)], warn=True)
        if kind not in STANDING:
            continue
        if kind == MESH:
            error = 1e3 * mesh_corners(model, g)[1]
            text = (
                "meshes are convex hulls of at most 32 corners, at these largest distances from the hulls of the meshes"
            )
            notes.add(text, [f"{name_of(model, 'geom', g)} ({error:.2g} mm)"])
        balls = _balls(model, g, frame, choices.rim_points)
        for p, rubbed in rough.items():
            label, plane = label_on(model, g, p, list(rough)), plane_pose(model, p)
            names = [label if len(balls) == 1 else f"{label}_{k}" for k in range(len(balls))]
            out += [
                _contact(plane, rubbed, group, ball, name, choices) for ball, name in zip(balls, names, strict=True)
            ]
    return out


def fixed_planes(model: Any, where: Where) -> list[int]:
    """The planes that are fixed to the world."""
    return [g for g in range(model.ngeom) if _owner(model, where, g) is None and model.geom_type[g] == PLANE]


def label_on(model: Any, g: int, p: int, touched: list[int]) -> str:
    """Name of the contact of a geom with a plane: that of the geom, and of the plane where it touches others."""
    return name_of(model, "geom", g) + (f"@{name_of(model, 'geom', p)}" if len(touched) > 1 else "")


def plane_pose(model: Any, p: int) -> Pose:
    """Pose of a plane, which may be on a body that is welded to the world."""
    plane = pose_of(model.geom_pos[p], model.geom_quat[p])
    body = int(model.geom_bodyid[p])
    while body:
        plane = pose_of(model.body_pos[body], model.body_quat[body]).then(plane)
        body = int(model.body_parentid[body])
    return plane


def _owner(model: Any, where: Where, g: int) -> GeomGroup | None:
    """The group of a geom, None for the world."""
    return where[int(model.geom_bodyid[g])][0]


def _meet(model: Any, a: int, b: int) -> bool:
    """Whether MuJoCo lets two geoms collide."""
    ab = model.geom_contype[a] & model.geom_conaffinity[b]
    return bool(ab | (model.geom_contype[b] & model.geom_conaffinity[a]))


def listed(model: Any) -> dict[tuple[int, int], int]:
    """The number of every <pair> by its geoms, the lower one first."""
    ends = [(int(model.pair_geom1[k]), int(model.pair_geom2[k])) for k in range(model.npair)]
    return {(min(pair), max(pair)): k for k, pair in enumerate(ends)}


def _excluded(model: Any, a: int, b: int) -> bool:
    """Whether the file excludes the bodies of two geoms."""
    first, second = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
    signature = (first << 16) + second
    return bool((model.exclude_signature == signature).any())


def rubbing(model: Any, pairs: Mapping[tuple[int, int], int], a: int, b: int) -> Rubbing | None:
    """How two geoms touch, if they may, wherever their bodies are; None of others.

    pairs: those of the file, see `listed`.
    """
    if contacts_disabled(model):
        return None
    pair = pairs.get((min(a, b), max(a, b)))
    if pair is not None:
        friction, margin = float(model.pair_friction[pair, 0]), float(model.pair_margin[pair])
        condim, rough = int(model.pair_dim[pair]), model.pair_friction[pair]
        return Rubbing(friction, condim == 1, margin, turning_lengths(condim, float(rough[2]), float(rough[3])))
    return _mixed(model, a, b) if _meet(model, a, b) and not _excluded(model, a, b) else None


def _mixed(model: Any, a: int, b: int) -> Rubbing:
    """The larger friction and dimension of two geoms, or those of the geom with priority; the sum of their margins."""
    own, other = int(model.geom_priority[a]), int(model.geom_priority[b])
    first = [x for x, wins in ((a, own >= other), (b, other >= own)) if wins]
    friction = max(float(model.geom_friction[x, 0]) for x in first)
    condim = max(int(model.geom_condim[x]) for x in first)
    lengths = turning_lengths(condim, *(max(float(model.geom_friction[x, k]) for x in first) for k in (1, 2)))
    return Rubbing(friction, condim == 1, float(model.geom_margin[a] + model.geom_margin[b]), lengths)


def _contact(
    plane: Pose, rubbed: Rubbing, group: GeomGroup, ball: tuple[Floats, float], name: str, choices: LoaderChoices
) -> Contact:
    """One ball of a geom against a plane."""
    chosen, law = choices.friction, choices.law
    normal = plane.rotation[:, 2]
    own = max(0.5 * rubbed.margin, -ball[1])  # half on either surface: the contact is in the middle between them
    return Contact(
        group.name,
        ball[0] - group.com,
        ball[1] + own,
        friction=rubbed.friction if chosen is None else chosen,
        law="impact" if rubbed.slippery else law,
        normal=normal,
        height=float(normal @ plane.point) + rubbed.margin - own,
        name=name,
        **rubbed.turning(choices),
    )


def _balls(model: Any, g: int, frame: Pose, rim: int) -> list[tuple[Floats, float]]:
    """Centres in the frame of the group, and radii."""
    at = frame.then(pose_of(model.geom_pos[g], model.geom_quat[g]))
    size = np.array(model.geom_size[g], dtype=np.float64)
    kind = int(model.geom_type[g])
    if kind == SPHERE:
        return [(at.point, float(size[0]))]
    ends = [np.array([0.0, 0.0, side * size[1]]) for side in (-1.0, 1.0)]
    if kind == CAPSULE:
        return [(at.at(end), float(size[0])) for end in ends]
    if kind == BOX:
        return [(at.at(size * signs), 0.0) for signs in product((-1, 1), repeat=3)]
    if kind == MESH:
        return [(at.at(corner), 0.0) for corner in mesh_corners(model, g)[0]]
    assert kind == CYLINDER
    angles = 2.0 * np.pi * np.arange(rim) / rim
    around = [size[0] * np.array([np.cos(a), np.sin(a), 0.0]) for a in angles]
    return [(at.at(end + offset), 0.0) for end in ends for offset in around]
