"""Raibert's hopper: a body on a springy leg, reduced to two balls and a slider."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere


@checked_numbers("models")
def raiberthopper(
    *,
    body_mass: float = 4.18,
    foot_mass: float = 0.52,
    body_radius: float = 0.1,
    foot_radius: float = 0.05,
    leg_length: float = 0.5,
    spring: float = 0.0,
    damper: float = 0.1,
    limits: Sequence[float] | None = None,
    friction: float = 0.5,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A body on a sliding leg, both balls. The leg is straight down in the neutral state.

        (body)    z up      q  (8,) position of the body [m], its quaternion, leg length [m]
           |                v  (7,) velocity (world), angular velocity (body), leg rate
           | leg            u  (3,) torque on the body about its x and y axes [N m], leg force [N], positive extends
         (foot)

    The torques act on the body alone, as from reaction wheels. Both balls touch the ground.

    Args:
        body_mass: mass of the body [kg].
        foot_mass: mass of the foot [kg].
        body_radius: radius of the body [m].
        foot_radius: radius of the foot [m].
        leg_length: length of the leg in the neutral state, from centre to centre [m].
        spring: spring constant of the leg [N/m], with its rest at `leg_length`.
        damper: damper of the leg [N s/m].
        limits: (shortest, longest) leg [m]; None for no stops.
        friction: coefficient of friction of both balls.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands with the body at (0, 0, leg_length + foot_radius), by default
        (0, 0, 0.55).

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    return Mechanism(
        bodies=[
            Body("body", body_mass, shape=Sphere(body_radius)),
            Body("foot", foot_mass, shape=Sphere(foot_radius)),
        ],
        joints=[
            Joint("floating", None, "body"),
            Joint(
                "prismatic",
                "body",
                "foot",
                name="leg",
                axis=(0.0, 0.0, -1.0),
                spring=spring,
                damper=damper,
                rest=leg_length,
                limits=limits,
            ),
        ],
        contacts=[
            Contact("foot", radius=foot_radius, friction=friction, law=law),
            Contact("body", radius=body_radius, friction=friction, law=law),
        ],
        inputs=[Input("body", dof=3, name="torque_x"), Input("body", dof=4, name="torque_y"), Input("leg")],
        gravity=gravity,
        name="raiberthopper",
        neutral={"body": (0.0, 0.0, leg_length + foot_radius, 1.0, 0.0, 0.0, 0.0), "leg": leg_length},
    )
