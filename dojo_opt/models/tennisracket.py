"""A flat box in free fall with three different moments of inertia."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box


@checked_numbers("models")
def tennisracket(
    *,
    mass: float = 1.0,
    length: float = 1.0,
    gravity: ArrayLike = (0.0, 0.0, 0.0),
) -> Mechanism:
    """A box with edges length/25, length/2, length in space; rotation about its y axis, the middle one, is unstable.

        q  (7,) position of the centre [m], quaternion
        u  (0,) nothing drives it

    Args:
        mass: mass [kg].
        length: longest edge, along z [m].
        gravity: (3,) acceleration of gravity [m/s^2]; zero by default, in space.

    Returns:
        The mechanism.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    box = Body("racket", mass, shape=Box(length / 25, length / 2, length))
    return Mechanism([box], [Joint("floating", None, "racket")], gravity=gravity, name="tennisracket")
