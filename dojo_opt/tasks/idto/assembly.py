"""Links as robot files give them, with frames at their joints, made into bodies and joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from solvers.types import Vector

__all__ = ["FileLink", "assembled", "from_com"]


class FileLink(NamedTuple):
    """A link with the joint that it hangs on.

    Attributes:
        name: name of the link, and of its joint.
        parent: name of the parent; None for the world.
        mass: mass [kg].
        com: (3,) centre of mass, link axes [m].
        inertia: (3,) moments, or (6,) xx yy zz xy xz yz, about the centre of mass, link axes [kg m^2].
        kind: kind of the joint.
        pos: (3,) origin of the link in the frame of the parent [m].
        quat: (4,) turn of the link at zero.
        axis: (3,) axis of the joint, link axes.
        damping: damper [N m s/rad].
        limits: bounds of the coordinate [rad, m]; None for none.
    """

    name: str
    parent: str | None
    mass: float
    com: ArrayLike
    inertia: Sequence[float]
    kind: str = "revolute"
    pos: ArrayLike = (0.0, 0.0, 0.0)
    quat: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    damping: float = 0.0
    limits: tuple[float, float] | None = None


def assembled(links: Sequence[FileLink]) -> tuple[list[Body], list[Joint]]:
    """Bodies and joints of a tree of links.

    Args:
        links: the links, parents first.

    Returns:
        (bodies, joints), in the same order.
    """
    by_name = {link.name: link for link in links}
    bodies, joints = [], []
    for link in links:
        xx, yy, zz, xy, xz, yz = (*link.inertia, 0.0, 0.0, 0.0)[:6]
        bodies.append(Body(link.name, link.mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])))
        com = np.asarray(link.com)
        before = np.zeros(3) if link.parent is None else np.asarray(by_name[link.parent].com)
        joints.append(
            Joint(
                link.kind,
                link.parent,
                link.name,
                parent_point=np.asarray(link.pos) - before,
                child_point=-com,
                axis=link.axis,
                orientation=np.asarray(link.quat) / np.linalg.norm(np.asarray(link.quat)),
                damper=link.damping,
                limits=link.limits,
            )
        )
    return bodies, joints


def from_com(links: Sequence[FileLink], name: str, point: Sequence[float]) -> Vector:
    """A point of a link from its centre of mass.

    Args:
        links: the links.
        name: name of the link.
        point: (3,) point in the frame of the link [m].

    Returns:
        (3,) the same point from the centre of mass [m].
    """
    com = next(link.com for link in links if link.name == name)
    return np.asarray(point, dtype=np.float64) - np.asarray(com)
