"""One link on a pivot."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.npendulum import npendulum
from sim.mechanism.mechanism import Mechanism


@checked_numbers("models")
def pendulum(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.1,
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A uniform link on a pivot. It hangs at an angle of zero and is upright at pi.

        pivot o  z = 1.1 length       q  (1,) angle about x [rad]
              |                       u  (1,) torque at the pivot [N m]

    Args:
        mass: mass of the link [kg].
        length: length of the link [m].
        width: edge of the square cross-section of the link [m].
        spring: spring constant of the joint [N m/rad], with its rest at zero.
        damper: damper of the joint [N m s/rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state hangs.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    return npendulum(
        1, mass=mass, length=length, width=width, spring=spring, damper=damper, gravity=gravity, name="pendulum"
    )
