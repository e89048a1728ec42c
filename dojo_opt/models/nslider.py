"""A chain of links that slide along one another."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import LINK_BYTES
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import room_for
from sim.mechanism.shapes import Cylinder


@checked_numbers("models")
def nslider(
    n: int = 5,
    *,
    mass: float = 1.0,
    length: float = 1.0,
    radius: float = 0.05,
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """`n` rods side by side along y, each on a vertical rail of the one before.

        | |     q  (n,) height of the upper end of each rod over that of the one before [m]
        |||     u  (n,) force of each rail along z [N]
          |

    Args:
        n: number of rods, at least 1.
        mass: mass of one rod [kg].
        length: length of one rod [m].
        radius: radius of the rods, and distance from one to the next [m].
        spring: spring constant of each rail [N/m], with its rest at zero.
        damper: damper of each rail [N s/m].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. In its neutral state the upper ends of all rods are at z = 0.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    n = room_for("nslider(n)", n, LINK_BYTES, noun="bodies")
    rods = [Body(f"rod_{i}", mass, shape=Cylinder(radius, length)) for i in range(n)]
    top = (0.0, 0.0, length / 2)
    rails = [
        Joint(
            "prismatic",
            f"rod_{i - 1}" if i else None,
            f"rod_{i}",
            name=f"rail_{i}",
            parent_point=(0.0, radius, length / 2) if i else (0.0, 0.0, 0.0),
            child_point=top,
            spring=spring,
            damper=damper,
        )
        for i in range(n)
    ]
    return Mechanism(rods, rails, gravity=gravity, name="nslider")
