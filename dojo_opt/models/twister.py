"""A chain of boxes whose joints have the axes x, y, z in turn."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.box_chain import box_chain
from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.contact import Contact
from sim.mechanism.mechanism import Mechanism

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@checked_numbers("models")
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
    """A chain of `n` boxes along x, the first one free; its joints have the axes x, y and z in turn.

        q  (7 + ...,) position of link_0 [m], its quaternion, then the coordinate of each joint [m or rad]
        u  (n - 1,) force or torque of each joint [N or N m]; as many per joint as it has degrees of freedom

    Both ends of the first box and the rear ends of the others touch the ground z = 0.

    Args:
        n: number of boxes, at least 1.
        joint: kind of all joints.
        mass: mass of one box [kg].
        length: edge of one box along x [m].
        width: edge of one box along y [m].
        height: edge of one box along z [m].
        radius: radius of the balls at the ends [m]; 0 for points.
        spring: spring constant of each joint [N/m; of rotations N m/rad], with its rest at zero.
        damper: damper of each joint [N s/m; of rotations N m s/rad].
        friction: coefficient of friction of the contacts.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state lies straight, its ends on the ground.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links, joints, front, rear = box_chain("twister", n, joint, AXES, mass, (length, width, height), spring, damper)
    contacts = [Contact("link_0", front, radius, friction=friction, law=law, name="link_0_front")]
    contacts += [
        Contact(f"link_{i}", rear, radius, friction=friction, law=law, name=f"link_{i}_rear") for i in range(n)
    ]
    neutral = {"base": (0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(links, joints, contacts, gravity=gravity, name="twister", neutral=neutral)
