"""Bounding spheres: which pairs are too far apart to be worth a closer look."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf

from sim.model.shape_kinds import Shape


def bounding_radius(shape: Shape, sizes: Sequence[float]) -> float:
    """Radius [m] of the sphere about the centre of a shape that contains it; infinite for a half-space.

    sizes: of this shape, in the order of kinds.Shape [m]. The ends of a string are points: the string is never far.
    """
    if shape == Shape.SPHERE:
        return float(sizes[0])
    if shape == Shape.CAPSULE:
        return float(sizes[0] + sizes[1])
    if shape == Shape.BOX:
        return hypot(*sizes[:3])
    if shape == Shape.CYLINDER:
        return hypot(*sizes[:2])
    return inf
