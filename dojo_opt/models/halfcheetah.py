"""The planar half-cheetah of OpenAI's gym."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.models.hopper import DOWN
from dojo_opt.models.links import Mount, rod
from dojo_opt.models.planar import Ball, planar_robot
from sim.mechanism.mechanism import Mechanism

RADIUS = 0.046  # of all capsules [m]
TORSO_MASS = 6.36031  # with the head [kg]
SPINE, NECK = 1.0, 0.3  # lengths [m]
UP = np.array([sin(0.87), 0.0, cos(0.87)])  # along the neck, torso frame
HEAD = np.array([0.6, 0.0, 0.1]) + 0.5 * NECK * UP  # its upper end [m]
# name: parent, hinge in the parent's frame (x, z) [m], pitch [rad], mass [kg], length [m], stops [rad],
# spring [N m/rad], damper [N m s/rad]
LIMBS = {
    "bthigh": ("torso", (-0.5, 0.0), -0.658, 1.5352, 0.29, (-0.52, 1.05), 240.0, 6.0),
    "bshin": ("bthigh", (0.0, -0.29), 1.7, 1.5809, 0.29, (-0.785, 0.785), 180.0, 4.5),
    "bfoot": ("bshin", (0.0, -0.29), -1.5, 1.069, 0.188, (-0.4, 0.785), 120.0, 3.0),
    "fthigh": ("torso", (0.5, 0.0), 0.52, 1.42558, 0.266, (-1.0, 0.7), 180.0, 4.5),
    "fshin": ("fthigh", (0.0, -0.266), -1.11159, 1.17885, 0.212, (-1.2, 0.87), 120.0, 3.0),
    "ffoot": ("fshin", (0.0, -0.212), -0.1, 0.84986, 0.14, (-0.5, 0.5), 60.0, 1.5),
}


@checked_numbers("models")
def halfcheetah(
    *,
    springs: float = 1.0,
    dampers: float = 1.0,
    base_damper: float = 0.0,
    limits: bool = True,
    friction: float = 0.4,
    law: str = "nonlinear",
    gravity: ArrayLike = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Torso with head, a back leg and a front leg of three links in the plane y = 0.

         ____/     q  (9,) position x, z of the middle of the torso [m], its pitch about y, then bthigh, bshin, bfoot,
        <   \\         fthigh, fshin, ffoot about y [rad]
         <   |     u  (6,) torques of the hinges in the same order [N m]

    Masses, lengths and stops are gym's. The torso's moments of inertia are those of its two capsules (Dojo's, .089,
    .884, 1.018 kg m^2, are those of no rigid body).

    Args:
        springs: factor of gym's springs, 240 to 60 N m/rad.
        dampers: factor of gym's dampers, 6 to 1.5 N m s/rad.
        base_damper: damper of the torso's motion along x, z [N s/m] and about y [N m s/rad].
        limits: whether the hinges have stops.
        friction: coefficient of friction of the nine contacts.
        law: contact law, see `dojo.Contact`.
        gravity: (3,) acceleration of gravity [m/s^2].

    Returns:
        The mechanism. Its neutral state stands at angles of zero, the lowest contact on the ground.

    Raises:
        ValueError: for an argument out of range; the message names the part.
    """
    # torso and head: masses of capsules go with their length plus a radius, as in the limbs
    share = (NECK + RADIUS) / (SPINE + NECK + 2 * RADIUS)
    spine = rod((1.0 - share) * TORSO_MASS, SPINE, RADIUS, (-SPINE / 2, 0.0, 0.0), (1.0, 0.0, 0.0))
    links = {"torso": spine.welded((rod(share * TORSO_MASS, NECK, RADIUS, HEAD, -UP), (0.0, 0.0, 0.0)))}
    mounts, ends = [], []
    for name, (parent, (x, z), pitch, mass, length, stops, _, _) in LIMBS.items():
        links[name] = rod(mass, length, RADIUS, (0.0, 0.0, 0.0), DOWN)
        mounts.append(Mount(name, parent, (x, 0.0, z), (0.0, 1.0, 0.0), stops, (0.0, pitch, 0.0)))
        ends.append((f"{name}_end", name, (0.0, 0.0, -length), RADIUS))
    balls: list[Ball] = [
        *ends,
        ("rear", "torso", (-0.5, 0.0, 0.0), RADIUS),
        ("front", "torso", (0.5, 0.0, 0.0), RADIUS),
        ("head", "torso", HEAD, RADIUS),
    ]
    return planar_robot(
        "halfcheetah",
        links,
        mounts,
        balls,
        springs={name: springs * spring for name, (*_, spring, _) in LIMBS.items()},
        dampers={name: dampers * damper for name, (*_, damper) in LIMBS.items()},
        base_damper=base_damper,
        limits=limits,
        friction=friction,
        law=law,
        gravity=gravity,
    )
