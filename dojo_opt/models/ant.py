"""The four-legged ant of OpenAI's gym."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, Mount, bodies, degrees, grounded, joints, rod, touch
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere

RADIUS = 0.08  # of the legs [m]
# leg: signs of x and y, stops of the ankle [degrees]
LEGS = {
    "front_left": (1, 1, (30, 70)),
    "front_right": (-1, 1, (-70, -30)),
    "back_left": (-1, -1, (-70, -30)),
    "back_right": (1, -1, (30, 70)),
}


@checked_numbers("models")
def ant(
    *,
    spring: float = 0.0,
    damper: float = 1.0,
    limits: bool = True,
    friction: float = 0.5,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A ball on four legs of two links.

          \\ /      q  (15,) position of the torso's centre [m], its quaternion, then for front_left, front_right,
        __(o)__        back_left, back_right: hip about the vertical, ankle across the leg [rad]
          / \\      u  (8,) torques of the hinges in the same order [N m]

    Masses, lengths and stops are those of gym's ant, as Dojo has them. The parts welded to the torso belong to it.

    Args:
        spring: spring constant of the eight hinges [N m/rad], with its rest at zero.
        damper: damper of the eight hinges [N m s/rad].
        limits: whether the hinges have stops.
        friction: coefficient of friction of the nine contacts: feet, knees and torso.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands with its ankles bent by one radian.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    torso = Link(0.3272, (0.0, 0.0, 0.0), np.full(3, 0.4 * 0.3272 * 0.25**2), Sphere(0.25))
    out = {leg: np.array([x, y, 0.0]) for leg, (x, y, _) in LEGS.items()}
    root = [(rod(0.0365, 0.2828, RADIUS, (0, 0, 0), along), (0.0, 0.0, 0.0)) for along in out.values()]
    links = {"torso": torso.welded(*root)}
    mounts, contacts, neutral = [], [], {}
    for leg, (x, y, stops) in LEGS.items():
        hip, ankle = f"{leg}_leg", f"{leg}_foot"
        links[hip] = rod(0.0365, 0.2828, RADIUS, (0, 0, 0), out[leg])
        links[ankle] = rod(0.0649, 0.5657, RADIUS, (0, 0, 0), out[leg])
        across = (-1.0, 1.0, 0.0) if x * y > 0 else (1.0, 1.0, 0.0)
        mounts += [
            Mount(hip, "torso", 0.2 * out[leg], (0.0, 0.0, 1.0), degrees(-30, 30), name=f"{leg}_hip"),
            Mount(ankle, hip, 0.2 * out[leg], across, degrees(*stops), name=f"{leg}_ankle"),
        ]
        neutral[f"{leg}_ankle"] = float(np.sign(stops[0]))
        contacts += [
            touch(links, ankle, 0.4 * out[leg], RADIUS, f"{leg}_foot", friction=friction, law=law),
            touch(links, hip, 0.2 * out[leg], RADIUS, f"{leg}_knee", friction=friction, law=law),
        ]
    contacts.append(touch(links, "torso", (0, 0, 0), 0.25, "torso", friction=friction, law=law))
    hinges = joints(links, mounts, spring=spring, damper=damper, limits=limits)
    mech = Mechanism(
        bodies(links),
        [Joint("floating", None, "torso", name="base"), *hinges],
        contacts,
        [Input(j.name) for j in hinges],
        gravity=gravity,
        name="ant",
        neutral=neutral,
    )
    return grounded(mech, 2)
