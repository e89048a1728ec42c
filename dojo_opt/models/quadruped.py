"""A quadruped with the masses and lengths of Unitree's A1."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Cylinder

# leg: (front or rear, left or right) as signs of x and y
LEGS = {"FR": (1, -1), "FL": (1, 1), "RR": (-1, -1), "RL": (-1, 1)}

# centres of mass [m] in the link frames, masses [kg], inertias (xx, xy, xz, yy, yz, zz) [kg m^2]; legs: FR
TRUNK_COM, TRUNK_MASS = np.array([0.0, 0.0041, -0.0005]), 6.0
TRUNK_INERTIA = (0.0158533, -3.66e-5, -6.11e-5, 0.0377999, -2.75e-5, 0.0456542)
HIP_COM, HIP_MASS = np.array([-0.003311, -0.000635, 3.1e-5]), 0.696
HIP_INERTIA = (4.69246e-4, 9.409e-6, -3.42e-7, 8.0749e-4, 4.66e-7, 5.52929e-4)
THIGH_COM, THIGH_MASS = np.array([-0.003237, 0.022327, -0.027326]), 1.013
THIGH_INERTIA = (5.529065e-3, -4.825e-6, 3.43869e-4, 5.139339e-3, -2.2448e-5, 1.367788e-3)
CALF_COM, CALF_MASS = np.array([0.006435, 0.0, -0.107388]), 0.166
CALF_INERTIA = (2.997972e-3, 0.0, -1.41163e-4, 3.014022e-3, 0.0, 3.2426e-5)
HIP_POINT = np.array([0.183, 0.047, 0.0])  # in the trunk, signs by leg
THIGH_POINT = np.array([0.0, 0.08505, 0.0])  # in the hip
CALF_POINT = np.array([0.0, 0.0, -0.2])  # in the thigh
FOOT, FOOT_RADIUS = np.array([-0.006, 0.0, -0.092]), 0.021  # from the centre of mass of the calf
THIGH_PAD, THIGH_PAD_RADIUS = np.array([-0.005, 0.023, -0.16]), 0.023  # from that of the thigh
HIP_PAD, HIP_PAD_RADIUS = np.array([0.0, 0.05, 0.0]), 0.05  # from that of the hip
LIMITS = {"hip": (-0.5, 0.5), "thigh": (-0.5, 1.5), "calf": (-2.5, -1.0)}
REST = {"hip": 0.0, "thigh": 0.9, "calf": -1.425}


@checked_numbers("models")
def quadruped(
    *,
    damper: float = 0.05,
    spring: float = 0.0,
    friction: float = 0.8,
    law: str = "nonlinear",
    contacts: str = "feet",
    limits: bool = True,
    stance: tuple[float, float] = (pi / 4, -pi / 2),
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Thirteen bodies and twelve hinges; it stands on the ground with its feet under its hips.

        x forward, y left, z up      q  (19,) position of the trunk's centre of mass [m], its quaternion, then for
        legs FR FL RR RL                FR, FL, RR, RL: hip about x, thigh about y, calf about y [rad]
                                     u  (12,) torques of the hinges in the same order [N m]

    The legs are straight down at angles of zero. A positive thigh moves the knee back; the calf is bent at negative
    angles.

    Args:
        damper: damper of every hinge [N m s/rad].
        spring: spring constant of every hinge [N m/rad], with its rest at hip 0, thigh 0.9, calf -1.425 rad.
        friction: coefficient of friction of the contacts.
        law: contact law, see `dojo.Contact`.
        contacts: "feet", 4 balls, or "all", 12: feet, knees and shoulders.
        limits: whether the hinges have stops, 24 bounds.
        stance: (2,) angles of thighs and calves in the neutral state [rad].
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands, its hips straight.

    Raises:
        ValueError: for an unknown choice of contacts, or an argument out of range; the message names the part.
    """
    checks.one_of("quadruped(contacts=...)", contacts, ("feet", "all"))
    thigh, calf = checks.vector("quadruped(stance=...)", stance, 2)
    bodies = [Body("trunk", TRUNK_MASS, _mirrored(TRUNK_INERTIA, 1, 1), Box(0.267, 0.194, 0.114, center=-TRUNK_COM))]
    joints = [Joint("floating", None, "trunk")]
    touches: list[Contact] = []
    for leg, (x, y) in LEGS.items():
        bodies += _leg_bodies(leg, x, y)
        joints += _leg_joints(leg, x, y, spring, damper, limits)
        touches += [c for c in _leg_contacts(leg, y, friction, law) if contacts == "all" or c.name.endswith("foot")]
    height = FOOT_RADIUS - _foot_height(thigh, calf) + TRUNK_COM[2]
    neutral: dict[str, ArrayLike] = {"trunk": (0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0)}
    for leg in LEGS:
        neutral |= {f"{leg}_thigh": thigh, f"{leg}_calf": calf}
    return Mechanism(bodies, joints, touches, gravity=gravity, name="quadruped", neutral=neutral)


def _mirrored(inertia: tuple[float, ...], x: int, y: int) -> np.ndarray:
    """Inertia matrix of the part mirrored in the planes x = 0 (x = -1) and y = 0 (y = -1)."""
    xx, xy, xz, yy, yz, zz = inertia
    return np.array([[xx, x * y * xy, x * xz], [x * y * xy, yy, y * yz], [x * xz, y * yz, zz]])


def _leg_bodies(leg: str, x: int, y: int) -> list[Body]:
    """Hip, thigh and calf; the figures are those of the front right leg, x = 1, y = -1."""
    across = (0.5**0.5, 0.5**0.5, 0.0, 0.0)
    thigh_com = THIGH_COM * (1, -y, 1)
    return [
        Body(
            f"{leg}_hip",
            HIP_MASS,
            _mirrored(HIP_INERTIA, x, -y),
            Cylinder(0.046, 0.04, center=-HIP_COM * (x, -y, 1), orientation=across),
        ),
        Body(
            f"{leg}_thigh",
            THIGH_MASS,
            _mirrored(THIGH_INERTIA, 1, -y),
            Box(0.034, 0.0245, 0.2, center=CALF_POINT / 2 - thigh_com),
        ),
        Body(
            f"{leg}_calf",
            CALF_MASS,
            _mirrored(CALF_INERTIA, 1, 1),
            Box(0.016, 0.016, 0.2, center=CALF_POINT / 2 - CALF_COM),
        ),
    ]


def _leg_joints(leg: str, x: int, y: int, spring: float, damper: float, limits: bool) -> list[Joint]:
    """Hip about x, thigh and calf about y; points from the centres of mass."""
    hip_com, thigh_com = HIP_COM * (x, -y, 1), THIGH_COM * (1, -y, 1)
    hinges = (
        ("hip", "trunk", HIP_POINT * (x, y, 1) - TRUNK_COM, -hip_com, (1.0, 0.0, 0.0)),
        ("thigh", f"{leg}_hip", THIGH_POINT * (1, y, 1) - hip_com, -thigh_com, (0.0, 1.0, 0.0)),
        ("calf", f"{leg}_thigh", CALF_POINT - thigh_com, -CALF_COM, (0.0, 1.0, 0.0)),
    )
    return [
        Joint(
            "revolute",
            parent,
            f"{leg}_{part}",
            parent_point=parent_point,
            child_point=child_point,
            axis=axis,
            spring=spring,
            damper=damper,
            rest=REST[part],
            limits=LIMITS[part] if limits else None,
        )
        for part, parent, parent_point, child_point, axis in hinges
    ]


def _leg_contacts(leg: str, y: int, friction: float, law: str) -> list[Contact]:
    """Balls at the foot, the knee and the hip."""
    return [
        Contact(f"{leg}_calf", FOOT, FOOT_RADIUS, friction=friction, law=law, name=f"{leg}_foot"),
        Contact(
            f"{leg}_thigh", THIGH_PAD * (1, y, 1), THIGH_PAD_RADIUS, friction=friction, law=law, name=f"{leg}_knee"
        ),
        Contact(f"{leg}_hip", HIP_PAD * (1, y, 1), HIP_PAD_RADIUS, friction=friction, law=law, name=f"{leg}_shoulder"),
    ]


def _foot_height(thigh: float, calf: float) -> float:
    """Height of the centre of a foot above the trunk's link frame at the given angles, hip straight [m]."""
    x, _, z = FOOT + CALF_COM
    knee = CALF_POINT[2] * cos(thigh)
    return float(knee - sin(thigh + calf) * x + cos(thigh + calf) * z)
