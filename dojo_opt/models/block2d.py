"""A square in a vertical plane, on the ground."""

from __future__ import annotations

from itertools import product

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box


@checked_numbers("models")
def block2d(
    *,
    edge: float = 0.5,
    mass: float = 1.0,
    friction: float = 0.8,
    law: str = "nonlinear",
    radius: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A uniform cube that stays in the plane x = 0. Four corners touch the ground z = 0.

        +-----+     q  (3,) position y, z of the centre [m], angle about x [rad]
        |  o  |     u  (3,) forces along y and z [N], torque about x [N m]
        +-----+ edge

    Args:
        edge: length of an edge [m].
        mass: mass [kg].
        friction: coefficient of friction of the four contacts.
        law: contact law, see `dojo.Contact`.
        radius: radius of the balls at the corners, which fit inside the cube [m]; 0 for points.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands at y = 0, z = edge/2.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    half = edge / 2 - radius
    corners = [(0.0, half * y, half * z) for y, z in product((1, -1), repeat=2)]
    return Mechanism(
        bodies=[Body("block", mass, shape=Box(edge, edge, edge))],
        joints=[Joint("planar_axis", None, "block", axis=(1.0, 0.0, 0.0))],
        contacts=[
            Contact("block", p, radius, friction=friction, law=law, name=f"corner_{k}") for k, p in enumerate(corners)
        ],
        gravity=gravity,
        name="block2d",
        neutral={"block": (0.0, edge / 2, 0.0)},
    )
