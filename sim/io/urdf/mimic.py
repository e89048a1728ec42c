"""<mimic>: joints that follow another one, as gears."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping

from numpy.typing import ArrayLike

from sim.io.urdf.robot import Robot
from sim.mechanism import checks
from sim.mechanism.gear import Gear

_SAME = 1e-9  # [rad, m] of coordinates that are alike


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


def loose_leaders(robot: Robot, held: Collection[str]) -> list[str]:
    """Joints that may move although one that follows them is held."""
    leaders = (leader_of(robot, name) for name in robot.mimics if name in held)
    return [name for name in dict.fromkeys(leaders) if name in robot.joints and name not in held]


def with_leaders(
    call: str, robot: Robot, geared: Collection[str], neutral: Mapping[str, ArrayLike]
) -> dict[str, ArrayLike]:
    """Neutral coordinates by joint, with those of joints that are followed by one with a coordinate.

    Args:
        call: beginning of the message.
        robot: the robot.
        geared: joints that follow another one.
        neutral: coordinates by joint.

    Returns:
        The coordinates, and further ones.

    Raises:
        ValueError: a joint is not where the one that it follows puts it.
    """
    out = dict(neutral)
    waiting = [name for name in geared if name in out]
    while waiting:
        name = waiting.pop()
        leader, value = leader_of(robot, name), checks.number(f"{call}: joint {name!r}", out[name])
        if leader not in robot.joints:
            continue
        start = follower_value(robot, name, lambda _: 0.0)
        slope = follower_value(robot, name, lambda _: 1.0) - start
        if leader not in out and slope != 0.0:
            out[leader] = (value - start) / slope
            waiting += [leader] if leader in geared else []
        elif leader in out:
            there = start + slope * checks.number(f"{call}: joint {leader!r}", out[leader])
            if abs(there - value) > _SAME * max(1.0, abs(value)):
                raise ValueError(
                    f"{call}: joint {name!r} follows {leader!r}, which puts it at {there:g}, got {value:g}"
                )
    return out


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
