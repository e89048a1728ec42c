"""Sphere, Box, Capsule, Cylinder, Ellipsoid: solids of uniform density, for inertia, for contact and for drawing.

A shape is one class. It says its inertia and volume, its number and sizes for the kernels, a ball around it, how its
surface moves with each of its sizes, the points and balls by which it stands on ground, and how it is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import hypot, inf, pi
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.model import shape_kinds
from sim.model.shape_kinds import Size
from solvers.types import Floats


def cross_matrix(a: Floats) -> Floats:
    """[a] (3, 3) of a vector (3,): [a] b = a x b, and rows b @ [a] = b x a, ten times as fast as `np.cross`."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(quat: ArrayLike) -> Floats:
    """R(q), (3, 3), of a unit quaternion (w, x, y, z)."""
    return np.array(_matrix(*(float(c) for c in np.asarray(quat, dtype=np.float64))))


def rotation_matrices(quats: Floats) -> Floats:
    """R(q), (n, 3, 3), of unit quaternions (n, 4)."""
    return np.moveaxis(np.array(_matrix(*quats.T)), -1, 0)


def _matrix(w: Any, x: Any, y: Any, z: Any) -> list[list[Any]]:
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


class Primitive(NamedTuple):
    """A part of the drawing of a shape: in the frame of the shape, about its own centre, long along z."""

    kind: str  # "ball" of one radius or three, "cylinder" of radius and length, "box", "hull" or "triangles"
    size: Floats  # [m]
    center: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Stance(NamedTuple):
    """The points and balls by which a shape stands on ground, in the frame of the shape."""

    part: str  # name of one of them
    points: Floats  # (n, 3) [m]
    radius: float  # around each [m]


def _around() -> tuple[Floats, Floats]:
    """Points of the unit circle about z, and of the unit ball."""
    angles = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(24)], axis=1)
    ball = np.concatenate([ring * (np.cos(t), np.cos(t), 0.0) + (0, 0, np.sin(t)) for t in np.linspace(-1.5, 1.5, 9)])
    return ring, ball


RING, BALL = _around()
SURFACE_FIELDS = ("friction", "restitution", "torsional_friction", "rolling_friction")  # of contacts, and of shapes
PLATE = 0.002  # thickness of a drawn plane [m]


@dataclass(frozen=True, kw_only=True)
class Solid:
    """A solid of uniform density and its place in a body.

    Attributes:
        center: (3,) its centre, from the centre of mass of the body, body axes [m] (default that of mass).
        orientation: (4,) unit quaternion (w, x, y, z) from its axes to those of the body (default none).
        friction: coefficient of contacts and collisions of this shape that have none of their own; of two shapes the
            larger one (default None: that of the contact or collision).
        restitution: likewise, their restitution.
        torsional_friction: likewise, their torsional friction [m].
        rolling_friction: likewise, their rolling friction [m].
        name: name in those of its contacts, where its body has several shapes (default its number).

    Raises:
        ValueError: for a value of the wrong shape or out of range.
    """

    code: ClassVar[shape_kinds.Shape | None] = None  # None: it cannot collide
    surface: ClassVar[dict[str, tuple[Size, float]]] = {}  # its sizes in order: effect, unit

    center: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    friction: float | None = None
    restitution: float | None = None
    torsional_friction: float | None = None  # [m]
    rolling_friction: float | None = None  # [m]
    name: str = ""

    def __post_init__(self) -> None:
        call = type(self).__name__
        object.__setattr__(self, "center", checks.vector(f"{call}(center=...)", self.center, 3))
        object.__setattr__(self, "orientation", checks.quaternion(f"{call}(orientation=...)", self.orientation))
        for field in ("friction", "torsional_friction", "rolling_friction"):
            value = getattr(self, field)
            if value is not None:
                object.__setattr__(self, field, checks.number(f"{call}({field}=...)", value, at_least=0.0))
        if self.restitution is not None:
            restitution = checks.fraction(f"{call}(restitution=...)", self.restitution)
            object.__setattr__(self, "restitution", restitution)
        object.__setattr__(self, "name", checks.name_or(f"{call}(name=...)", self.name, ""))

    def _positive(self, *fields: str) -> None:
        for field in fields:
            value = checks.number(f"{type(self).__name__}({field}=...)", getattr(self, field), above=0.0)
            object.__setattr__(self, field, value)

    def principal(self, mass: float) -> tuple[float, float, float]:
        """Moments of inertia about the own centre and axes of the shape.

        Args:
            mass: mass [kg].

        Returns:
            (3,) moments about x, y, z [kg m^2].

        Raises:
            ValueError: a body cannot have this shape, or the mass is negative.
        """
        return self._principal(checks.number(f"{type(self).__name__}.principal(mass)", mass, at_least=0.0))

    def _principal(self, mass: float) -> tuple[float, float, float]:
        """Moments of inertia of a checked mass."""
        raise NotImplementedError

    def sizes(self) -> tuple[float, ...]:
        """The sizes that kernels read, in the order of shape_kinds.Shape.

        Returns:
            Radii and halves of lengths [m].
        """
        return tuple(unit * getattr(self, name) for name, (_, unit) in self.surface.items())

    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of the shape that contains it.

        Returns:
            The radius [m]; infinite for an unbounded shape.
        """
        return inf

    def volume(self) -> float:
        """Volume of the shape.

        Returns:
            The volume [m^3]; infinite for an unbounded shape.
        """
        return inf

    def support(self, n: Floats) -> float:
        """Largest n.x over the points x of the shape, in its frame.

        Args:
            n: (3,) unit vector.

        Returns:
            The support [m]; infinite for an unbounded shape.

        Raises:
            ValueError: `n` has another shape, or is not finite.
        """
        return self._support(checks.array(f"{type(self).__name__}.support(n)", n, (3,)))

    def _support(self, n: Floats) -> float:
        """The support along a checked vector."""
        stance = self.stance()
        return inf if stance is None else float((stance.points @ n).max()) + stance.radius

    def outline(self) -> Floats:
        """Points whose convex hull is the shape, or close to it.

        Returns:
            (n, 3) points in the frame of the shape [m].

        Raises:
            NotImplementedError: the shape is unbounded.
        """
        raise NotImplementedError

    def primitives(self) -> list[Primitive]:
        """The drawing of the shape.

        Returns:
            Balls, cylinders, boxes and hulls; empty for a shape that is not drawn.
        """
        return []

    def stance(self) -> Stance | None:
        """The points and balls by which the shape stands on ground.

        Returns:
            The stance; None for a shape whose points of contact move over it, and for obstacles.
        """
        return None

    def inertia(self, mass: float) -> Floats:
        """Inertia about the own centre of the shape: R diag(principal) R^T.

        Args:
            mass: mass [kg].

        Returns:
            (3, 3) inertia in body axes [kg m^2].

        Raises:
            ValueError: a body cannot have this shape.
        """
        mass = checks.number(f"{type(self).__name__}.inertia(mass)", mass, at_least=0.0)
        R = rotation_matrix(self.orientation)
        return np.asarray((R * self._principal(mass)) @ R.T)

    def place(self, points: ArrayLike) -> Floats:
        """Points of the frame of the shape in its body.

        Args:
            points: (..., 3) places in the frame of the shape [m].

        Returns:
            (..., 3) the same from the centre of mass of the body, body axes [m].

        Raises:
            ValueError: the points have another shape.
        """
        places = checks.points(f"{type(self).__name__}.place(points)", points)
        return places @ rotation_matrix(self.orientation).T + np.asarray(self.center)

    def mass_center(self) -> Floats:
        """Centre of the solid.

        Returns:
            (3,) place from the centre of mass of the body, body axes [m].
        """
        return np.array(self.center, dtype=np.float64)

    def central_inertia(self, mass: float) -> Floats:
        """Inertia about the centre of the solid.

        Args:
            mass: mass [kg].

        Returns:
            (3, 3) inertia in body axes [kg m^2].
        """
        return self.inertia(mass)


@dataclass(frozen=True)
class Sphere(Solid):
    """A ball. Its moments of inertia are 2/5 m r^2.

    The keywords of `sim.mechanism.shapes.Solid` give its place in the body.

    Attributes:
        radius: radius r [m].
    """

    code = shape_kinds.Shape.SPHERE
    surface = {"radius": (Size.BALL, 1.0)}

    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("radius")

    def _principal(self, mass: float) -> tuple[float, float, float]:
        i = 0.4 * mass * self.radius**2
        return i, i, i

    def bounding_radius(self) -> float:
        return self.radius

    def volume(self) -> float:
        return 4.0 / 3.0 * pi * self.radius**3

    def outline(self) -> Floats:
        return self.radius * BALL

    def primitives(self) -> list[Primitive]:
        return [Primitive("ball", np.array([self.radius]))]

    def stance(self) -> Stance:
        return Stance("ball", np.zeros((1, 3)), self.radius)


@dataclass(frozen=True)
class Box(Solid):
    """A cuboid. Its moments of inertia are m/12 (y^2 + z^2) and so on.

    The keywords of `sim.mechanism.shapes.Solid` give its place in the body.

    Attributes:
        x: edge along x [m].
        y: edge along y [m].
        z: edge along z [m].
    """

    code = shape_kinds.Shape.BOX
    surface = {"x": (Size.SIDE_X, 0.5), "y": (Size.SIDE_Y, 0.5), "z": (Size.SIDE_Z, 0.5)}

    x: float
    y: float
    z: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("x", "y", "z")

    def _principal(self, mass: float) -> tuple[float, float, float]:
        x, y, z = self.x**2, self.y**2, self.z**2
        return mass / 12 * (y + z), mass / 12 * (x + z), mass / 12 * (x + y)

    def bounding_radius(self) -> float:
        return hypot(*self.sizes())

    def volume(self) -> float:
        return self.x * self.y * self.z

    def outline(self) -> Floats:
        return 0.5 * np.array(list(product((-self.x, self.x), (-self.y, self.y), (-self.z, self.z))))

    def primitives(self) -> list[Primitive]:
        return [Primitive("box", np.array([self.x, self.y, self.z]))]

    def stance(self) -> Stance:
        corners = 0.5 * np.array([self.x, self.y, self.z]) * np.array(list(product((-1.0, 1.0), repeat=3)))
        return Stance("corner", corners, 0.0)


@dataclass(frozen=True)
class Cylinder(Solid):
    """A cylinder about its z axis. Its moments of inertia are m/12 (3 r^2 + l^2) across and m/2 r^2 along the axis.

    The keywords of `sim.mechanism.shapes.Solid` give its place in the body.

    Attributes:
        radius: radius r [m].
        length: length l along z [m].
    """

    code = shape_kinds.Shape.CYLINDER
    surface = {"radius": (Size.RIM, 1.0), "length": (Size.LENGTH, 0.5)}

    radius: float
    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("radius", "length")

    def _principal(self, mass: float) -> tuple[float, float, float]:
        across = mass / 12 * (3 * self.radius**2 + self.length**2)
        return across, across, mass / 2 * self.radius**2

    def bounding_radius(self) -> float:
        return hypot(*self.sizes())

    def _support(self, n: Floats) -> float:
        return float(self.radius * hypot(n[0], n[1]) + 0.5 * self.length * abs(n[2]))

    def volume(self) -> float:
        return pi * self.radius**2 * self.length

    def outline(self) -> Floats:
        half = np.array([0.0, 0.0, self.length / 2])
        return np.concatenate([self.radius * RING + half, self.radius * RING - half])

    def primitives(self) -> list[Primitive]:
        return [Primitive("cylinder", np.array([self.radius, self.length]))]


@dataclass(frozen=True)
class Capsule(Solid):
    """A cylinder along z with two half balls at its ends. Its moments of inertia are

        across = m_c (l^2/12 + r^2/4) + m_s (2/5 r^2 + l^2/4 + 3/8 l r)
        along  = m_c r^2/2 + m_s 2/5 r^2,     m_c : m_s = l : 4/3 r

    The keywords of `sim.mechanism.shapes.Solid` give its place in the body.

    Attributes:
        radius: radius r [m].
        length: length l of the cylinder, from the centre of one half ball to that of the other [m].
    """

    code = shape_kinds.Shape.CAPSULE
    surface = {"radius": (Size.BALL, 1.0), "length": (Size.ROD, 0.5)}

    radius: float
    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("radius", "length")

    def _principal(self, mass: float) -> tuple[float, float, float]:
        r, length = self.radius, self.length
        ball = mass * (4 / 3 * r) / (length + 4 / 3 * r)
        rod = mass - ball
        across = rod * (length**2 / 12 + r**2 / 4) + ball * (0.4 * r**2 + length**2 / 4 + 0.375 * length * r)
        return across, across, rod * r**2 / 2 + 0.4 * ball * r**2

    def bounding_radius(self) -> float:
        return sum(self.sizes())

    def volume(self) -> float:
        return pi * self.radius**2 * self.length + 4.0 / 3.0 * pi * self.radius**3

    def outline(self) -> Floats:
        half = np.array([0.0, 0.0, self.length / 2])
        return np.concatenate([self.radius * BALL + half, self.radius * BALL - half])

    def primitives(self) -> list[Primitive]:
        ends = [(0.0, 0.0, side * self.length / 2) for side in (-1, 1)]
        rod = Primitive("cylinder", np.array([self.radius, self.length]))
        return [rod, *(Primitive("ball", np.array([self.radius]), end) for end in ends)]

    def stance(self) -> Stance:
        return Stance("end", np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * self.length, self.radius)


@dataclass(frozen=True)
class Ellipsoid(Solid):
    """An ellipsoid. Its moments of inertia are m/5 (y^2 + z^2) and so on.

    It touches the ground through a collision with a HalfSpace, because its contact point moves over its surface. The
    keywords of `sim.mechanism.shapes.Solid` give its place in the body.

    Attributes:
        x: semi-axis along x [m].
        y: semi-axis along y [m].
        z: semi-axis along z [m].
    """

    code = shape_kinds.Shape.ELLIPSOID
    surface = {"x": (Size.SEMI_X, 1.0), "y": (Size.SEMI_Y, 1.0), "z": (Size.SEMI_Z, 1.0)}

    x: float
    y: float
    z: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("x", "y", "z")

    def _principal(self, mass: float) -> tuple[float, float, float]:
        x, y, z = self.x**2, self.y**2, self.z**2
        return mass / 5 * (y + z), mass / 5 * (x + z), mass / 5 * (x + y)

    def bounding_radius(self) -> float:
        return max(self.sizes())

    def _support(self, n: Floats) -> float:
        return hypot(self.x * n[0], self.y * n[1], self.z * n[2])

    def volume(self) -> float:
        return 4.0 / 3.0 * pi * self.x * self.y * self.z

    def outline(self) -> Floats:
        return BALL * self.sizes()

    def primitives(self) -> list[Primitive]:
        return [Primitive("ball", np.array(self.sizes()))]


@dataclass(frozen=True)
class HalfSpace(Solid):
    """Everything below the plane z = 0 of its frame: ground, a wall, a slope. An obstacle, not the shape of a body.

    The keywords of `sim.mechanism.shapes.Solid` give its place.
    """

    code = shape_kinds.Shape.HALFSPACE

    def _principal(self, mass: float) -> tuple[float, float, float]:
        raise ValueError("HalfSpace: a body cannot have this shape")

    def primitives(self) -> list[Primitive]:
        return [Primitive("box", np.array([10.0, 10.0, PLATE]), (0.0, 0.0, -0.5 * PLATE))]


@dataclass(frozen=True)
class String(Solid):
    """One end of a string between two bodies, at the centre of this shape. It is not the shape of a body.

    The keywords of `sim.mechanism.shapes.Solid` give its place.

    Attributes:
        length: length of the string [m].
    """

    code = shape_kinds.Shape.STRING
    surface = {"length": (Size.STRING, 1.0)}

    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("length")

    def _principal(self, mass: float) -> tuple[float, float, float]:
        raise ValueError("String: a body cannot have this shape")


Shape = Sphere | Box | Cylinder | Capsule | Ellipsoid
