"""One link on a vertical rail."""

from __future__ import annotations

from numpy.typing import ArrayLike

from sim.mechanism.mechanism import Mechanism
from sim.mechanism.parts import Body, Joint
from sim.mechanism.shapes import Box


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

    mass [kg], length and width [m], spring [N/m], damper [N s/m].
    """
    link = Body("link", mass, shape=Box(width, width, length))
    rail = Joint("prismatic", None, "link", name="rail", child_point=(0, 0, length / 2), spring=spring, damper=damper)
    return Mechanism([link], [rail], gravity=gravity, name="slider")
