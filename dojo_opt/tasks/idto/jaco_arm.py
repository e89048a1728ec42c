"""The arm of seven joints that rolls, turns and lifts things with the stub at its end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.shapes import Solid, Sphere
from solvers.types import Vector

__all__ = ["JOINTS", "KP", "Arms", "arms"]

JOINTS = 7
KP = np.array([500.0, 500.0, 250.0, 500.0, 250.0, 250.0, 250.0])  # [N m/rad]
_KD = 0.1 * KP  # [N m s/rad]
_HALF = 0.5**0.5
_HEAVY = 1.0  # [kg m^2] of links 4 and 7, as the publication's file has them
_LONG, _THIN = 0.00247074, 0.000380115  # [kg m^2]
_STUB = 0.001 * -0.06 / 0.011  # [m] centre of mass of the last link with its stub
# mass [kg], centre of mass [m] and moments of inertia [kg m^2] of each link; its place and quaternion on the one before
_LINKS = (
    (
        0.7477,
        (0.0, -0.002, -0.0605),
        (0.00152032, 0.00152032, 0.00059816),
        (0.0, 0.0, 0.26675),
        (0.0, -_HALF, _HALF, 0.0),
    ),
    (0.8447, (0.0, -0.103563, 0.0), (_LONG, _THIN, _LONG), (0.0, 0.0016, -0.11875), (0.0, 0.0, -_HALF, _HALF)),
    (0.8447, (0.0, 0.0, -0.102245), (_LONG, _LONG, _THIN), (0.0, -0.205, 0.0), (_HALF, -_HALF, 0.0, 0.0)),
    (0.6763, (0.0, 0.081, -0.0086), (_HEAVY, _HEAVY, _HEAVY), (0.0, 0.0, -0.205), (0.0, 0.0, -_HALF, -_HALF)),
    (
        0.463,
        (0.0, 0.002885, -0.054193),
        (0.000432132, 0.000432132, 9.26e-5),
        (0.0, 0.2073, -0.0114),
        (0.0, 0.0, _HALF, -_HALF),
    ),
    (
        0.463,
        (0.0, 0.049721, -0.002856),
        (0.000432132, 9.26e-5, 0.000432132),
        (0.0, 0.0, -0.10375),
        (0.0, 0.0, -_HALF, -_HALF),
    ),
    (
        0.011,
        (0.0, 0.0, _STUB),
        (_HEAVY + 1.03e-4, _HEAVY + 1.03e-4, _HEAVY + 1e-4),
        (0.0, 0.10375, 0.0),
        (0.0, 0.0, _HALF, -_HALF),
    ),
)
_EFFORT = (40.0, 80.0, 40.0, 40.0, 20.0, 20.0, 20.0)  # [N m]
_SPHERES = (
    ("link_6", (0.0, 0.0, 0.0), 0.048),
    ("link_7", (0.0, 0.0, 0.0), 0.03275),
    ("link_7", (0.0, 0.0, -0.055), 0.03275),
)  # link, centre in its frame [m], radius [m]


class Arms(NamedTuple):
    """Parts of a mechanism: one arm or several.

    Attributes:
        bodies: the links, arm by arm, from the base to the stub.
        joints: the hinges, in the same order.
        inputs: the drives, in the same order.
        spheres: link, centre from its centre of mass [m] and radius [m] of the balls that touch; the stub's is the
            last one of each arm.
    """

    bodies: list[Body]
    joints: list[Joint]
    inputs: list[Input]
    spheres: list[tuple[str, Vector, float]]

    def touching(self, body: str, shape: Solid, friction: float) -> list[Collision]:
        """Pairs of an object with every sphere.

        Args:
            body: name of the object.
            shape: its shape.
            friction: coefficient of friction.

        Returns:
            The collisions, in the order of `spheres`.
        """
        return [
            Collision(body, link, shape, Sphere(size, center=point), friction=friction, name=f"{link}:{k}")
            for k, (link, point, size) in enumerate(self.spheres)
        ]

    def grounded(self, friction: float) -> list[Contact]:
        """Contacts of every sphere with the ground.

        Args:
            friction: coefficient of friction.

        Returns:
            The contacts, in the order of `spheres`.
        """
        return [
            Contact(link, point, size, friction=friction, name=f"{link}:{k} on ground")
            for k, (link, point, size) in enumerate(self.spheres)
        ]


def arms(sides: Mapping[str, float], servos: bool) -> Arms:
    """Arms on bases at (0, y, .11) m that float, with the stub at the end of each welded to its last link.

    Args:
        sides: y [m] of the base by prefix of its names.
        servos: whether the joints have the servos of the controller, and drives without limits.

    Returns:
        Seven links, joints and inputs per arm.
    """
    parts = Arms([], [], [], [])
    for prefix, y in sides.items():
        links = [
            FileLink(
                f"{prefix}link_{k}",
                f"{prefix}link_{k - 1}" if k > 1 else None,
                mass,
                com,
                inertia,
                pos=pos if k > 1 else (pos[0], y, pos[2]),
                quat=quat,
            )
            for k, (mass, com, inertia, pos, quat) in enumerate(_LINKS, 1)
        ]
        bodies, joints = assembled(links)
        parts.bodies.extend(replace(body, gravity_compensation=1.0) for body in bodies)
        gains = zip(joints, KP, _KD, strict=True)
        if servos:
            joints = [replace(joint, spring=float(kp), damper=float(kd)) for joint, kp, kd in gains]
        parts.joints.extend(joints)
        for link, effort in zip(links, _EFFORT, strict=True):
            limit = np.inf if servos else effort
            parts.inputs.append(Input(link.name, limits=(-limit, limit)))
        for name, point, size in _SPHERES:
            parts.spheres.append((f"{prefix}{name}", from_com(links, f"{prefix}{name}", point), size))
    return parts
