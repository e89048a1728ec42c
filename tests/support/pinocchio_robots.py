"""Mechanisms as models of Pinocchio, with the velocities of ours: linear ones of a base in world axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import dojo_opt as dojo

Floats = NDArray[np.float64]


def pinocchio_robot(mech: dojo.Mechanism) -> tuple[Any, dict[str, int]]:
    """The tree of joints as a model, and the number of the joint of each body; joints float, turn, or are screws."""
    import pinocchio as pin

    robot, ids = pin.Model(), {"world": 0}
    robot.gravity.linear = np.array(mech.gravity)
    for joint in mech.joints:
        body = mech.bodies[mech.body_names.index(joint.child)]
        parent = next((j for j in mech.joints if j.child == joint.parent), None)
        point = np.asarray(joint.parent_point) - (np.asarray(parent.child_point) if parent else 0.0)
        place = pin.SE3(pin.Quaternion(*joint.orientation).toRotationMatrix(), point)
        if joint.kind == "floating":
            kind = pin.JointModelComposite(pin.JointModelTranslation())
            kind.addJoint(pin.JointModelSpherical())
        elif joint.kind == "screw":
            kind = pin.JointModelHelicalUnaligned(np.array(joint.axis), joint.lead)
        else:
            kind = pin.JointModelRevoluteUnaligned(np.array(joint.axis))
        ids[body.name] = robot.addJoint(ids[joint.parent or "world"], kind, place, joint.name)
        inertia = pin.Inertia(body.mass, -np.asarray(joint.child_point), np.array(body.inertia))
        robot.appendBodyToJoint(ids[body.name], inertia, pin.SE3.Identity())
    return robot, ids


def pinocchio_coordinates(mech: dojo.Mechanism, q: Floats) -> Floats:
    """Coordinates (nq,) with the scalar of the base's quaternion last."""
    out = np.array(q)
    if mech.joints[0].kind == "floating":
        out[3:7] = np.roll(q[3:7], -1)
    return out
