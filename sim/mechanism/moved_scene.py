"""A scene that is moved as a whole: joints with the world, obstacles, pictures, and coordinates of what floats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sim.mechanism.collision import Collision
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.joint_coordinates import joint_places
from sim.mechanism.pose import quat_product
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.visual import Visual
from solvers.types import Floats

__all__ = ["floats", "moved_coordinates", "moved_joint", "moved_obstacle", "moved_visual", "turned_velocities"]


def floats(joint: Joint) -> bool:
    """Whether a joint lets its body move freely in the world."""
    return joint.parent == WORLD and joint.kind == "floating" and not joint.close


def moved_joint(joint: Joint, point: Floats, quat: Floats) -> Joint:
    """A joint with the world, moved; of one that floats, the coordinates are moved instead."""
    if joint.parent != WORLD or floats(joint):
        return joint
    place = point + rotation_matrix(quat) @ np.asarray(joint.parent_point)
    return replace(joint, parent_point=place, orientation=quat_product(quat, joint.orientation))


def moved_obstacle(collision: Collision, point: Floats, quat: Floats) -> Collision:
    """An obstacle of the world, moved."""
    shape = collision.shape_b
    if collision.b != WORLD or shape is None:
        return collision
    center = point + rotation_matrix(quat) @ np.asarray(shape.center)
    return replace(collision, shape_b=replace(shape, center=center, orientation=quat_product(quat, shape.orientation)))


def moved_visual(visual: Visual, point: Floats, quat: Floats) -> Visual:
    """A picture of the world, moved."""
    part: Any = visual if visual.shape is None else visual.shape
    center = point + rotation_matrix(quat) @ np.asarray(part.center)
    moved = replace(part, center=center, orientation=quat_product(quat, part.orientation))
    return moved if visual.shape is None else replace(visual, shape=moved)


def moved_coordinates(joints: Sequence[Joint], q: Floats, point: Floats, quat: Floats) -> Floats:
    """q (nq,) with what floats moved: q' = F^-1 T F q, F the frame of the joint."""
    out = np.array(q, dtype=np.float64)
    for joint, at, _ in joint_places(joints):
        if floats(joint):
            frame, origin = np.asarray(joint.orientation), np.asarray(joint.parent_point)
            back = frame * (1.0, -1.0, -1.0, -1.0)
            place = rotation_matrix(quat) @ (origin + rotation_matrix(frame) @ out[at][:3]) + point
            out[at.start : at.start + 3] = rotation_matrix(back) @ (place - origin)
            out[at.start + 3 : at.stop] = quat_product(back, quat_product(quat, quat_product(frame, out[at][3:])))
    return out


def turned_velocities(joints: Sequence[Joint], v: Floats, quat: Floats) -> Floats:
    """v (nv,) with what floats turned: v' = F^-1 T F v; angular velocities are those along axes of the body."""
    out = np.array(v, dtype=np.float64)
    for joint, _, at in joint_places(joints):
        if floats(joint):
            frame = rotation_matrix(joint.orientation)
            out[at.start : at.start + 3] = frame.T @ rotation_matrix(quat) @ frame @ out[at][:3]
    return out
