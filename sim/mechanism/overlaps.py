"""Overlaps: the collisions of a mechanism whose shapes are in one another."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism.forward_kinematics import HERE, body_poses
from sim.mechanism.joint import WORLD
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.self_collisions import separation
from sim.mechanism.shapes import HalfSpace, Solid, String
from sim.mechanism.stance import plane_heights

__all__ = ["overlaps"]


def overlaps(mech: Mechanism, q: ArrayLike) -> tuple[str, ...]:
    """Collisions whose shapes overlap, or are within a hundred thousandth of their size from one another.

    Hard contact parts such shapes in its first step, at a speed of their overlap over the time step.

    Args:
        mech: the mechanism.
        q: (nq,) coordinates.

    Returns:
        Names of the collisions.

    Raises:
        NotImplementedError: a shape has no outline, or is a half-space that moves.
    """
    at = {WORLD: HERE, **body_poses(mech.joints, np.asarray(q, dtype=np.float64))}
    shapes = {body.name: body.shapes for body in mech.bodies}

    def side(body: str, shape: Solid | None) -> Solid:
        return shapes[body][0] if shape is None else shape

    found = []
    planes = iter(plane_heights(mech, np.asarray(q)))
    for c in mech.collisions:
        a, b = side(c.a, c.shape_a), side(str(c.b), c.shape_b)
        if isinstance(b, HalfSpace) and c.b == WORLD:
            gap = next(planes)[0]
        elif isinstance(a, String):
            gap = a.length - float(
                np.linalg.norm(at[c.a].at(np.asarray(a.center)) - at[str(c.b)].at(np.asarray(b.center)))
            )
        else:
            gap = separation(at[c.a], a, at[str(c.b)], b)
        if gap < 0.0:
            found.append(c.name)
    return tuple(found)
