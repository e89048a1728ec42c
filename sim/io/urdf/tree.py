"""Tree: links in order from the root, and grouped into the bodies that move as one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sim.io.urdf.inertia import RigidInertia
from sim.io.urdf.robot import Robot, UrdfJoint, UrdfLink
from sim.io.urdf.xml import UrdfError
from sim.mechanism import checks
from sim.mechanism.joint import WORLD
from sim.mechanism.pose import HERE, Pose, turn


@dataclass
class MergedLinks:
    """Links that move as one body; its frame is that of its first link, whose name it has."""

    joint: UrdfJoint | None  # to its parent; None for the root
    parent: MergedLinks | None
    links: list[tuple[UrdfLink, Pose]] = field(default_factory=list)
    fixed: bool = False  # whether its joint is treated as a fixed one
    empty: bool = True  # whether all its links are without mass and inertia

    @property
    def name(self) -> str:
        """Name of the first link."""
        return self.links[0][0].name

    @property
    def inertias(self) -> list[RigidInertia]:
        """Inertias of the links, in the frame of the group."""
        return [RigidInertia(u.mass, u.com, u.inertia).seen_from(pose) for u, pose in self.links]

    def add(self, link: UrdfLink, pose: Pose) -> None:
        """One more link."""
        self.links.append((link, pose))
        self.empty &= link.empty


@dataclass(frozen=True)
class Place:
    """Where a link is: its group, and its pose there."""

    link: UrdfLink
    group: MergedLinks
    pose: Pose


def ordered(robot: Robot, file: str) -> tuple[str, list[UrdfJoint]]:
    """The root link, and the joints with parents before children, otherwise in the order of the file."""
    above: dict[str, UrdfJoint] = {}
    for joint in robot.joints.values():
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in robot.links:
                raise joint.element.need(role).error(
                    f"joint {joint.name!r} has a {role} {link!r}, which is not a link of the file"
                    f"{checks.nearest(link, robot.links)}"
                )
        if joint.child in above:
            other = above[joint.child]
            raise joint.element.error(
                f"link {joint.child!r} is the child of joint {other.name!r} of line {other.element.line} already; "
                "a joint that closes a loop is a <loop_joint>"
            )
        above[joint.child] = joint
    roots = [name for name in robot.links if name not in above]
    if not roots:
        names = ", ".join(repr(name) for name in robot.joints)
        raise UrdfError(f"load_urdf: {file}: every link is the child of a joint, so the joints form a cycle: {names}")
    if len(roots) > 1:
        raise robot.links[roots[1]].element.error(
            f"expected one root, but {len(roots)} links have no parent joint: {', '.join(roots)}"
        )
    below: dict[str, list[UrdfJoint]] = {}
    for joint in robot.joints.values():
        below.setdefault(joint.parent, []).append(joint)
    order: list[UrdfJoint] = []
    waiting = below.get(roots[0], [])[::-1]
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        waiting += below.get(joint.child, [])[::-1]
    if len(order) < len(robot.joints):
        placed = {joint.name for joint in order}
        lost = next(joint for joint in robot.joints.values() if joint.name not in placed)
        raise lost.element.error(f"joint {lost.name!r} is part of a cycle that does not hang on the root {roots[0]!r}")
    return roots[0], order


def held_pose(joint: UrdfJoint, locked: Mapping[str, float]) -> Pose | None:
    """Pose of the child in the parent when the joint cannot move; None when it can."""
    if joint.kind == "fixed":
        return joint.pose
    if joint.name not in locked:
        return None
    value = locked[joint.name]
    if joint.kind == "revolute":
        return joint.pose.then(Pose(turn(joint.axis, value), np.zeros(3)))
    if joint.kind == "prismatic":
        return joint.pose.then(Pose(np.eye(3), value * joint.axis))
    return joint.pose


def group(
    robot: Robot, root: str, order: list[UrdfJoint], fixed_base: bool, merge: bool, locked: Mapping[str, float]
) -> tuple[list[MergedLinks], dict[str, Place]]:
    """(the bodies in tree order, where every link is); the world is a group, but not among the bodies.

    A link that cannot move relative to its parent joins its body: always when one of the two has no mass, for a body
    must have one, otherwise when `merge`. The root is part of the world when it is fixed there and `merge`, or when its
    name is that of the world.
    """
    world = MergedLinks(None, None)
    base = robot.links[root]
    joins_world = root == WORLD or (fixed_base and (merge or base.mass == 0.0))
    first = world if joins_world else MergedLinks(None, world, fixed=fixed_base)
    first.add(base, HERE)
    bodies = [] if joins_world else [first]
    places = {root: Place(base, first, HERE)}
    for joint in order:
        at, link = places[joint.parent], robot.links[joint.child]
        held = held_pose(joint, locked)
        if held is not None and (merge or link.empty or (at.group.empty and at.group is not world)):
            places[joint.child] = Place(link, at.group, at.pose.then(held))
            at.group.add(link, places[joint.child].pose)
        else:
            body = MergedLinks(joint, at.group, fixed=held is not None)
            body.add(link, HERE)
            bodies.append(body)
            places[joint.child] = Place(link, body, HERE)
    return bodies, places
