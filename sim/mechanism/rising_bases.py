"""Bases that can rise: of robots that float, that are planar, and on vertical slides."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sim.mechanism.axes import upward_rates
from sim.mechanism.body import Body
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.joint_coordinates import coordinate_limits, joint_places
from sim.mechanism.pose import HERE, Pose
from solvers.types import Floats, Integers

__all__ = ["CARRIES", "rising_bases"]

CARRIES = 0.25  # upward part of the normal of ground that a base stands on; steeper ground is a wall


def rising_bases(joints: Sequence[Joint], bodies: Sequence[Body], q: Floats) -> Iterator[tuple[str, Integers, Floats]]:
    """Bases that can move straight up at the coordinates q (nq,), without limits of their height.

    Args:
        joints: joints of a mechanism, parents first.
        bodies: its bodies; a base may hang on others without mass.
        q: (nq,) coordinates.

    Yields:
        Name of the body, places (n,) in q of the coordinates that move it, and their rates per metre (n,).
    """
    at: dict[str, Pose] = {}  # only for bases on others, as poses take a millisecond
    frames = {WORLD}  # the world, and bodies without mass between it and a base
    light = {body.name for body in bodies if body.mass == 0.0}
    limits = coordinate_limits(joints)
    for joint, place, _ in joint_places(joints):
        if joint.parent not in frames:
            continue
        if joint.parent != WORLD:
            at = at or body_poses(joints, q)
        climb = upward_rates(joint, at.get(joint.parent, HERE).rotation)
        moving = place.start + np.flatnonzero(climb)
        if not len(moving) or np.isfinite([bound[moving] for bound in limits]).any():
            frames |= light & {joint.child}
        else:
            yield joint.child, moving, climb[climb != 0.0]
