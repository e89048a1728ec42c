"""A chain of boxes that lies on the ground."""

from __future__ import annotations

from numpy.typing import ArrayLike

from sim.mechanism import Mechanism
from sim.parts import Body, Contact, Joint
from sim.shapes import Box


def snake(
    n: int = 2,
    *,
    joint: str = "spherical",
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
    """`n` boxes end to end along x, the first one free; each touches the ground z = 0 with both ends of its axis.

        q  (7 + ...,) position of link_0 [m], its quaternion, then the coordinates of each joint; spherical: quaternions
        u  (3 (n - 1),) torques of the joints in the child's axes [N m]; of another kind, one per degree of freedom

    joint: kind of all joints, about or along x; mass [kg], length, width, height [m] of one box; radius of the contacts
    [m]; spring and damper of each joint; law: see Contact.
    """
    if not isinstance(n, int) or n < 1:
        raise ValueError(f"snake(n): expected a whole number >= 1, got {n!r}")
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
            axis=(1.0, 0.0, 0.0),
            spring=spring,
            damper=damper,
        )
        for i in range(1, n)
    ]
    contacts = [
        Contact(f"link_{i}", point, radius, friction, law, name=f"link_{i}_{end}")
        for i in range(n)
        for end, point in (("front", front), ("rear", rear))
    ]
    neutral = {"base": (0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(links, joints, contacts, gravity=gravity, name="snake", neutral=neutral)
