"""KUKA's mobile arm youBot."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, Mount, bodies, joints
from sim.mechanism.input import Input
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Cylinder

PLATFORM = Link(
    22.0,
    (0.0, 0.0, 0.0),
    (5.652232699207, -0.009719934438, 1.293988226423, 5.669473158652, -0.007379583694, 3.683196351726),
    Box(0.57, 0.36, 0.1),
)
ON_PLATFORM = (  # plate, foot of the arm, laser scanner
    (Link(2.397, (0, 0, 0), (0.01, 0.01, 0.01)), (-0.159, 0.0, 0.046)),
    (Link(0.961, (0, 0, 0), (0.01, 0.01, 0.01)), (0.143, 0.0, 0.046)),
    (Link(0.16, (0, 0, 0), (0.1, 0.1, 0.1)), (0.3, 0.0, -0.03)),
)
WHEEL = Link(
    1.5,
    (0.0, 0.0, 0.0),
    (0.024823531194, -0.001423467356, 0.00100545966, 0.030436320856, -8.546934e-6, 0.023527955886),
    Cylinder(0.0475, 0.0475, orientation=(0.5**0.5, 0.5**0.5, 0.0, 0.0)),
)
WHEELS = {"fl": (0.228, 0.158), "fr": (0.228, -0.158), "bl": (-0.228, 0.158), "br": (-0.228, -0.158)}
ARM = (
    Link(1.39, (0.01489, 0.00213, 0.00213), (0.0029525, 0.0060091, 0.0058821)),
    Link(1.318, (0.01053, -0.0307, 0.08597), (0.0031145, 0.0005843, 0.0031631)),
    Link(0.821, (0.0001, 0.0207, 0.07107), (0.00172767, 0.00041967, 0.0018468)),
    Link(0.769, (0.00011, -0.02, 0.05019), (0.0006764, 0.0010573, 0.000661)),
    Link(0.687, (0.0, 0.00115, -0.01683), (0.0001934, 0.0001602, 0.0000689)),
)
PALM = Link(0.1, (0.0, 0.0, 0.0), (0.01, 0.01, 0.01))
FINGER = Link(0.01, (0.0, -0.001, 0.0), (0.01, 0.01, 0.01))
# hinge in the frame of the link before [m], axis, stops [rad]
HINGES = (
    ((0.143 + 0.024, 0.0, 0.046 + 0.096), (0, 0, -1), (-2.95, 2.95)),
    ((0.033, 0.0, 0.019), (0, 1, 0), (-1.57, 1.13)),
    ((0.0, 0.0, 0.155), (0, 1, 0), (-2.55, 2.55)),
    ((0.0, 0.0, 0.135), (0, 1, 0), (-1.78, 1.78)),
    ((-0.002, 0.0, 0.13), (0, 0, -1), (-2.92, 2.92)),
)


@checked_numbers("models")
def youbot(
    *,
    spring: float = 0.0,
    damper: float = 1.0,
    limits: bool = True,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A platform that moves in the plane, four wheels, five hinges and two fingers; its arm is upright at zero.

        q  (14,) position x, y of the platform [m], its heading [rad]; wheels fl, fr, bl, br; arm 1 .. 5 [rad];
           finger_l, finger_r [m]
        u  (14,) forces [N] and torques [N m] in the same order

    The platform is carried: the wheels turn freely and touch nothing. Masses, inertias and dimensions are KUKA's, as in
    the youbot_description of the model in Dojo; the stops are Dojo's.

    Args:
        spring: spring constant of wheels and hinges [N m/rad] and of fingers [N/m], with its rest at zero.
        damper: damper of wheels and hinges [N m s/rad] and of fingers [N s/m].
        limits: whether hinges and fingers have stops.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state holds the arm upright, the fingers open by 5 mm each.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links = {"platform": PLATFORM.welded(*ON_PLATFORM)}
    mounts = []
    for name, (x, y) in WHEELS.items():
        links[f"wheel_{name}"] = WHEEL
        mounts.append(Mount(f"wheel_{name}", "platform", (x, y, -0.034), (0, 1, 0)))
    for k, (point, axis, stops) in enumerate(HINGES, 1):
        links[f"arm_{k}"] = ARM[k - 1]
        mounts.append(Mount(f"arm_{k}", f"arm_{k - 1}" if k > 1 else "platform", point, axis, stops))
    links["arm_5"] = links["arm_5"].welded((PALM, (0.0, 0.0, 0.0)))
    for side, y, turn in (("l", 0.008, pi), ("r", -0.008, 0.0)):
        links[f"finger_{side}"] = FINGER
        at = (0.004, y, 0.046)
        mounts.append(
            Mount(f"finger_{side}", "arm_5", at, (0, -1, 0), (0.0, 0.0115), (0.0, 0.0, turn), kind="prismatic")
        )
    base = joints(links, [Mount("platform", None, (0.0, 0.0, 0.083), kind="planar_axis", name="base")])
    made = joints(links, mounts, spring=spring, damper=damper, limits=limits)
    inputs = [Input(j.name, dof=d) for j in [*base, *made] for d in range(j.nv)]
    neutral = {f"finger_{side}": np.array([0.005]) for side in "lr"}
    return Mechanism(bodies(links), base + made, inputs=inputs, gravity=gravity, name="youbot", neutral=neutral)
