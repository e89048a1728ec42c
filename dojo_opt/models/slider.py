"""One link on a vertical rail."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box


@checked_numbers("models")
def slider(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    width: float = 0.1,
    spring: float = 0.0,
    damper: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A uniform link that slides up and down.

        |#|     q  (1,) height of the upper end of the link [m]
        |#|     u  (1,) force along z [N]

    Args:
        mass: mass of the link [kg].
        length: length of the link [m].
        width: edge of the square cross-section of the link [m].
        spring: spring constant of the rail [N/m], with its rest at zero.
        damper: damper of the rail [N s/m].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. In its neutral state the upper end is at z = 0.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    link = Body("link", mass, shape=Box(width, width, length))
    rail = Joint("prismatic", None, "link", name="rail", child_point=(0, 0, length / 2), spring=spring, damper=damper)
    return Mechanism([link], [rail], gravity=gravity, name="slider")
