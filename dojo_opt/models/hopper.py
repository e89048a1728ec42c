"""The planar hopper of OpenAI's gym."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Mount, degrees, rod
from dojo_opt.models.planar import planar_robot
from sim.mechanism.mechanism import Mechanism

DOWN, FORWARD = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)


@checked_numbers("models")
def hopper(
    *,
    spring: float = 0.0,
    damper: float = 1.0,
    base_damper: float = 0.0,
    limits: bool = True,
    friction: float = 2.0,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Torso, thigh, leg and foot in the plane y = 0. It stands upright at angles of zero.

        |        q  (6,) position x, z of the middle of the torso [m], its pitch about y, then thigh, leg, foot about y
        |           [rad]; thigh and leg fold back at positive angles
        |_       u  (3,) torques of thigh, leg and foot [N m]

    Masses, lengths and stops are gym's. Dojo has a spring of 10, a damper of 1 and a base damper of 50.

    Args:
        spring: spring constant of the three hinges [N m/rad], with its rest at zero.
        damper: damper of the three hinges [N m s/rad].
        base_damper: damper of the torso's motion along x, z [N s/m] and about y [N m s/rad].
        limits: whether the hinges have stops.
        friction: coefficient of friction of the five contacts.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands upright.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links = {
        "torso": rod(3.53429, 0.4, 0.05, (0.0, 0.0, 0.2), DOWN),
        "thigh": rod(3.92699, 0.45, 0.05, (0.0, 0.0, 0.0), DOWN),
        "leg": rod(2.71433, 0.5, 0.04, (0.0, 0.0, 0.0), DOWN),
        "foot": rod(5.08938, 0.39, 0.06, (-0.13, 0.0, 0.0), FORWARD),
    }
    y = (0.0, 1.0, 0.0)
    mounts = [
        Mount("thigh", "torso", (0.0, 0.0, -0.2), y, degrees(0, 150)),
        Mount("leg", "thigh", (0.0, 0.0, -0.45), y, degrees(0, 150)),
        Mount("foot", "leg", (0.0, 0.0, -0.5), y, degrees(-45, 45)),
    ]
    balls = [
        ("heel", "foot", (-0.13, 0.0, 0.0), 0.06),
        ("toe", "foot", (0.26, 0.0, 0.0), 0.06),
        ("knee", "thigh", (0.0, 0.0, -0.45), 0.05),
        ("hip", "torso", (0.0, 0.0, -0.2), 0.05),
        ("head", "torso", (0.0, 0.0, 0.2), 0.05),
    ]
    return planar_robot(
        "hopper",
        links,
        mounts,
        balls,
        springs=dict.fromkeys(links, spring),
        dampers=dict.fromkeys(links, damper),
        base_damper=base_damper,
        limits=limits,
        friction=friction,
        law=law,
        gravity=gravity,
    )
