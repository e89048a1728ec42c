"""<loop_joint>: joints that close loops, which URDF has no word for; read as Dojo and Isaac Sim write them.

    <loop_joint name="pin" type="revolute">
      <link1 link="coupler" xyz="0.5 0 0" rpy="0 0 0"/>      the joint frame in the parent
      <link2 link="rocker"  xyz="0.4 0 0" rpy="0 0 0"/>      and in the child
      <axis xyz="0 1 0"/>                                    in the joint frame
      <dynamics damping="0.1" friction="0.2"/> <limit lower="-1" upper="1"/>
    </loop_joint>

Every type of a <joint> (sim/io/urdf/robot.py) can close a loop; a floating one needs damping, as of a bushing.

At coordinate zero the two frames coincide. Without an rpy in <link2>, they have the same axes where all joints of the
tree are at zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sim.io.urdf.report import Notes
from sim.io.urdf.robot import Robot, UrdfJoint, read_joint
from sim.io.urdf.tree import Place
from sim.io.urdf.xml import Element
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.pose import HERE, Pose, quaternion, roll_pitch_yaw
from solvers.types import Floats


@dataclass(frozen=True)
class UrdfLoop:
    """A joint that closes a loop."""

    joint: UrdfJoint  # its pose is that of the joint frame in the parent
    frame: Pose  # of the joint frame in the child
    turned: bool  # whether the file gives the rotation of that


def read_loop(element: Element, notes: Notes) -> UrdfLoop:
    """A <loop_joint>, every number checked."""
    zero = (0.0, 0.0, 0.0)
    ends = (element.need("link1"), element.need("link2"))
    poses = [Pose(roll_pitch_yaw(e.vector("rpy", 3, zero)), e.vector("xyz", 3, zero)) for e in ends]
    joint = read_joint(element, ("link1", "link2"), poses[0], notes)
    if joint.parent == joint.child:
        raise element.error(f"expected two different links, got {joint.parent!r} twice")
    if joint.kind == "floating" and not joint.damping:
        raise element.error("a floating joint without damping constrains nothing")
    return UrdfLoop(joint, poses[1], "rpy" in ends[1].attributes)


def read_loops(root: Element, robot: Robot, notes: Notes) -> dict[str, UrdfLoop]:
    """The <loop_joint>s by name; unknown links and duplicate names are refused."""
    out: dict[str, UrdfLoop] = {}
    for element in root.all("loop_joint"):
        loop = read_loop(element, notes)
        name = loop.joint.name
        for tag, link in (("link1", loop.joint.parent), ("link2", loop.joint.child)):
            if link not in robot.links:
                raise element.need(tag).error(f"{link!r} is not a link of the file")
        for other in (robot.joints.get(name), out[name].joint if name in out else None):
            if other is not None:
                raise element.error(f"the name is taken by the <{other.element.tag}> of line {other.element.line}")
        out[name] = loop
    return out


def zero_poses(root: str, order: Sequence[UrdfJoint]) -> dict[str, Pose]:
    """Pose of every link in the root where all joints are at zero."""
    out = {root: HERE}
    for joint in order:
        out[joint.child] = out[joint.parent].then(joint.pose)
    return out


def closing_joint(
    loop: UrdfLoop,
    places: Mapping[str, Place],
    coms: Mapping[str, Floats],
    zero: Mapping[str, Pose],
    position: ArrayLike,
    notes: Notes,
) -> Joint | None:
    """The Joint of a loop; None, with a note, where both links are part of one body."""
    joint, element = loop.joint, loop.joint.element
    at, to = places[joint.parent], places[joint.child]
    if at.group is to.group:
        notes.add("loop joints inside of one body, which hold by themselves", [joint.name])
        return None
    if to.group.name not in coms:
        raise element.error(f"{joint.child!r} is part of the world; exchange link1 and link2")
    frame, other = at.pose.then(joint.pose), to.pose.then(loop.frame)
    if not loop.turned:
        seen = zero[joint.child].rotation.T @ zero[joint.parent].rotation @ joint.pose.rotation
        other = Pose(to.pose.rotation @ seen, other.point)
    if at.group.name in coms:
        parent, point = at.group.name, frame.point - coms[at.group.name]
    else:
        parent, point = WORLD, frame.point + np.asarray(position)
    return Joint(
        joint.kind,
        parent,
        to.group.name,
        joint.name,
        parent_point=point,
        child_point=other.point - coms[to.group.name],
        axis=other.rotation @ joint.axis,  # a Joint has its frame along the axes of the child
        orientation=quaternion(frame.rotation @ other.rotation.T),
        damper=joint.damping,
        limits=joint.limits,
        close=True,
    )
