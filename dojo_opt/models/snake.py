"""A chain of boxes that lies on the ground."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.box_chain import box_chain
from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.contact import Contact
from sim.mechanism.mechanism import Mechanism


@checked_numbers("models")
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
    """A chain of `n` boxes along x, the first one free; each touches the ground z = 0 with both ends of its axis.

        q  (7 + ...,) position of link_0 [m], its quaternion, then the coordinates of each joint; spherical: quaternions
        u  (3 (n - 1),) torques of the joints in the child's axes [N m]; of another kind, one per degree of freedom

    Args:
        n: number of boxes, at least 1.
        joint: kind of all joints, about or along x.
        mass: mass of one box [kg].
        length: edge of one box along x [m].
        width: edge of one box along y [m].
        height: edge of one box along z [m].
        radius: radius of the balls at the ends [m]; 0 for points.
        spring: spring constant of each joint [N m/rad; of translations N/m], with its rest at zero.
        damper: damper of each joint [N m s/rad; of translations N s/m].
        friction: coefficient of friction of the contacts.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state lies straight, its ends on the ground.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links, joints, front, rear = box_chain(
        "snake", n, joint, ((1.0, 0.0, 0.0),), mass, (length, width, height), spring, damper
    )
    contacts = [
        Contact(f"link_{i}", point, radius, friction=friction, law=law, name=f"link_{i}_{end}")
        for i in range(n)
        for end, point in (("front", front), ("rear", rear))
    ]
    neutral = {"base": (0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(links, joints, contacts, gravity=gravity, name="snake", neutral=neutral)
