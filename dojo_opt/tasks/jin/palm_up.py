"""The right Allegro hand, palm up and fixed, as the publication has it, and an object on it."""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.residual import jit
from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from dojo_opt.tasks.jin.palm_objects import PalmObject
from sim.mechanism.collision import Collision
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Capsule, Cylinder, Solid, Sphere, rotation_matrix
from solvers.rotation import quat_mul
from solvers.types import Vector

__all__ = ["FINGERS", "JOINTS", "NAMES", "TORQUE", "links", "mechanism", "place_of_tip"]

FINGERS, JOINTS = 4, 4  # of the hand; of a finger
TORQUE = 0.2  # [N m] a servo of 1 N m/rad, whose target is up to .2 rad ahead
NAMES = "first", "middle", "ring", "thumb"
_UP = (0.0, 0.5**0.5, 0.0, 0.5**0.5)  # quaternion of the palm
_TILT = 0.08726646259971647  # [rad] of the outer fingers against the middle one
_SIDE, _OUTER, _MIDDLE = 0.0435, -0.001542, 0.0007  # [m] places of fingers on the palm
_THUMB, _THUMB_TURN = (-0.0182, 0.019333, -0.045987), (0.4777141, -0.5213341, -0.5213341, -0.4777141)
_DAMPER = 0.1  # [N m s/rad]
_FINGER, _PALM = 1.0, 0.5  # friction with an object
_REACH = 0.01  # [m] of contacts in plans: with twice that a tick takes a third longer
_RANGES = ((-0.47, 0.47), (-0.196, 1.61), (-0.174, 1.709), (-0.227, 1.618))  # [rad]
_THUMB_RANGES = ((0.263, 1.396), (-0.105, 2.163), (-0.189, 1.644), (-0.162, 1.719))
_START = (
    *((0.125, 1.13, 1.45, 1.24), (-0.02, 0.445, 1.17, 1.5)),
    *((-0.459, 1.54, 1.11, 1.23), (0.638, 1.85, 1.5, 1.26)),
)
# of a link: number, place in its frame, radius; and capsules at the tips: middle and length
_SPHERES: dict[str, tuple[tuple[int, tuple[float, float, float], float], ...]] = {
    "finger": (
        (0, (0.0, 0.0, 0.0082), 0.0098),
        (1, (0.0, 0.0, 0.015), 0.012),
        (1, (0.0, 0.0, 0.04), 0.012),
        (2, (0.0, 0.0, 0.0192), 0.012),
        (3, (0.0, 0.0, 0.008), 0.012),
    ),
    "thumb": (
        (0, (-0.0179, 0.009, 0.0145), 0.0165),
        (2, (0.0, 0.0, 0.0257), 0.012),
        (3, (0.0, 0.0, 0.0157), 0.012),
    ),
}
_TIPS = {"finger": (0.019, 0.02), "thumb": (0.035, 0.016)}  # [m]
_TIP_RADIUS = 0.012  # [m]
# of a capsule in plans against boxes and cylinders: a capsule has up to 11 points with a cylinder, a ball has one; an
# edge reaches 1.1 mm deeper between three balls than into the capsule
_TIP_BALLS = 3


def _finger(name: str, side: float) -> list[FileLink]:
    """The links of a finger; side: 1 for the first, -1 for the ring finger, 0 for the middle one."""
    half = -0.5 * side * _TILT
    place = rotation_matrix(_UP) @ np.array([0.0, side * _SIDE, _OUTER if side else _MIDDLE])
    turn = np.array(quat_mul(*_UP, np.cos(half), np.sin(half), 0.0, 0.0))
    first = (7.477e-7, 3.55e-7, 7.065e-7, 7.8e-11, 3.224e-8, -8.8e-10)
    second = (1.186e-5, 1.128e-5, 2.266e-6, 0.0, 0.0, 0.0)
    third = (4.285e-6, 3.636e-6, 1.676e-6, 1.8e-10, -7.275e-8, -1.14e-9)
    last = (2.418e-6, 2.015e-6, 1.193e-6, 8.1e-11, -6.137e-8, -2.2e-10)
    y = (0.0, 1.0, 0.0)
    return [
        FileLink(f"{name}_0", None, 0.007232, (-0.000778, -1e-5, 0.008282), first, pos=place, quat=turn),
        FileLink(f"{name}_1", f"{name}_0", 0.027276, (0.0, -9.1e-5, 0.027), second, pos=(0.0, 0.0, 0.0164), axis=y),
        FileLink(
            f"{name}_2", f"{name}_1", 0.018464, (-0.000193, -7.8e-5, 0.022586), third, pos=(0.0, 0.0, 0.054), axis=y
        ),
        FileLink(
            f"{name}_3", f"{name}_2", 0.014357, (-0.000273, -2e-6, 0.015905), last, pos=(0.0, 0.0, 0.0384), axis=y
        ),
    ]


def _thumb() -> list[FileLink]:
    """The links of the thumb."""
    place = rotation_matrix(_UP) @ np.array(_THUMB)
    turn = np.array(quat_mul(*_UP, *_THUMB_TURN))
    first = (9.166e-6, 1.064e-5, 7.217e-6, -1.808e-8, 6.86e-9, 6.185e-7)
    second = (7.46e-7, 3.539e-7, 7.052e-7, 7.5e-11, 3.227e-8, -8.7e-10)
    third = (7.526e-6, 6.583e-6, 2.143e-6, 2.1e-10, 9.655e-8, 2.8e-10)
    last = (7.132e-6, 6.808e-6, 1.806e-6, 0.0, 0.0, 5.31e-9)
    com, y = (-0.017915, 0.008024, 0.012314), (0.0, 1.0, 0.0)
    return [
        FileLink("thumb_0", None, 0.038258, com, first, pos=place, quat=turn, axis=(-1.0, 0.0, 0.0)),
        FileLink("thumb_1", "thumb_0", 0.0072193, (-0.000782, -1e-5, 0.008105), second, pos=(-0.027, 0.005, 0.0399)),
        FileLink("thumb_2", "thumb_1", 0.022496, (-0.000164, 1.7e-5, 0.021112), third, pos=(0.0, 0.0, 0.0177), axis=y),
        FileLink("thumb_3", "thumb_2", 0.023179, (0.0, 3e-6, 0.021322), last, pos=(0.0, 0.0, 0.0514), axis=y),
    ]


def links() -> list[FileLink]:
    """All links of the hand.

    Returns:
        The links, finger by finger, with their dampers and stops.
    """
    out: list[FileLink] = []
    for name, side in zip(NAMES, (1.0, 0.0, -1.0, None), strict=True):
        part, ranges = (_thumb(), _THUMB_RANGES) if side is None else (_finger(name, side), _RANGES)
        out += [link._replace(damping=_DAMPER, limits=r) for link, r in zip(part, ranges, strict=True)]
    return out


def _tips(center: Vector, length: float, balls: int) -> list[Solid]:
    """A capsule along z, or so many balls in a row from one of its ends to the other."""
    if balls == 0:
        return [Capsule(_TIP_RADIUS, length, center=center)]
    return [Sphere(_TIP_RADIUS, center=center + [0.0, 0.0, z]) for z in np.linspace(-0.5, 0.5, balls) * length]


def mechanism(item: str, thing: PalmObject, planned: bool = False) -> Mechanism:
    """An object, and the hand below it: their pairs, and no others.

        q  (23,) pose of the object, four joints of first, middle and ring finger and of the thumb [rad]

    Args:
        item: name of the object.
        thing: the object.
        planned: whether it is the model of the controller, whose inputs are bounded, whose contacts reach 1 cm, whose
            object has a simpler shape, if there is one, and whose fingertips are rows of balls where that is a box or a
            cylinder (default False).

    Returns:
        The mechanism.
    """
    own = links()
    shape = thing.simple or thing.shape if planned else thing.shape
    below = thing.below or shape if planned else shape
    bodies, joints = assembled(own)
    reach, limit = (_REACH, TORQUE) if planned else (None, np.inf)
    rows = _TIP_BALLS if planned and isinstance(shape, Box | Cylinder) else 0
    parts: list[tuple[str | None, Solid, float, str]] = []
    for name in NAMES:
        kind = "thumb" if name == "thumb" else "finger"
        for number, (k, point, size) in enumerate(_SPHERES[kind]):
            link = f"{name}_{k}"
            parts.append((link, Sphere(size, center=from_com(own, link, point)), _FINGER, f"{name}:{number}"))
        middle, length = _TIPS[kind]
        center = from_com(own, f"{name}_3", (0.0, 0.0, middle))
        parts += [(f"{name}_3", tip, _FINGER, f"{name}:tip{k}") for k, tip in enumerate(_tips(center, length, rows))]
    at = rotation_matrix(_UP) @ np.array([-0.0093, 0.0, -0.0475])
    parts.append((None, Box(0.0408, 0.113, 0.095, center=at, orientation=_UP), max(_PALM, thing.friction), "palm"))
    collisions = [
        Collision(item, link, below if name == "palm" else shape, other, friction=grip, name=name, reach=reach)
        for link, other, grip, name in parts
    ]
    neutral: dict[str, Any] = {
        f"{name}_{k}": angle for name, row in zip(NAMES, _START, strict=True) for k, angle in enumerate(row)
    }
    neutral[item] = (0.0, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0)
    return Mechanism(
        [thing.body(item), *bodies],
        [Joint("floating", None, item), *joints],
        [],
        [Input(link.name, limits=(-limit, limit)) for link in own],
        collisions=collisions,
        name=f"allegro and {item}",
        neutral=neutral,
    )


def _unit(quat: ArrayLike) -> Vector:
    """The quaternion (4,) with norm 1."""
    return np.asarray(quat, dtype=np.float64) / np.linalg.norm(np.asarray(quat))


_BASES = [link for link in links() if link.parent is None]
_BASE_PLACE = np.array([np.asarray(link.pos) for link in _BASES])
_BASE_TURN = np.array([rotation_matrix(_unit(link.quat)) for link in _BASES])


@jit
def _finger_tip(x: Any, a: int) -> Any:
    """Tip of a finger whose joints begin at x[a], in the frame of its base, and its derivatives: 5 vectors.

    It turns about z, and bends three times about y.
    """
    b1, b2, b3 = x[a + 1], x[a + 1] + x[a + 2], x[a + 1] + x[a + 2] + x[a + 3]
    s3, c3 = 0.0384 * sin(b3), 0.0384 * cos(b3)
    s2, c2 = s3 + 0.0384 * sin(b2), c3 + 0.0384 * cos(b2)
    s1, c1 = s2 + 0.054 * sin(b1), c2 + 0.054 * cos(b1)
    c, s = cos(x[a]), sin(x[a])
    return (
        (c * s1, s * s1, 0.0164 + c1),
        (-s * s1, c * s1, 0.0),
        (c * c1, s * c1, -s1),
        (c * c2, s * c2, -s2),
        (c * c3, s * c3, -s3),
    )


@jit
def _thumb_tip(x: Any, a: int) -> Any:
    """Likewise of the thumb, which turns about -x and about z, and bends twice about y."""
    b2, b3 = x[a + 2], x[a + 2] + x[a + 3]
    s3, c3 = 0.054 * sin(b3), 0.054 * cos(b3)
    s2, c2 = s3 + 0.0514 * sin(b2), c3 + 0.0514 * cos(b2)
    c, s = cos(x[a + 1]), sin(x[a + 1])
    u, v, w = -0.027 + c * s2, 0.005 + s * s2, 0.0399 + 0.0177 + c2
    e, f = cos(x[a]), -sin(x[a])
    return (
        (u, e * v - f * w, f * v + e * w),
        (0.0, f * v + e * w, -e * v + f * w),
        (-s * s2, e * c * s2, f * c * s2),
        (c * c2, e * s * c2 + f * s2, f * s * c2 - e * s2),
        (c * c3, e * s * c3 + f * s3, f * s * c3 - e * s3),
    )


@jit
def _turned(k: int, i: int, v: Any) -> Any:
    """Component i, in world axes, of a vector in the frame of the base of finger k."""
    R = _BASE_TURN[k]
    return R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]


@jit
def place_of_tip(x: Any, k: int) -> Any:
    """Place of the tip of a finger, and its derivatives by the joints of the finger.

    Args:
        x: (nx,) state.
        k: number of the finger.

    Returns:
        (15,) tuple: place [m], and the derivatives by rows [m/rad].
    """
    a = 7 + JOINTS * k
    at, d0, d1, d2, d3 = _finger_tip(x, a) if k < FINGERS - 1 else _thumb_tip(x, a)
    p = _BASE_PLACE[k]
    return (
        p[0] + _turned(k, 0, at),
        p[1] + _turned(k, 1, at),
        p[2] + _turned(k, 2, at),
        _turned(k, 0, d0),
        _turned(k, 0, d1),
        _turned(k, 0, d2),
        _turned(k, 0, d3),
        _turned(k, 1, d0),
        _turned(k, 1, d1),
        _turned(k, 1, d2),
        _turned(k, 1, d3),
        _turned(k, 2, d0),
        _turned(k, 2, d1),
        _turned(k, 2, d2),
        _turned(k, 2, d3),
    )
