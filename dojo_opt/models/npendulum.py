"""A chain of links that hangs from a pivot."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import LINK_BYTES
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import room_for
from sim.mechanism.shapes import Box


@checked_numbers("models")
def npendulum(
    n: int = 5,
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.05,
    spring: float = 0.0,
    damper: float = 0.0,
    joint: str = "revolute",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    name: str = "npendulum",
) -> Mechanism:
    """A chain of `n` equal links on a pivot. It hangs straight down at angles of zero.

            pivot o  z = 1.1 n length         y ->   z up,  x towards the reader
                  |  link_0                   q  (n,) angle of each link to the one before, about x [rad]
                  |  link_1                   u  (n,) torque at each joint [N m]

    Args:
        n: number of links, at least 1.
        mass: mass of one link [kg].
        length: length of one link [m].
        width: edge of the square cross-section of the links [m].
        spring: spring constant of each joint [N m/rad], with its rest at zero.
        damper: damper of each joint [N m s/rad].
        joint: kind of all joints, any one without translation. With "spherical", say, the coordinates are quaternions
            and u has three torques per joint.
        gravity: (3,) acceleration of gravity [m/s^2].
        name: name of the mechanism.

    Returns:
        The mechanism. Its neutral state hangs straight down.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    n = room_for("npendulum(n)", n, LINK_BYTES, noun="bodies")
    half = (0.0, 0.0, length / 2)
    below = (0.0, 0.0, -length / 2)
    pivot = (0.0, 0.0, 1.1 * n * length)
    links = [f"link_{i}" for i in range(n)]
    shape = Box(width, width, length)
    bodies = [Body(link, mass, shape=shape) for link in links]
    joints = [
        Joint(
            joint,
            links[i - 1] if i else None,
            links[i],
            name=f"joint_{i}",
            parent_point=below if i else pivot,
            child_point=half,
            axis=(1.0, 0.0, 0.0),
            spring=spring,
            damper=damper,
        )
        for i in range(n)
    ]
    return Mechanism(bodies, joints, gravity=gravity, name=name)
