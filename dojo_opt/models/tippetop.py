"""A ball with a knob, which turns over when it spins."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere


@checked_numbers("models")
def tippetop(
    *,
    mass: float = 1.0,
    radius: float = 0.5,
    inertia: ArrayLike = (1.9, 2.1, 2.0),
    scale: float = 0.2,
    offset: float = 0.0,
    friction: float = 0.4,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A ball on the ground z = 0 with a smaller one, the knob, on its upper pole.

         o      q  (7,) position of the centre of mass of the ball [m], its quaternion
        ( )     u  (0,) nothing drives it

    The defaults are Dojo's. Their moments of inertia exceed those of a uniform ball 20 times: the top turns over
    slowly.

    Args:
        mass: mass of the ball [kg].
        radius: radius of the ball [m].
        inertia: (3,) or (3, 3) inertia of the ball about its centre of mass, body axes [kg m^2].
        scale: size of the knob, a uniform ball, relative to the ball. Its mass goes with the third power.
        offset: distance of the ball's centre of mass below its centre [m].
        friction: coefficient of friction of both contacts.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands upright, the knob on top.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    knob = scale * radius
    bodies = [
        Body("ball", mass, inertia, Sphere(radius, center=(0.0, 0.0, offset))),
        Body("knob", mass * scale**3, shape=Sphere(knob)),
    ]
    pole = np.array([0.0, 0.0, radius + offset])
    joints = [Joint("floating", None, "ball"), Joint("fixed", "ball", "knob", parent_point=pole)]
    contacts = [
        Contact("ball", (0.0, 0.0, offset), radius, friction=friction, law=law),
        Contact("knob", (0.0, 0.0, 0.0), knob, friction=friction, law=law),
    ]
    neutral = {"ball": (0.0, 0.0, radius - offset, 1.0, 0.0, 0.0, 0.0)}
    return Mechanism(bodies, joints, contacts, gravity=gravity, name="tippetop", neutral=neutral)
