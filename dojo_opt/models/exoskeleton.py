"""A powered arm exoskeleton with the arm inside."""

from __future__ import annotations

from math import pi

from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, Mount, bodies, degrees, joints
from sim.mechanism.mechanism import Mechanism

# the wearer's arm: 3 % and 2 % of 75 kg
UPPER_ARM = Link(2.25, (0.0, 0.0, -0.155), (0.01875, 0.01875, 0.00375))
LOWER_ARM = Link(1.5, (0.0, 0.125, 0.0), (0.008515625, 0.00140625, 0.008515625))
UNITS = {
    "sAA": Link(6.712, (0.0, 0.1301, -0.1279), (0.3787893, -0.0006556, -0.0006709, 0.192833, 0.0540633, 0.1956839)),
    "sFE": Link(3.487, (0.0001, 0.1051, -0.1201), (0.1108677, -9.77e-5, 3.99e-5, 0.0689688, 0.0384741, 0.0569634)),
    "sIE": Link(1.663, (-0.0006, 0.1079, -0.03), (0.0266938, 0.0001282, -5.56e-5, 0.007941, 0.0038772, 0.0235228)),
    "eFE": Link(0.494, (0.0, 0.0557, -0.0803), (0.0069974, -9e-7, -4e-7, 0.0035498, 0.001812, 0.0037622)),
}


@checked_numbers("models")
def exoskeleton(
    *,
    spring: float = 0.0,
    damper: float = 0.0,
    limits: bool = True,
    arm: bool = True,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Four hinges on a fixed base: shoulder abduction, flexion and internal rotation, and elbow flexion.

        q  (4,) sAA, sFE, sIE, eFE [rad]
        u  (4,) torques in the same order [N m]

    Masses, inertias and dimensions are those of the model in Dojo.

    Args:
        spring: spring constant of the hinges [N m/rad], with its rest at zero.
        damper: damper of the hinges [N m s/rad].
        limits: whether the hinges have stops: 0..90, 0..90, -80..25, -125..0 degrees.
        arm: whether the wearer's arm (2.25 and 1.5 kg) is in it.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state has the angles (pi/4, pi/4, 0, -pi/4).

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    quarter = pi / 2
    links = dict(UNITS)
    if arm:
        links["sIE"] = links["sIE"].welded((UPPER_ARM, (0, 0, 0)))
        links["eFE"] = links["eFE"].welded((LOWER_ARM, (0, 0, 0)))
    z = (0.0, 0.0, 1.0)
    mounts = [
        Mount("sAA", None, (0.2483, 0.0, 1.15), z, degrees(0, 90), (quarter, 0.0, quarter)),
        Mount("sFE", "sAA", (0.0, 0.0, 0.0), z, degrees(0, 90), (quarter, 0.0, 0.0)),
        Mount("sIE", "sFE", (0.0, 0.3087, 0.0), z, degrees(-80, 25), (-quarter, 0.0, 0.0)),
        Mount("eFE", "sIE", (0.0, 0.0, 0.0), z, degrees(-125, 0), (quarter, 0.0, 0.0)),
    ]
    neutral = {"sAA": pi / 4, "sFE": pi / 4, "sIE": 0.0, "eFE": -pi / 4}
    hinges = joints(links, mounts, spring=spring, damper=damper, limits=limits)
    return Mechanism(bodies(links), hinges, gravity=gravity, name="exoskeleton", neutral=neutral)
