"""Sphere, Box, Capsule, Cylinder: solids of uniform density, for inertia and for drawing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks

Floats = NDArray[np.float64]


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


@dataclass(frozen=True, kw_only=True)
class Solid:
    """Where a shape sits in its body: centre from the centre of mass [m], and orientation."""

    center: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        call = type(self).__name__
        object.__setattr__(self, "center", checks.vector(f"{call}(center=...)", self.center, 3))
        object.__setattr__(self, "orientation", checks.quaternion(f"{call}(orientation=...)", self.orientation))

    def _positive(self, *fields: str) -> None:
        for field in fields:
            value = checks.number(f"{type(self).__name__}({field}=...)", getattr(self, field), above=0.0)
            object.__setattr__(self, field, value)

    def principal(self, mass: float) -> tuple[float, float, float]:
        """Moments of inertia about the shape's own centre and axes [kg m^2]."""
        raise NotImplementedError

    def inertia(self, mass: float) -> Floats:
        """Inertia (3, 3) about the shape's own centre, in body axes: R diag(principal) R^T [kg m^2]."""
        R = rotation_matrix(self.orientation)
        return np.asarray((R * self.principal(mass)) @ R.T)


@dataclass(frozen=True)
class Sphere(Solid):
    """Ball of the given radius [m]; 2/5 m r^2."""

    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("radius")

    def principal(self, mass: float) -> tuple[float, float, float]:
        """2/5 m r^2."""
        i = 0.4 * mass * self.radius**2
        return i, i, i


@dataclass(frozen=True)
class Box(Solid):
    """Cuboid with edges x, y, z [m]; m/12 (y^2 + z^2) and so on."""

    x: float
    y: float
    z: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("x", "y", "z")

    def principal(self, mass: float) -> tuple[float, float, float]:
        """m/12 (y^2 + z^2), and so on."""
        x, y, z = self.x**2, self.y**2, self.z**2
        return mass / 12 * (y + z), mass / 12 * (x + z), mass / 12 * (x + y)


@dataclass(frozen=True)
class Cylinder(Solid):
    """Cylinder about its z axis [m]; m/12 (3 r^2 + l^2) across, m/2 r^2 along."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("radius", "length")

    def principal(self, mass: float) -> tuple[float, float, float]:
        """Across twice, then along."""
        across = mass / 12 * (3 * self.radius**2 + self.length**2)
        return across, across, mass / 2 * self.radius**2


@dataclass(frozen=True)
class Capsule(Solid):
    """Cylinder of the given length along z with two half balls at its ends [m].

    across = m_c (l^2/12 + r^2/4) + m_s (2/5 r^2 + l^2/4 + 3/8 l r)
    along  = m_c r^2/2 + m_s 2/5 r^2,     m_c : m_s = l : 4/3 r
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("radius", "length")

    def principal(self, mass: float) -> tuple[float, float, float]:
        """Across twice, then along."""
        r, length = self.radius, self.length
        ball = mass * (4 / 3 * r) / (length + 4 / 3 * r)
        rod = mass - ball
        across = rod * (length**2 / 12 + r**2 / 4) + ball * (0.4 * r**2 + length**2 / 4 + 0.375 * length * r)
        return across, across, rod * r**2 / 2 + 0.4 * ball * r**2


@dataclass(frozen=True)
class HalfSpace(Solid):
    """Everything below the plane z = 0 of its frame: ground, a wall, a slope. An obstacle, no body."""

    def principal(self, mass: float) -> tuple[float, float, float]:
        """None: it has no end."""
        raise ValueError("HalfSpace: a body cannot have this shape")


@dataclass(frozen=True)
class String(Solid):
    """One end, at its centre, of a string of the given length [m] between two bodies; no body."""

    length: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self._positive("length")

    def principal(self, mass: float) -> tuple[float, float, float]:
        """None: it has no mass."""
        raise ValueError("String: a body cannot have this shape")


Shape = Sphere | Box | Cylinder | Capsule
