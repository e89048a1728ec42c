"""Link, Mount: robots as tables of links in their own frames, as makers publish them, and the parts made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from sim.io.urdf.inertia import RigidInertia, combined
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pose import Pose, quaternion, roll_pitch_yaw
from sim.mechanism.shapes import Capsule, Shape
from sim.mechanism.stance import gaps
from solvers.types import Floats

LINK_BYTES = 20_000.0  # of memory, of a link as a part and in the arrays of kernels
_PAD = 0.04  # [m] radius of a ball that stands for a link of 1 kg
_CLEAR = 1e-9  # [m] of the lowest contact over the ground


@dataclass(frozen=True)
class Link:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2] of a link in its own frame, and how it is drawn.

    inertia: (xx, yy, zz), or (xx, xy, xz, yy, yz, zz).
    """

    mass: float
    com: ArrayLike
    inertia: ArrayLike
    shape: Shape | None = None

    @property
    def matrix(self) -> Floats:
        """Inertia (3, 3)."""
        given = np.asarray(self.inertia, dtype=np.float64).ravel()
        if len(given) == 3:
            return np.diag(given)
        xx, xy, xz, yy, yz, zz = given if len(given) == 6 else given[[0, 1, 2, 4, 5, 8]]
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def rigid(self) -> RigidInertia:
        """The link as one rigid inertia."""
        return RigidInertia(self.mass, np.asarray(self.com, dtype=np.float64), self.matrix)

    def welded(self, *others: tuple[Link, ArrayLike]) -> Link:
        """One link out of this one and others, each at a point of this one's frame, axes parallel."""
        parts = [link.rigid().seen_from(Pose(np.eye(3), np.asarray(at, dtype=np.float64))) for link, at in others]
        whole = combined([self.rigid(), *parts])
        shape = None if self.shape is None else _shifted(self.shape, np.asarray(self.com) - whole.com)
        return Link(whole.mass, whole.com, whole.inertia, shape)


@dataclass(frozen=True)
class Mount:
    """The joint that carries a link: at `point` of the parent's frame, turned by roll, pitch and yaw [rad].

    limits: one (lo, hi), or one per degree of freedom.
    """

    child: str
    parent: str | None
    point: ArrayLike = (0.0, 0.0, 0.0)
    axis: ArrayLike = (0.0, 0.0, 1.0)
    limits: tuple[float, float] | None = None
    turn: ArrayLike = (0.0, 0.0, 0.0)
    kind: str = "revolute"
    name: str = ""


def bodies(links: Mapping[str, Link]) -> list[Body]:
    """One body per link."""
    return [Body(name, link.mass, link.matrix, link.shape) for name, link in links.items()]


def joints(
    links: Mapping[str, Link], mounts: Sequence[Mount], *, spring: float = 0.0, damper: float = 0.0, limits: bool = True
) -> list[Joint]:
    """One joint per mount, its points measured from the centres of mass."""
    return [
        Joint(
            m.kind,
            m.parent,
            m.child,
            name=m.name or m.child,
            parent_point=np.asarray(m.point) - (0.0 if m.parent in (None, WORLD) else np.asarray(links[m.parent].com)),
            child_point=-np.asarray(links[m.child].com),
            axis=m.axis,
            orientation=quaternion(roll_pitch_yaw(m.turn)),
            spring=spring,
            damper=damper,
            limits=m.limits if limits else None,
        )
        for m in mounts
    ]


def touch(
    links: Mapping[str, Link], body: str, point: ArrayLike, radius: float, name: str, *, friction: float, law: str
) -> Contact:
    """A ball at a point of a link's own frame."""
    return Contact(body, np.asarray(point) - np.asarray(links[body].com), radius, friction=friction, law=law, name=name)


def rod(mass: float, length: float, radius: float, start: ArrayLike, direction: ArrayLike) -> Link:
    """A uniform capsule whose axis begins at `start` of the link's frame and goes `length` along `direction` [m]."""
    along = np.asarray(direction, dtype=np.float64)
    along = along / np.linalg.norm(along)
    shape = Capsule(radius, length, orientation=from_z(along))
    return Link(mass, np.asarray(start) + 0.5 * length * along, shape.inertia(mass).ravel(), shape)


def from_z(along: ArrayLike) -> tuple[float, ...]:
    """Quaternion of the shortest rotation that takes z to the unit vector `along`."""
    x, y, z = np.asarray(along, dtype=np.float64)
    if z < -1.0 + 1e-12:
        return 0.0, 1.0, 0.0, 0.0
    q = np.array([1.0 + z, -y, x, 0.0])
    return tuple(float(c) for c in q / np.linalg.norm(q))


def grounded(mech: Mechanism, coordinate: int) -> Mechanism:
    """The mechanism with this coordinate of its neutral state, its height, so that the lowest contact just touches."""
    q = np.array(mech.neutral, dtype=np.float64)
    q[coordinate] += _CLEAR - gaps(mech, q).min()
    return replace(mech, neutral=q)


def degrees(low: float, high: float) -> tuple[float, float]:
    """Limits given in degrees [rad]."""
    return low * pi / 180.0, high * pi / 180.0


def _shifted(shape: Shape, by: Floats) -> Shape:
    """The shape with its centre moved."""
    return replace(shape, center=np.asarray(shape.center) + by)


def padded(links: Mapping[str, Link], contacts: Sequence[Contact], *, friction: float, law: str) -> list[Contact]:
    """Contacts, and a ball about the centre of mass of every link that has none: of 4 cm for 1 kg, at equal density.

    Such robots lie on the ground when they fall.
    """
    bare = {name: link for name, link in links.items() if name not in {contact.body for contact in contacts}}
    balls = [
        Contact(name, radius=_PAD * link.mass ** (1.0 / 3.0), friction=friction, law=law, name=f"{name}_pad")
        for name, link in bare.items()
        if link.mass > 0.0
    ]
    return [*contacts, *balls]
