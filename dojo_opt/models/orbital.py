"""A chain of links that swing in any direction but do not twist."""

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
def orbital(
    n: int = 5,
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.05,
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """`n` links that hang from one another by orbital joints; the first one is fixed to the world.

        #  fixed, z = 0      q  (2 (n - 1),) rotation vector of each joint along x and y [rad]
        |                    u  (2 (n - 1),) torques along the same coordinates [N m]
        |

    Args:
        n: number of links, at least 2.
        mass: mass of one link [kg].
        length: length of one link [m].
        width: edge of the square cross-section of the links [m].
        spring: spring constant of each joint [N m/rad], with its rest at zero.
        damper: damper of each joint [N m s/rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state hangs straight down, all coordinates zero.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    n = room_for("orbital(n)", n, LINK_BYTES, least=2, noun="bodies")
    upper, lower = (0.0, 0.0, length / 2), (0.0, 0.0, -length / 2)
    links = [Body(f"link_{i}", mass, shape=Box(width, width, length)) for i in range(n)]
    joints = [Joint("fixed", None, "link_0", name="joint_0", child_point=upper)]
    joints += [
        Joint(
            "orbital",
            f"link_{i - 1}",
            f"link_{i}",
            name=f"joint_{i}",
            parent_point=lower,
            child_point=upper,
            spring=spring,
            damper=damper,
        )
        for i in range(1, n)
    ]
    return Mechanism(links, joints, gravity=gravity, name="orbital")
