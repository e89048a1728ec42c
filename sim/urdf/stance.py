"""Stance: the neutral coordinates of a loaded robot, and how high it stands with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.build import translation_axes
from sim.mechanism import Mechanism
from sim.parts import Joint
from sim.shapes import rotation_matrix
from sim.urdf.pose import HERE, Pose, turn

Floats = NDArray[np.float64]

_CLEAR = 1e-9  # [m] above the ground: what is closed exactly, or by rounding deeper, has no inside to start a solver in


def resting(limits: tuple[float, float] | None) -> float:
    """Coordinate of a joint in the neutral state: zero, or the middle of its range when zero is outside of it."""
    if limits is None or limits[0] <= 0.0 <= limits[1]:
        return 0.0
    return 0.5 * (limits[0] + limits[1])


def poses(mech: Mechanism, q: Floats) -> dict[str, Pose]:
    """Pose of every body, at its centre of mass, at the coordinates q (nq,)."""
    out: dict[str, Pose] = {}
    for joint in mech.joints:
        parent = out.get(joint.parent or "", HERE)
        frame = parent.then(Pose(rotation_matrix(joint.orientation), np.asarray(joint.parent_point)))
        moved = frame.then(_motion(joint, q[mech.q_slice(joint.name)]))
        out[joint.child] = Pose(moved.rotation, moved.at(-np.asarray(joint.child_point)))
    return out


def _motion(joint: Joint, q: Floats) -> Pose:
    """Pose of the child's joint point in the joint frame."""
    shift = q[: joint.ntrans] @ translation_axes(joint.ntrans, joint.axis)[: joint.ntrans]
    if joint.nrot == 2:
        t = q[-2:] @ translation_axes(2, joint.axis)[:2]
        angle = float(np.linalg.norm(t))
        return Pose(turn(t / angle, angle) if angle > 0.0 else np.eye(3), shift)
    if joint.nrot == 1:
        return Pose(turn(joint.axis, float(q[-1])), shift)
    return Pose(rotation_matrix(q[-4:]) if joint.nrot == 3 else np.eye(3), shift)


def gaps(mech: Mechanism, q: Floats) -> Floats:
    """(ncontact,) distance of every contact from its ground [m]."""
    at = poses(mech, q)
    return np.array([float(c.gap(at[c.body].at(c.point))) for c in mech.contacts], dtype=np.float64)


def lifted(mech: Mechanism, base: str) -> Floats:
    """Neutral q with the joint `base`, floating in the world, so high that the lowest contact touches its ground."""
    q = np.array(mech.neutral, dtype=np.float64)
    joint = mech.joints[mech.joint_names.index(base)]
    rise = mech.contact_normals[:, 2]
    if np.any(rise > 0.0):
        up = _CLEAR - (gaps(mech, q)[rise > 0.0] / rise[rise > 0.0]).min()
        at = mech.q_slice(base).start
        q[at : at + 3] += up * rotation_matrix(joint.orientation)[2]
    return q
