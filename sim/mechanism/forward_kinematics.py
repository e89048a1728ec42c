"""Forward kinematics of a tree of joints, for checks before there is a Model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.mechanism.axes import translation_axes
from sim.mechanism.joint import Joint
from sim.mechanism.pose import HERE, Pose, turn
from sim.mechanism.shapes import rotation_matrix
from solvers.types import Floats


def body_poses(joints: Sequence[Joint], q: Floats) -> dict[str, Pose]:
    """Pose of every body, at its centre of mass, at the coordinates q (nq,) of the joints, parents first."""
    out: dict[str, Pose] = {}
    first = 0
    for joint in joints:
        parent = out.get(joint.parent or "", HERE)
        frame = parent.then(Pose(rotation_matrix(joint.orientation), np.asarray(joint.parent_point)))
        moved = frame.then(_motion(joint, q[first : first + joint.nq]))
        out[joint.child] = Pose(moved.rotation, moved.at(-np.asarray(joint.child_point)))
        first += joint.nq
    return out


def _motion(joint: Joint, q: Floats) -> Pose:
    """Pose of the child's joint point in the joint frame."""
    shift = q[: joint.ntrans] @ translation_axes(joint.ntrans, joint.axis)[: joint.ntrans]
    if joint.nrot == 2:
        t = q[-2:] @ translation_axes(2, joint.axis)[:2]
        angle = float(np.linalg.norm(t))
        return Pose(turn(t / angle, angle) if angle > 0.0 else np.eye(3), shift)
    if joint.nrot == 1:
        return Pose(turn(joint.axis, float(q[-1])), shift + joint.lead * float(q[-1]) * np.asarray(joint.axis))
    return Pose(rotation_matrix(q[-4:]) if joint.nrot == 3 else np.eye(3), shift)
