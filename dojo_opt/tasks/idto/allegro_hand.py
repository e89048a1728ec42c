"""The Allegro hand, palm up, and a ball."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pose import quat_product
from sim.mechanism.shapes import Box, Sphere, rotation_matrix

__all__ = ["JOINTS", "STIFFNESS", "Angles", "mechanism"]

Angles = Mapping[str, Sequence[float]]  # of the four joints of each finger [rad]

JOINTS, STIFFNESS = 16, 0.5  # of the fingers; of their servos [N m/rad]
STOPS = False
_DAMPER = 1e-3  # of the servos [N m s/rad]
_EFFORT = 0.7  # [N m]
_REACH = 0.02  # [m] of contacts in plans, of which those further away would cost most of the time
_PALM = 0.18  # friction of palm and ball; plans that assume 1, as the publication's do, let the ball slide off
_NAMES = "outer", "thumb", "middle", "inner"
_UP = np.array([0.5**0.5, 0.0, -(0.5**0.5), 0.0])  # the palm, whose fingers point along -x
_BALL = 0.05, 0.06, (-0.06, 0.0, 0.0712)  # [kg], [m], place [m]
_RANGES = ((-0.47, 0.47), (-0.196, 1.61), (-0.174, 1.709), (-0.227, 1.618))
_THUMB_RANGES = ((0.263, 1.396), (-0.105, 2.163), (-0.189, 1.644), (-0.162, 1.719))


def _finger(name: str, side: float, limits: bool) -> list[FileLink]:
    """The links of a finger; side: 1 for the outer, -1 for the inner one, 0 in the middle."""
    base = (0.0, side * 0.0435, 0.0957 if side == 0.0 else 0.093458)
    half = np.radians(-2.5 * side)
    turn, place = (np.cos(half), np.sin(half), 0.0, 0.0), rotation_matrix(_UP) @ np.asarray(base)
    first = (1.954e-6, 1.179e-6, 1.497e-6, 3.034e-9, 8.923e-8, -3.707e-8)
    second = (7.192e-5, 7.438e-5, 5.406e-6, 0.0, 0.0, 7.322e-7)
    third = (3.169e-5, 3.105e-5, 3.203e-6, 1.071e-9, -4.913e-9, 3.875e-8)
    last = (1.263e-5, 1.182e-5, 2.484e-6, 2.1e-9, -9.8e-9, -1.3e-8)
    zero, y = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    links = [
        FileLink(
            f"{name}_0", None, 0.0119, zero, first, pos=place, quat=quat_product(_UP, turn), axis=(0.0, 0.0, -1.0)
        ),
        FileLink(f"{name}_1", f"{name}_0", 0.065, zero, second, pos=(0.0, 0.0, 0.0164), axis=y),
        FileLink(f"{name}_2", f"{name}_1", 0.0355, zero, third, pos=(0.0, 0.0, 0.054), axis=y),
        FileLink(f"{name}_3", f"{name}_2", 0.0264, zero, last, pos=(0.0, 0.0, 0.0384), axis=y),
    ]
    return [link._replace(damping=0.015, limits=r if limits else None) for link, r in zip(links, _RANGES, strict=True)]


def _thumb(limits: bool) -> list[FileLink]:
    """The links of the thumb."""
    place = rotation_matrix(_UP) @ np.array([-0.0182, -0.019333, 0.049013])
    turn = (0.477714638, 0.521333448, -0.521334096, 0.477714267)
    first = (8.139e-6, 1.314e-5, 1.002e-5, 2.552e-6, 3.899e-6, -1.463e-6)
    second = (1.926e-6, 1.153e-6, 1.496e-6, 3.05e-9, 8.866e-8, -3.645e-8)
    third = (3.67e-5, 3.54e-5, 3.633e-6, 1e-9, 1.485e-7, -3.7e-8)
    last = (7.054e-5, 6.564e-5, 1.954e-5, 0.0, 0.0, -3.3e-8)
    zero, y = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    links = [
        FileLink("thumb_0", None, 0.0176, zero, first, pos=place, quat=quat_product(_UP, turn), axis=(1.0, 0.0, 0.0)),
        FileLink("thumb_1", "thumb_0", 0.0119, zero, second, pos=(-0.027, -0.005, 0.0399), axis=(0.0, 0.0, -1.0)),
        FileLink("thumb_2", "thumb_1", 0.038, zero, third, pos=(0.0, 0.0, 0.0177), axis=y),
        FileLink("thumb_3", "thumb_2", 0.0556, (0.0, 0.0, 0.012781), last, pos=(0.0, 0.0, 0.0514), axis=y),
    ]
    ranges = zip(links, _THUMB_RANGES, strict=True)
    return [link._replace(damping=0.015, limits=r if limits else None) for link, r in ranges]


_SPHERES: dict[str, tuple[tuple[int, float, float], ...]] = {  # of a link: number, height [m], radius [m]
    "finger": ((0, 0.0082, 0.015), (1, 0.027, 0.015), (2, 0.0192, 0.015), (3, 0.01335, 0.015), (3, 0.0267, 0.012)),
    "thumb": ((2, 0.0257, 0.015), (3, 0.02115, 0.015), (3, 0.0423, 0.012)),
}


def mechanism(
    friction: float, opened: Angles, gravity: float = -9.81, servos: bool = False, stops: bool = True
) -> Mechanism:
    """The left hand, its palm up and fixed, and the ball: 20 pairs of the hand and the ball, and no others.

        q  (23,) outer finger, thumb, middle and inner finger [rad], ball

    Args:
        friction: coefficient of friction of fingers and ball.
        opened: joints about the ball, without contact.
        gravity: acceleration along z [m/s^2] (default -9.81); with a positive one the hand is upside down.
        servos: whether it is the model of the controller, whose joints have servos (default False).
        stops: whether the joints have stops (default True).

    Returns:
        The mechanism, its fingers about the ball.
    """
    fingers = {"outer": 1.0, "middle": 0.0, "inner": -1.0}
    links = [
        link for part in _NAMES for link in (_thumb(stops) if part == "thumb" else _finger(part, fingers[part], stops))
    ]
    bodies, joints = assembled(links)
    if servos:
        joints = [replace(joint, spring=STIFFNESS, damper=0.015 + _DAMPER) for joint in joints]
    mass, radius, place = _BALL
    ball = Sphere(radius)
    pairs = [("thumb_0", (-0.0179, 0.009, 0.0145), 0.015)]
    for part in _NAMES:
        spheres = _SPHERES["thumb" if part == "thumb" else "finger"]
        pairs += [(f"{part}_{k}", (0.0, 0.0, height), size) for k, height, size in spheres]
    collisions = [
        Collision(
            "ball",
            link,
            ball,
            Sphere(size, center=from_com(links, link, point)),
            friction=friction,
            name=f"{link}:{k}",
            reach=_REACH if servos else None,
        )
        for k, (link, point, size) in enumerate(pairs)
    ]
    box = Box(0.0408, 0.113, 0.095, center=rotation_matrix(_UP) @ np.array([-0.0093, 0.0, 0.0475]), orientation=_UP)
    collisions.append(Collision("ball", None, ball, box, friction=_PALM, name="palm"))
    neutral: dict[str, Any] = {f"{part}_{k}": angle for part in _NAMES for k, angle in enumerate(opened[part])}
    neutral["ball"] = (*place, 1.0, 0.0, 0.0, 0.0)
    limits: dict[str, Any] = {} if servos else {"limits": (-_EFFORT, _EFFORT)}
    return Mechanism(
        [*bodies, Body("ball", mass, 0.4 * mass * radius**2 * np.eye(3))],
        [*joints, Joint("floating", None, "ball")],
        [],
        [Input(link.name, **limits) for link in links],
        collisions=collisions,
        name="allegro",
        gravity=(0.0, 0.0, gravity),
        neutral=neutral,
    )
