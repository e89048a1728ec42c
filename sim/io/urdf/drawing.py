"""The one shape of a body: the largest of its links, for obstacles and collisions that are added, and for pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.io.urdf.report import Notes
from sim.io.urdf.robot import Geometry
from sim.io.urdf.tree import MergedLinks
from sim.mechanism.pose import Pose
from sim.mechanism.shapes import Box, Capsule, Cylinder, Shape, Sphere

Floats = NDArray[np.float64]
Named = tuple[str, Shape]  # the link or geom, for a note, and its shape in the body


def drawn(body: MergedLinks, com: Floats, notes: Notes) -> Shape | None:
    """The largest primitive among the collision shapes of a body, or else among its visual shapes; None without any."""
    return largest(_solids(body, com, "collisions"), notes) or largest(_solids(body, com, "visuals"))


def largest(found: Sequence[Named], notes: Notes | None = None) -> Shape | None:
    """The shape with the largest volume; the others are left out, with a note that names them."""
    if not found:
        return None
    kept = max((shape for _, shape in found), key=lambda shape: shape.volume())
    others = [f"{name} ({type(shape).__name__.lower()})" for name, shape in found if shape != kept]
    if notes is not None and others:
        notes.add(
            "a body keeps one collision shape, its largest, for obstacles and collisions that are added to the "
            "mechanism; left out of those",
            others,
            warn=True,
        )
    return kept


def _solids(body: MergedLinks, com: Floats, field: str) -> list[Named]:
    """The primitives among the collision or visual shapes of a body."""
    found = [(link.name, s, pose.then(s.pose)) for link, pose in body.links for s in getattr(link, field)]
    return [(name, solid) for name, s, pose in found if (solid := _solid(s, pose, com)) is not None]


def _solid(shape: Geometry, pose: Pose, com: Floats) -> Shape | None:
    """The shape in the body, from its centre of mass; None for a mesh or something without extent."""
    if not shape.sizes or min(shape.sizes) <= 0.0:
        return None
    center, turn = tuple(pose.point - com), pose.quaternion
    if shape.kind == "sphere":
        return Sphere(*shape.sizes, center=center, orientation=turn)
    if shape.kind == "box":
        return Box(*shape.sizes, center=center, orientation=turn)
    kind = Cylinder if shape.kind == "cylinder" else Capsule
    return kind(*shape.sizes, center=center, orientation=turn)
