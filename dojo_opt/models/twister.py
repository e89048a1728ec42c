"""A chain of boxes whose joints have the axes x, y, z in turn."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.box_chain import box_chain
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import Contact

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
    links, joints, front, rear = box_chain("twister", n, joint, AXES, mass, (length, width, height), spring, damper)
    contacts = [Contact("link_0", front, radius, friction, law, name="link_0_front")]
    contacts += [Contact(f"link_{i}", rear, radius, friction, law, name=f"link_{i}_rear") for i in range(n)]
    neutral = {"base": (0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(links, joints, contacts, gravity=gravity, name="twister", neutral=neutral)
