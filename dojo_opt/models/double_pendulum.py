"""Two links on a pivot, both joints driven."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.npendulum import npendulum
from sim.mechanism.mechanism import Mechanism


@checked_numbers("models")
def double_pendulum(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.05,
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Two equal links on a pivot. They hang straight down at angles of zero.

        pivot o  z = 2.2 length       q  (2,) angle of link_0 to the vertical, of link_1 to link_0, about x [rad]
              |                       u  (2,) torques at pivot and elbow [N m]
              |

    Args:
        mass: mass of one link [kg].
        length: length of one link [m].
        width: edge of the square cross-section of the links [m].
        spring: spring constant of both joints [N m/rad], with its rest at zero.
        damper: damper of both joints [N m s/rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state hangs straight down.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    return npendulum(
        2, mass=mass, length=length, width=width, spring=spring, damper=damper, gravity=gravity, name="double_pendulum"
    )
