"""A ball on the ground, pushed by a force."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere


@checked_numbers("models")
def sphere(
    *,
    radius: float = 0.5,
    mass: float = 1.0,
    friction: float = 0.8,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A uniform ball that touches the ground z = 0.

        q  (7,) position of the centre [m], quaternion
        u  (3,) force at the centre of mass along x, y, z of the world [N]

    Args:
        radius: radius [m].
        mass: mass [kg].
        friction: coefficient of friction.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state rests at (0, 0, radius).

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    return Mechanism(
        bodies=[Body("sphere", mass, shape=Sphere(radius))],
        joints=[Joint("floating", None, "sphere")],
        contacts=[Contact("sphere", radius=radius, friction=friction, law=law)],
        inputs=[
            Input(body="sphere", force=axis, name=f"force_{label}")
            for label, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1)))
        ],
        gravity=gravity,
        name="sphere",
        neutral={"sphere": (0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0)},
    )
