"""The shapes of a body: all of its links that collide, for obstacles, other bodies and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from sim.io.urdf.robot import Geometry, UrdfLink
from sim.io.urdf.tree import MergedLinks
from sim.mechanism.polytope import Polytope
from sim.mechanism.pose import Pose
from sim.mechanism.shapes import SURFACE_FIELDS, Box, Capsule, Cylinder, Solid, Sphere
from sim.mechanism.visual import Visual
from solvers.types import Floats


def body_shapes(body: MergedLinks, com: Floats) -> tuple[Solid, ...]:
    """All primitives among the collision shapes of a body; without one the largest of its visual shapes, if any.

    Each has the friction, of all kinds, and restitution of its link, where the file gives them.
    """
    found = collision_shapes(body, com)
    if found:
        return found
    seen = _solids(body, com, "visuals")
    if not seen:
        return ()
    largest = max(seen, key=lambda shape: shape.volume())
    return (replace(largest, name="") if largest.name else largest,)


def collision_shapes(body: MergedLinks, com: Floats) -> tuple[Solid, ...]:
    """All primitives among the collision shapes of a body, and the hulls of its meshes."""
    return named(_solids(body, com, "collisions"))


def body_visuals(body: MergedLinks, com: Floats) -> tuple[Visual, ...]:
    """The picture of a body: the visual shapes and meshes of its links with their colours."""
    out = []
    for link, pose in body.links:
        for shape in link.visuals:
            at = pose.then(shape.pose)
            if shape.kind == "mesh":
                if shape.file:
                    place = at.point - com
                    out.append(
                        Visual(
                            None,
                            mesh=shape.file,
                            triangles=None,
                            scale=shape.scale,
                            center=place,
                            orientation=at.quaternion,
                            color=shape.color,
                        )
                    )
            elif (solid := solid_of(shape, at, com, "")) is not None:
                out.append(Visual(solid, color=shape.color))
    return tuple(out)


def named(found: Sequence[Solid]) -> tuple[Solid, ...]:
    """The shapes without those that are given twice, with different names."""
    out: list[Solid] = []
    taken: set[str] = set()
    for shape in dict.fromkeys(found):
        label, k = shape.name, 0
        while label and label in taken:
            k += 1
            label = f"{shape.name}_{k}"
        taken.add(label)
        out.append(shape if label == shape.name else replace(shape, name=label))
    return tuple(out)


def _solids(body: MergedLinks, com: Floats, field: str) -> list[Solid]:
    """The primitives among the collision or visual shapes of a body."""
    found = [(link, s, pose.then(s.pose)) for link, pose in body.links for s in getattr(link, field)]
    solids = [solid_of(s, pose, com, link.name, link) for link, s, pose in found]
    return [solid for solid in solids if solid is not None]


def solid_of(shape: Geometry, pose: Pose, com: Floats, name: str, link: UrdfLink | None = None) -> Solid | None:
    """The shape in the body, from its centre of mass; None for a mesh that is not read or something without extent."""
    settings: dict[str, Any] = {"center": tuple(pose.point - com), "orientation": pose.quaternion, "name": name}
    if link is not None:
        settings |= {field: getattr(link, field) for field in SURFACE_FIELDS}
    if shape.points is not None:
        return Polytope(shape.points, **settings)
    if not shape.sizes or min(shape.sizes) <= 0.0:
        return None
    kinds: dict[str, type[Sphere | Box | Capsule]] = {"sphere": Sphere, "box": Box, "capsule": Capsule}
    return kinds[shape.kind](*shape.sizes, **settings) if shape.kind in kinds else Cylinder(*shape.sizes, **settings)
