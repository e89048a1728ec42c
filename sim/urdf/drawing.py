"""The one shape that a body is drawn with: the largest of its links."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.shapes import Box, Capsule, Cylinder, Shape, Sphere
from sim.urdf.pose import Pose
from sim.urdf.robot import Geometry
from sim.urdf.tree import Group

Floats = NDArray[np.float64]


def drawn(body: Group, com: Floats) -> Shape | None:
    """The largest primitive among the visual shapes of a body, or else among its collision shapes; None without any."""
    for shapes in ("visuals", "collisions"):
        found = [(s, pose.then(s.pose)) for link, pose in body.links for s in getattr(link, shapes)]
        solids = [solid for shape, pose in found if (solid := _solid(shape, pose, com)) is not None]
        if solids:
            return max(solids, key=_volume)
    return None


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


def _volume(shape: Shape) -> float:
    """About that of the shape [m^3]: enough to find the largest."""
    if isinstance(shape, Sphere):
        return 4.2 * shape.radius**3
    if isinstance(shape, Box):
        return shape.x * shape.y * shape.z
    return 3.1 * shape.radius**2 * shape.length
