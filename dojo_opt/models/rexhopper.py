"""The hopper REx: one leg with a closed loop of four links, and three reaction wheels."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, Mount, bodies, grounded, joints, touch
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Cylinder

BASE = Link(
    5.596078,
    (-0.0040822, 0.0003793, 0.0170557),
    (3.772672e-3, -3.2227e-6, 5.32613e-5, 6.042041e-3, 8.35702e-6, 4.421792e-3),
    Box(0.12, 0.12, 0.12),
)
THIGH = 0.1  # of the front thigh and from the knee to the loop on the rear shank [m]
LONG = 0.27  # of the front shank and the rear thigh [m]
LEG = {
    "link0": Link(
        0.2563856,
        (0.0121851, 0.0180889, 0.0011269),
        (3.8465e-5, 1.53798e-5, -8.4832e-6, 1.726337e-4, 1.0826e-6, 1.488224e-4),
        Box(THIGH, 0.02, 0.02),
    ),
    "link1": Link(0.0631474, (0.1331016, 0.00653, 0.0), (2.55549e-6, 1.043019e-4, 1.043011e-4), Box(LONG, 0.01, 0.01)),
    "link2": Link(
        0.288845,
        (0.0389032, -0.0169314, -0.0006271),
        (3.46488e-5, -3.2596e-7, 5.24929e-6, 2.455847e-4, 3.0108e-8, 2.266764e-4),
        Box(LONG, 0.02, 0.02),
    ),
    "link3": Link(
        0.1248576,
        (0.1014382, -0.00251, -0.0148533),
        (1.60743e-5, -5.5461e-7, 1.00368e-6, 1.165064e-4, 1.0713e-7, 1.129468e-4),
        Box(LONG, 0.015, 0.015),
    ),
}
_X = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
WHEEL = (3.122272e-3, 1.585707e-3, 1.585707e-3)
WHEELS = {
    "rw0": Link(0.7156412, (-0.0106867, 0, 0), WHEEL, Cylinder(0.07, 0.02, orientation=_X)),
    "rw1": Link(0.7156412, (-0.0106867, 0, 0), WHEEL, Cylinder(0.07, 0.02, orientation=_X)),
    "rwz": Link(0.3778545, (0, 0, -0.014608), (3.00958e-4, 3.00958e-4, 5.78116e-4), Cylinder(0.05, 0.02)),
}
Y = (0.0, -1.0, 0.0)
MOUNTS = (
    Mount("link0", "base", (0, 0, 0), Y, None, (0, pi / 6, 0), name="joint0"),
    Mount("link1", "link0", (THIGH, 0, 0), Y, (-0.7597, 1.8295), (0, pi - 1.0768315, 0), name="joint1"),
    Mount("link2", "base", (0, 0, 0), Y, None, (0, pi - 0.5532327, 0), name="joint2"),
    Mount("link3", "link2", (LONG, 0, 0), Y, (-1.8295, 0.7597), (0, pi + 1.0768315, 0), name="joint3"),
)
WHEEL_MOUNTS = (
    Mount("rw0", "base", (0.0620133, -0.1472537, 0), (1, 0, 0), None, (3.0306586, 0, -pi / 4), name="joint_rw0"),
    Mount("rw1", "base", (0.0635257, 0.1487661, 0), (-1, 0, 0), None, (-0.0304330, 0, pi / 4), name="joint_rw1"),
    Mount("rwz", "base", (-0.076, 0, 0.0991), (0, 0, 1), None, (0, 0, -3 * pi / 4), name="joint_rwz"),
)


@checked_numbers("models")
def rexhopper(
    *,
    damper: float = 0.1,
    limits: bool = True,
    friction: float = 1.0,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """A body with three wheels on a leg of four links, whose two shanks are pinned together, 8.14 kg.

        q  (14,) position of the body's frame [m], its quaternion; joint0, joint1 (front thigh, shank), joint2, joint3
           (rear thigh, shank); joint_rw0, joint_rw1, joint_rwz, the wheels [rad]
        u  (5,) torques of the two thighs and of the three wheels [N m]

    Masses, inertias and dimensions are those of the model in Dojo, of the RExHopper of the Robotic Exploration Lab. The
    products of inertia of its wheels are omitted.

    Args:
        damper: damper of the hinges of the leg [N m s/rad]; the wheels have none.
        limits: whether the knees have stops.
        friction: coefficient of friction of the five contacts: foot, two ankles, and both sides of the body.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands on its foot.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links = {"base": BASE, **LEG, **WHEELS}
    made = joints(links, MOUNTS, damper=damper, limits=limits)
    wheels = joints(links, WHEEL_MOUNTS)
    pin = Joint(
        "revolute",
        "link1",
        "link3",
        "loop",
        parent_point=(LONG, 0.0, 0.0) - np.asarray(LEG["link1"].com),
        child_point=(THIGH, 0.0, 0.0) - np.asarray(LEG["link3"].com),
        axis=Y,
        close=True,
    )
    spots = (
        ("link3", "foot", (0.1685, 0.0025, -0.0055), 0.0203),
        ("link3", "ankle3", (-0.10, -0.002, 0.01), 0.025),
        ("link2", "ankle2", (0.24, 0.007, 0.005), 0.025),
        ("base", "torso_left", (0.0, 0.075, 0.03), 0.14),
        ("base", "torso_right", (0.0, -0.075, 0.03), 0.14),
    )  # from the centres of mass [m]
    contacts = [
        touch(links, body, np.asarray(links[body].com) + at, radius, name, friction=friction, law=law)
        for body, name, at, radius in spots
    ]
    base = Joint("floating", None, "base", name="floating", child_point=-np.asarray(BASE.com))
    inputs = [Input(name) for name in ("joint0", "joint2", "joint_rw0", "joint_rw1", "joint_rwz")]
    mech = Mechanism(bodies(links), [base, *made, *wheels, pin], contacts, inputs, gravity=gravity, name="rexhopper")
    return grounded(mech, 2)
