"""Boxes end to end along x, the first one free: the common part of snake and twister."""

from __future__ import annotations

from dojo_opt.models.links import LINK_BYTES
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.memory_limit import room_for
from sim.mechanism.shapes import Box

Point = tuple[float, float, float]


def box_chain(
    call: str, n: int, joint: str, axes: tuple[Point, ...], mass: float, size: Point, spring: float, damper: float
) -> tuple[list[Body], list[Joint], Point, Point]:
    """(bodies link_0, link_1, ..., joints base, joint_1, ..., front end, rear end of a box).

    joint: kind of all joints; axes: theirs, in turn; size: length, width, height [m]; spring and damper of
    each joint. ValueError: n is not a whole number of boxes; the message names `call`.
    """
    n = room_for(f"{call}(n)", n, LINK_BYTES, noun="bodies")
    links = [Body(f"link_{i}", mass, shape=Box(*size)) for i in range(n)]
    front, rear = (size[0] / 2, 0.0, 0.0), (-size[0] / 2, 0.0, 0.0)
    joints = [Joint("floating", None, "link_0", name="base")]
    joints += [
        Joint(
            joint,
            f"link_{i - 1}",
            f"link_{i}",
            name=f"joint_{i}",
            parent_point=rear,
            child_point=front,
            axis=axes[(i - 1) % len(axes)],
            spring=spring,
            damper=damper,
        )
        for i in range(1, n)
    ]
    return links, joints, front, rear
