"""Stance: the neutral coordinates of a loaded robot, and the height of its base."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sim.mechanism.collision import Collision
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.joint import WORLD
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.rising_bases import CARRIES
from sim.mechanism.shapes import HalfSpace, rotation_matrix
from solvers.types import Floats

_CLEAR = 1e-9  # [m] above the ground: a gap of zero, or below by rounding, has no interior to start the solver in
_SUNK = 1e-3  # [m] how deep a contact may start in the ground without a warning


def resting(limits: tuple[float, float] | None) -> float:
    """Coordinate of a joint in the neutral state: zero, or the middle of its range when zero is outside of it."""
    if limits is None or limits[0] <= 0.0 <= limits[1]:
        return 0.0
    return 0.5 * (limits[0] + limits[1])


def gaps(mech: Mechanism, q: Floats) -> Floats:
    """(ncontact,) distance of every contact from its ground [m]."""
    if not mech.contacts:
        return np.zeros(0)
    at = body_poses(mech.joints, q)
    return np.array([float(c.gap(at[c.body].at(c.point))) for c in mech.contacts], dtype=np.float64)


def collisions_with_ground(mech: Mechanism) -> Iterator[tuple[Collision, HalfSpace]]:
    """Collisions of bodies with half-spaces of the world, and these."""
    return ((c, c.shape_b) for c in mech.collisions if c.b == WORLD and isinstance(c.shape_b, HalfSpace))


def plane_heights(mech: Mechanism, q: Floats) -> list[tuple[float, float]]:
    """(distance [m], upward part of the normal) of every shape of a body from a half-space of the world."""
    on_planes = list(collisions_with_ground(mech))
    if not on_planes:
        return []
    at = body_poses(mech.joints, q)
    shapes = {body.name: body.shapes for body in mech.bodies}
    out = []
    for c, plane in on_planes:
        solid = c.shape_a if c.shape_a is not None else shapes[c.a][0]  # the only one, see collision.py
        n = rotation_matrix(plane.orientation)[:, 2]
        own = (at[c.a].rotation @ rotation_matrix(solid.orientation)).T @ -n
        arm = at[c.a].at(np.asarray(solid.center)) - np.asarray(plane.center)
        out.append((float(n @ arm) - solid.support(own), float(n[2])))
    return out


def lifted(mech: Mechanism, base: str, *, down: bool = True) -> Floats:
    """Neutral q with the joint `base`, floating in the world, so high that the lowest contact touches its ground, or
    the lowest shape a half-space.

    Walls and ceilings neither raise it nor let it down, see `penetrations`.

    Args:
        mech: the mechanism.
        base: name of the joint.
        down: whether a base that is above its ground is set down on it.

    Returns:
        (nq,) coordinates.
    """
    q = np.array(mech.neutral, dtype=np.float64)
    joint = mech.joints[mech.joint_names.index(base)]
    low = [*zip(gaps(mech, q), mech.contact_normals[:, 2], strict=True), *plane_heights(mech, q)]
    heights = [gap / rise for gap, rise in low if rise >= CARRIES]
    if heights and (down or min(heights) < 0.0):
        up = _CLEAR - min(heights)
        at = mech.q_slice(base).start
        q[at : at + 3] += up * rotation_matrix(joint.orientation)[2]
    return q


def penetrations(mech: Mechanism) -> list[str]:
    """Contacts, and collisions with half-spaces of the world, that start inside of the ground, with their depths."""
    q = np.asarray(mech.neutral, dtype=np.float64)
    distances = [*gaps(mech, q), *(gap for gap, _ in plane_heights(mech, q))]
    names = [*(c.name for c in mech.contacts), *(c.name for c, _ in collisions_with_ground(mech))]
    return [f"{name} ({-gap:.3g} m)" for name, gap in zip(names, distances, strict=True) if gap < -_SUNK]
