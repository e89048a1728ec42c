"""The planar walker of OpenAI's gym: the hopper with two legs."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.hopper import DOWN, FORWARD
from dojo_opt.models.links import Mount, degrees, rod
from dojo_opt.models.planar import Ball, planar_robot
from sim.mechanism.mechanism import Mechanism


@checked_numbers("models")
def walker(
    *,
    spring: float = 0.0,
    damper: float = 0.1,
    base_damper: float = 0.0,
    limits: bool = True,
    friction: float = 0.5,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Torso and two legs of three links in the plane y = 0. It stands upright at angles of zero.

        |        q  (9,) position x, z of the middle of the torso [m], its pitch about y, then thigh, leg, foot of the
        |           right and of the left leg about y [rad]; thigh and leg fold back at positive angles
        |_       u  (6,) torques of the hinges in the same order [N m]

    Masses, lengths and stops are gym's. The two legs may pass through one another.

    Args:
        spring: spring constant of the six hinges [N m/rad], with its rest at zero.
        damper: damper of the six hinges [N m s/rad].
        base_damper: damper of the torso's motion along x, z [N s/m] and about y [N m s/rad].
        limits: whether the hinges have stops.
        friction: coefficient of friction of the nine contacts.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands upright.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    y = (0.0, 1.0, 0.0)
    links = {"torso": rod(3.53429, 0.4, 0.05, (0.0, 0.0, 0.2), DOWN)}
    mounts: list[Mount] = []
    balls: list[Ball] = [("head", "torso", (0.0, 0.0, 0.2), 0.05)]
    for side in ("right", "left"):
        thigh, leg, foot = f"{side}_thigh", f"{side}_leg", f"{side}_foot"
        links[thigh] = rod(3.92699, 0.45, 0.05, (0.0, 0.0, 0.0), DOWN)
        links[leg] = rod(2.71433, 0.5, 0.04, (0.0, 0.0, 0.0), DOWN)
        links[foot] = rod(2.94053, 0.2, 0.06, (0.0, 0.0, 0.0), FORWARD)
        mounts += [
            Mount(thigh, "torso", (0.0, 0.0, -0.2), y, degrees(0, 150)),
            Mount(leg, thigh, (0.0, 0.0, -0.45), y, degrees(0, 150)),
            Mount(foot, leg, (0.0, 0.0, -0.5), y, degrees(-45, 45)),
        ]
        balls += [
            (f"{side}_heel", foot, (0.0, 0.0, 0.0), 0.06),
            (f"{side}_toe", foot, (0.2, 0.0, 0.0), 0.06),
            (f"{side}_knee", thigh, (0.0, 0.0, -0.45), 0.05),
            (f"{side}_hip", thigh, (0.0, 0.0, 0.0), 0.05),
        ]
    return planar_robot(
        "walker",
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
