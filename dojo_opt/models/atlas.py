"""Boston Dynamics' humanoid Atlas, version 5, as its public model has it."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, Mount, bodies, grounded, joints, padded, touch
from sim.mechanism import checks
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box

TRUNK = {
    "pelvis": Link(9.509, (0.0111, 0, 0.0271), (0.1244, 0.0008, -0.0007, 0.0958, -0.0005, 0.1167), Box(0.2, 0.2, 0.15)),
    "ltorso": Link(
        2.27,
        (-0.0112984, -3.15366e-6, 0.0746835),
        (3.9092e-3, -5.045e-8, -3.42157e-4, 3.41694e-3, 4.871e-7, 1.74492e-3),
    ),
    "mtorso": Link(
        0.799,
        (-0.00816266, -0.0131245, 0.0305974),
        (4.54181e-4, -6.10764e-5, 3.94e-5, 4.83282e-4, 5.27463e-5, 4.44215e-4),
    ),
    "utorso": Link(84.409, (-0.0622, 0.0023, 0.3157), (1.577, -0.032, 0.102, 1.602, 0.047, 0.565), Box(0.3, 0.4, 0.5)),
    "head": Link(
        1.4199, (-0.075493, 3.3383e-5, 0.02774), (3.9688e-3, -1.58e-6, -8.9293e-4, 4.1178e-3, -6.84e-7, 3.5243e-3)
    ),
}
# of the left leg; y is mirrored for the right one
LEG = {
    "uglut": Link(
        1.959, (0.00529262, -0.00344732, 0.00313046), (7.4276e-4, -3.8e-8, -2.79549e-5, 6.88179e-4, -3.27e-8, 4.1242e-4)
    ),
    "lglut": Link(
        0.898,
        (0.0133341, 0.0170484, -0.0312052),
        (6.91326e-4, -2.24344e-5, 2.505e-6, 1.26856e-3, 1.37862e-4, 1.06487e-3),
    ),
    "uleg": Link(8.204, (0, 0, -0.21), (0.09, 0.09, 0.02), Box(0.13, 0.13, 0.4)),
    "lleg": Link(4.515, (0.001, 0, -0.187), (0.077, 0, -0.003, 0.076, 0, 0.01), Box(0.1, 0.1, 0.4)),
    "talus": Link(0.125, (0, 0, 0), (1.01674e-5, 8.42775e-6, 1.30101e-5)),
    "foot": Link(2.41, (0.027, 0, -0.067), (0.002, 0.007, 0.008), Box(0.26, 0.13, 0.03)),
}
# of both arms, which have the same frames but for half a turn
ARM = {
    "clav": Link(4.466, (0, 0, -0.084), (0.011, 0, 0, 0.009, 0.004, 0.004)),
    "scap": Link(3.899, (0, 0, 0), (0.00319, 0.00583, 0.00583)),
    "uarm": Link(4.386, (0, 0.065, 0), (0.00656, 0.00358, 0.00656)),
    "larm": Link(3.248, (0, 0, 0), (0.00265, 0.00446, 0.00446)),
    "ufarm": Link(2.4798, (0.00015, 0.08296, 0.00037), (0.012731, 0.002857, 0.011948)),
    "lfarm": Link(0.648, (0.00017, -0.02515, 0.00163), (7.64e-4, 4.29e-4, 8.25e-4)),
    "hand": Link(0.5839, (0.00016, -0.08159, 0.00002), (3.88e-4, 4.77e-4, 3.79e-4)),
}
X, Y, Z = np.eye(3)
BACK = (
    ("back_bkz", "pelvis", "ltorso", (-0.0125, 0, 0), Z, (-0.663225, 0.663225)),
    ("back_bky", "ltorso", "mtorso", (0, 0, 0.162), Y, (-0.219388, 0.538783)),
    ("back_bkx", "mtorso", "utorso", (0, 0, 0.05), X, (-0.523599, 0.523599)),
    ("neck_ay", "utorso", "head", (0.2546, 0, 0.6215), Y, (-0.602139, 1.14319)),
)
# of the left leg: joint, parent, child, point, axis, stops
LEG_JOINTS = (
    ("leg_hpz", "pelvis", "uglut", (0, 0.089, 0), Z, (-0.174358, 0.786794)),
    ("leg_hpx", "uglut", "lglut", (0, 0, 0), X, (-0.523599, 0.523599)),
    ("leg_hpy", "lglut", "uleg", (0.05, 0.0225, -0.066), Y, (-1.61234, 0.65764)),
    ("leg_kny", "uleg", "lleg", (-0.05, 0, -0.374), Y, (0.0, 2.35637)),
    ("leg_aky", "lleg", "talus", (0, 0, -0.422), Y, (-1.0, 0.7)),
    ("leg_akx", "talus", "foot", (0, 0, 0), X, (-0.8, 0.8)),
)
# of the right arm: the same; then turn of the frame, axis and stops of the left one
ARM_JOINTS = (
    (
        "arm_shz",
        "utorso",
        "clav",
        (0.1406, -0.2256, 0.4776),
        Z,
        (-0.785398, 1.5708),
        (0, 0, pi),
        Z,
        (-1.5708, 0.785398),
    ),
    ("arm_shx", "clav", "scap", (0, -0.11, -0.245), X, (-1.5708, 1.5708), (0, 0, 0), -X, (-1.5708, 1.5708)),
    ("arm_ely", "scap", "uarm", (0, -0.187, -0.016), Y, (0.0, 3.14159), (0, 0, 0), -Y, (0.0, 3.14159)),
    ("arm_elx", "uarm", "larm", (0, -0.119, 0.0092), X, (-2.35619, 0.0), (0, 0, 0), -X, (0.0, 2.35619)),
    ("arm_uwy", "larm", "ufarm", (0, -0.29955, -0.00921), Y, (-3.011, 3.011), (0, pi, 0), -Y, (-3.011, 3.011)),
    ("arm_mwx", "ufarm", "lfarm", (0, 0, 0), X, (-1.7628, 1.7628), (0, 0, 0), X, (-1.7628, 1.7628)),
    ("arm_lwy", "lfarm", "hand", (0, 0, 0), Y, (-2.9671, 2.9671), (0, pi, 0), -Y, (-2.9671, 2.9671)),
)
SOLE = ((-0.08, -0.04), (0.12, -0.02), (-0.08, 0.04), (0.12, 0.02))  # x, y from the foot's centre of mass [m]
SOLE_HEIGHT, SOLE_RADIUS = 0.015, 0.025  # [m]


@checked_numbers("models")
def atlas(
    *,
    spring: float = 0.0,
    damper: float = 0.1,
    limits: bool = True,
    arms: bool = True,
    crouch: float = 0.2,
    friction: float = 0.8,
    law: str = "nonlinear",
    contacts: str = "feet",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Thirty-one links and thirty hinges, 174 kg; it stands on four balls under each foot.

        q  (37,) position of the pelvis' frame [m], its quaternion; back_bkz, bky, bkx, neck_ay; then left and right:
           leg_hpz, hpx, hpy, kny, aky, akx; then, with arms, left and right: arm_shz, shx, ely, elx, uwy, mwx, lwy;
           all hinges in rad
        u  (30,) torques of the hinges in the same order [N m]

    Masses, inertias, dimensions and stops are those of the public model atlas_v5 (Open Source Robotics Foundation, for
    the DARPA Robotics Challenge). The contacts are those of Dojo.

    Args:
        spring: spring constant of the hinges [N m/rad], with its rest at zero.
        damper: damper of the hinges [N m s/rad].
        limits: whether the hinges have stops, 60 bounds.
        arms: whether the robot has arms; 17 links and 16 hinges without.
        crouch: half the bend of the knees in the neutral state [rad], at least 0.
        friction: coefficient of friction of the contacts.
        law: contact law, see `dojo.Contact`.
        contacts: "feet", eight balls under the soles, or "all", also a ball on every other link: it then lies on
            the ground when it falls.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands with bent knees.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    checks.number("atlas(crouch=...)", crouch, at_least=0.0)
    checks.one_of("atlas(contacts=...)", contacts, ("feet", "all"))
    links = dict(TRUNK)
    mounts = [Mount(child, parent, at, axis, stops, name=name) for name, parent, child, at, axis, stops in BACK]
    for side, s in (("l", 1.0), ("r", -1.0)):
        links |= {f"{side}_{part}": _mirrored(link, s) for part, link in LEG.items()}
        mounts += [_leg_mount(side, s, row) for row in LEG_JOINTS]
    for side, s in (("l", 1.0), ("r", -1.0)) if arms else ():
        links |= {f"{side}_{part}": link for part, link in ARM.items()}
        mounts += [_arm_mount(side, s, row) for row in ARM_JOINTS]
    made = joints(links, mounts, spring=spring, damper=damper, limits=limits)
    touching = _soles(links, friction=friction, law=law)
    if contacts == "all":
        touching = padded(links, touching, friction=friction, law=law)
    base = Joint("floating", None, "pelvis", name="base", child_point=-np.asarray(TRUNK["pelvis"].com))
    bend = {"leg_hpy": -crouch, "leg_kny": 2 * crouch, "leg_aky": -crouch}
    bend |= {"arm_ely": 0.1, "arm_elx": 0.1} if arms else {}
    neutral = {f"{side}_{name}": angle for side in "lr" for name, angle in bend.items()}
    if arms:
        neutral["r_arm_elx"] = -0.1
    inputs = [Input(j.name) for j in made]
    mech = Mechanism(bodies(links), [base, *made], touching, inputs, gravity=gravity, name="atlas", neutral=neutral)
    return grounded(mech, 2)


def _soles(links: Mapping[str, Link], *, friction: float, law: str) -> list[Contact]:
    """Four balls under each foot, at the same places under both."""
    com = np.asarray(links["l_foot"].com)
    places = [com + (x, y, SOLE_HEIGHT) for x, y in SOLE]
    return [
        touch(links, f"{side}_foot", place, SOLE_RADIUS, f"{side}_sole_{k}", friction=friction, law=law)
        for side in "lr"
        for k, place in enumerate(places)
    ]


def _mirrored(link: Link, s: float) -> Link:
    """The link of the other side for s = -1."""
    J = link.matrix * np.outer((1, s, 1), (1, s, 1))
    return Link(link.mass, np.asarray(link.com) * (1, s, 1), J.ravel(), link.shape)


def _leg_mount(side: str, s: float, row: tuple[Any, ...]) -> Mount:
    """Hinge of a leg: those about x and z have mirrored stops on the right."""
    name, parent, child, at, axis, (low, high) = row
    stops = (low, high) if s > 0 or axis is Y else (-high, -low)
    mother = parent if parent in TRUNK else f"{side}_{parent}"
    return Mount(f"{side}_{child}", mother, np.asarray(at) * (1, s, 1), axis, stops, name=f"{side}_{name}")


def _arm_mount(side: str, s: float, row: tuple[Any, ...]) -> Mount:
    """Hinge of an arm; at the shoulder the left one is the mirror image."""
    name, parent, child, at, axis, stops, turn, left_axis, left_stops = row
    mother = parent if parent in TRUNK else f"{side}_{parent}"
    if s < 0:
        return Mount(f"{side}_{child}", mother, at, axis, stops, name=f"{side}_{name}")
    point = np.asarray(at) * ((1, -1, 1) if parent in TRUNK else (1, 1, 1))
    return Mount(f"{side}_{child}", mother, point, left_axis, left_stops, turn, name=f"{side}_{name}")
