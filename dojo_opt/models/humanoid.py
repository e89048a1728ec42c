"""A humanoid of thirteen links, after the one of OpenAI's gym."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.links import Link, Mount, bodies, from_z, grounded, joints, padded, touch
from sim.mechanism import checks
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Capsule, Shape

FOOT_RADIUS = 0.027  # [m]
HEEL, TOE = np.array([-0.07, -0.01, 0.0]), np.array([0.14, -0.03, 0.0])  # of the right foot [m]
AXIS = 1.0 / 3.0**0.5
_X = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
_Y = (0.5**0.5, 0.5**0.5, 0.0, 0.0)


def _side(s: float) -> dict[str, Link]:
    """Leg and arm of one side: s = 1 right, -1 left."""
    side = "right" if s > 0 else "left"
    arm = Capsule(0.04, 0.277, orientation=_along(1.0, -s, -1.0))
    # the published centre of mass of the lower arm is at the elbow
    forearm = Capsule(0.031, 0.277, center=(0.09, 0.09 * s, 0.09), orientation=_along(1.0, s, 1.0))
    return {
        f"{side}_thigh": Link(4.75175, (0, 0.005 * s, -0.17), (0.09212, 0.09076, 0.01276), Capsule(0.06, 0.34)),
        f"{side}_shin": Link(2.7557, (0, 0, -0.15), (0.03858, 0.03858, 0.00441), Capsule(0.049, 0.3)),
        f"{side}_foot": Link(
            1.13114, (0.035, 0.01 * s, 0), (0.00177, 0.00716, 0.00828), Capsule(0.027, 0.211, orientation=_X)
        ),
        f"{side}_upper_arm": Link(1.66108, (0.08, -0.08 * s, -0.08), (0.02368, 0.02368, 0.02267), arm),
        f"{side}_lower_arm": Link(1.22954, (0, 0, 0), (0.01419, 0.01419, 0.01374), forearm),
    }


def _along(x: float, y: float, z: float) -> tuple[float, ...]:
    """Orientation of a capsule along a direction."""
    return from_z(np.array([x, y, z]) / np.linalg.norm([x, y, z]))


def _trunk() -> dict[str, Link]:
    """Torso, waist, pelvis."""
    lying: dict[str, Shape] = {
        "torso": Capsule(0.07, 0.14, center=(0.01, 0.0, 0.12), orientation=_Y),
        "lwaist": Capsule(0.06, 0.12, orientation=_Y),
        "pelvis": Capsule(0.09, 0.14, orientation=_Y),
    }
    return {
        "torso": Link(8.90746, (-0.01, 0, -0.12), (0.21526, 0.18112, 0.08225), lying["torso"]),
        "lwaist": Link(2.26195, (0, 0, 0), (0.01357, 0.00543, 0.01357), lying["lwaist"]),
        "pelvis": Link(6.61619, (-0.02, 0, 0), (0.07432, 0.03573, 0.07432), lying["pelvis"]),
    }


def _mounts() -> list[Mount]:
    """Joints: the abdomen and the shoulders have two rotations, the hips three."""
    tilt = (0.0, -0.004, 0.0)
    out = [
        Mount("lwaist", "torso", (-0.01026, 0, -0.255), (1, 0, 0), turn=tilt, kind="orbital", name="abdomen_yz"),
        Mount("pelvis", "lwaist", (-0.0004, 0, -0.165), (1, 0, 0), turn=tilt, name="abdomen_x"),
    ]
    for side, s in (("right", 1.0), ("left", -1.0)):
        thigh, shin, arm = f"{side}_thigh", f"{side}_shin", f"{side}_upper_arm"
        out += [
            Mount(thigh, "pelvis", (0, -0.1 * s, -0.04), (s, 0, 0), kind="spherical", name=f"{side}_hip"),
            Mount(shin, thigh, (0, 0.01 * s, -0.403), (0, -1, 0), name=f"{side}_knee"),
            Mount(f"{side}_foot", shin, (0, 0, -0.43), (-0.44721, 0, 0.89442), name=f"{side}_ankle"),
        ]
        across = (-AXIS * s, AXIS, AXIS * s)
        out += [
            Mount(arm, "torso", (0, -0.17 * s, 0.06), across, kind="orbital", name=f"{side}_shoulder"),
            Mount(f"{side}_lower_arm", arm, (0.18, -0.18 * s, -0.18), (0, -1, s), name=f"{side}_elbow"),
        ]
    return out


@checked_numbers("models")
def humanoid(
    *,
    spring: float = 0.0,
    damper: float = 1.0,
    friction: float = 0.8,
    law: str = "nonlinear",
    contacts: str = "feet",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Thirteen links, 40.84 kg; it stands with the capsules of its feet on the ground z = 0.

        q  (28,) position of the torso's frame [m], its quaternion; abdomen_yz (2), abdomen_x; then for right, left: hip
           (quaternion), knee, ankle, shoulder (2), elbow [rad]
        u  (19,) torques in the same order [N m]: 2, 1, then 3, 1, 1, 2, 1 for each side

    Joints written with (2) are orbital: their coordinates are the rotation vector across their axis, see
    sim/dynamics/joints/swing.py. Masses, inertias and dimensions are those of the model in Dojo, after gym's.

    Args:
        spring: spring constant of all joints [N m/rad], with its rest at zero.
        damper: damper of all joints [N m s/rad].
        friction: coefficient of friction of the contacts.
        law: contact law, see `dojo.Contact`.
        contacts: "feet", four balls, a heel and a toe per foot, or "all", also a ball on every other link: it then lies
            on the ground when it falls.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands at angles of zero.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    links = {**_trunk(), **_side(1.0), **_side(-1.0)}
    made = joints(links, _mounts(), spring=spring, damper=damper)
    checks.one_of("humanoid(contacts=...)", contacts, ("feet", "all"))
    touching = [
        touch(links, f"{side}_foot", point * (1, s, 1), FOOT_RADIUS, f"{side}_{end}", friction=friction, law=law)
        for side, s in (("right", 1.0), ("left", -1.0))
        for end, point in (("heel", HEEL), ("toe", TOE))
    ]
    if contacts == "all":
        touching = padded(links, touching, friction=friction, law=law)
    base = Joint("floating", None, "torso", name="base", child_point=-np.asarray(links["torso"].com))
    inputs = [Input(j.name, dof=d) for j in made for d in range(j.nv)]
    mech = Mechanism(bodies(links), [base, *made], touching, inputs, gravity=gravity, name="humanoid")
    return grounded(mech, 2)
