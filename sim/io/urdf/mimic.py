"""<mimic>: joints that follow another one, as gears."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping

from sim.io.urdf.robot import Robot
from sim.mechanism.gear import Gear


def can_follow(robot: Robot, name: str, held: Collection[str]) -> bool:
    """Whether a joint and the one that it follows have one coordinate each."""
    leader = leader_of(robot, name)
    single = ("revolute", "prismatic")
    known = leader in robot.joints and leader != name and leader not in held
    return known and robot.joints[name].kind in single and robot.joints[leader].kind in single


def leader_of(robot: Robot, name: str) -> str:
    """Name of the joint that a joint follows."""
    return robot.joints[name].element.need("mimic").attributes.get("joint", "").strip()


def follower_value(robot: Robot, name: str, leader_value: Callable[[str], float]) -> float:
    """Coordinate of a joint that follows another one, at the coordinate of that."""
    mimic = robot.joints[name].element.need("mimic")
    return mimic.number("multiplier", 1.0) * leader_value(mimic.text("joint")) + mimic.number("offset", 0.0)


def mimic_gears(robot: Robot, names: Iterable[str], moving: Mapping[str, int]) -> list[Gear]:
    """The gears of these joints.

    moving: degrees of freedom of the joints of the mechanism, among which held ones are not.
    """
    out = []
    for name in names:
        mimic = robot.joints[name].element.need("mimic")
        leader = mimic.text("joint")
        for joint in (name, leader):
            if joint not in robot.joints:
                raise mimic.error(f"{joint!r} is not a joint of the file")
            if moving.get(joint, 0) != 1:
                raise mimic.error(
                    f"joint {joint!r} has no coordinate of its own; use mimic='locked', or hold both joints"
                )
        if leader == name:
            raise mimic.error(f"joint {name!r} follows itself")
        out.append(Gear(name, leader, mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)))
    return out
