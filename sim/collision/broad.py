"""Bounding spheres: which pairs are too far apart to be worth a look."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf

from sim.collision.kinds import Shape
from sim.model import Vector
from solvers.jit import kernel


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


@kernel
def far(r: Vector, radius_a: float, radius_b: float, margin: float) -> bool:
    """Whether two bounding spheres are more than `margin` apart: |r| > radius_a + radius_b + margin.

    r: (3,) from the centre of b to that of a [m]. False when a radius is infinite (half-space, string).
    """
    reach = radius_a + radius_b + margin
    return r[0] * r[0] + r[1] * r[1] + r[2] * r[2] > reach * reach
