"""Two links on a pivot, driven at the elbow only."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.npendulum import npendulum
from sim.mechanism.input import Input
from sim.mechanism.mechanism import Mechanism


@checked_numbers("models")
def acrobot(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.05,
    damper: float = 0.1,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Two equal links on a pivot, driven at the elbow. They hang at angles of zero and stand upright at (pi, 0).

        pivot o  z = 2.2 length       q  (2,) angle of link_0 to the vertical, of link_1 to link_0, about x [rad]
              |                       u  (1,) torque at the elbow [N m]
              |

    Args:
        mass: mass of one link [kg].
        length: length of one link [m].
        width: edge of the square cross-section of the links [m].
        damper: damper of both joints [N m s/rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state hangs straight down.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    chain = npendulum(2, mass=mass, length=length, width=width, damper=damper, gravity=gravity, name="acrobot")
    return replace(chain, inputs=[Input("joint_1", name="elbow")])
