"""A chain of boxes whose joints have the axes x, y, z in turn."""

from __future__ import annotations

from numpy.typing import ArrayLike

from sim.mechanism import Mechanism
from sim.parts import Body, Contact, Joint
from sim.shapes import Box

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def twister(
    n: int = 5,
    *,
    joint: str = "prismatic",
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.15,
    height: float = 0.1,
    radius: float = 0.0,
    spring: float = 0.0,
    damper: float = 0.0,
    friction: float = 0.8,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """`n` boxes end to end along x, the first one free; joint i has the axis x, y or z, in turn.

        q  (7 + ...,) position of link_0 [m], its quaternion, then the coordinate of each joint [m or rad]
        u  (n - 1,) force or torque of each joint [N or N m]; as many per joint as it has degrees of freedom

    Both ends of the first box and the rear ends of the others touch the ground z = 0. joint: kind of all joints; mass
    [kg], length, width, height [m] of one box; radius of the contacts [m]; spring and damper of each joint; law: see
    Contact.
    """
    if not isinstance(n, int) or n < 1:
        raise ValueError(f"twister(n): expected a whole number >= 1, got {n!r}")
    links = [Body(f"link_{i}", mass, shape=Box(length, width, height)) for i in range(n)]
    front, rear = (length / 2, 0.0, 0.0), (-length / 2, 0.0, 0.0)
    joints = [Joint("floating", None, "link_0", name="base")]
    joints += [
        Joint(
            joint,
            f"link_{i - 1}",
            f"link_{i}",
            name=f"joint_{i}",
            parent_point=rear,
            child_point=front,
            axis=AXES[(i - 1) % 3],
            spring=spring,
            damper=damper,
        )
        for i in range(1, n)
    ]
    contacts = [Contact("link_0", front, radius, friction, law, name="link_0_front")]
    contacts += [Contact(f"link_{i}", rear, radius, friction, law, name=f"link_{i}_rear") for i in range(n)]
    neutral = {"base": (0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(links, joints, contacts, gravity=gravity, name="twister", neutral=neutral)
