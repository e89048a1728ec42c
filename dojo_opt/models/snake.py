"""A chain of boxes that lies on the ground."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.box_chain import box_chain
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import Contact


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
    links, joints, front, rear = box_chain(
        "snake", n, joint, ((1.0, 0.0, 0.0),), mass, (length, width, height), spring, damper
    )
    contacts = [
        Contact(f"link_{i}", point, radius, friction, law, name=f"link_{i}_{end}")
        for i in range(n)
        for end, point in (("front", front), ("rear", rear))
    ]
    neutral = {"base": (0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(links, joints, contacts, gravity=gravity, name="snake", neutral=neutral)
