"""<mimic>: joints that follow another one, as gears."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from sim.io.urdf.robot import Robot
from sim.mechanism.gear import Gear


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
