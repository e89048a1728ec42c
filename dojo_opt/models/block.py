"""A cube on the ground, pushed by a force."""

from __future__ import annotations

from itertools import product

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box


@checked_numbers("models")
def block(
    *,
    edge: float = 0.5,
    mass: float = 1.0,
    friction: float = 0.8,
    law: str = "nonlinear",
    radius: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A uniform cube whose eight corners touch the ground z = 0.

        +-----+     q  (7,) position of the centre [m], quaternion
        |  o  |     u  (3,) force at the centre of mass along x, y, z of the world [N]
        +-----+ edge

    Args:
        edge: length of an edge [m].
        mass: mass [kg].
        friction: coefficient of friction of the eight contacts.
        law: contact law, see `dojo.Contact`.
        radius: radius of the balls at the corners, which fit inside the cube [m]; 0 for points.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands at (0, 0, edge/2).

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    half = edge / 2 - radius
    corners = [(half * x, half * y, half * z) for x, y, z in product((1, -1), repeat=3)]
    return Mechanism(
        bodies=[Body("block", mass, shape=Box(edge, edge, edge))],
        joints=[Joint("floating", None, "block")],
        contacts=[
            Contact("block", p, radius, friction=friction, law=law, name=f"corner_{k}") for k, p in enumerate(corners)
        ],
        inputs=[
            Input(body="block", force=axis, name=f"force_{label}")
            for label, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1)))
        ],
        gravity=gravity,
        name="block",
        neutral={"block": (0.0, 0.0, edge / 2, 1.0, 0.0, 0.0, 0.0)},
    )
