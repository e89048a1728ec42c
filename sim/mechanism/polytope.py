"""Polytope: the convex hull of points, as the shape of a body."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.shapes import Primitive, Solid, Stance, rotation_matrix
from sim.mechanism.short_repr import short_repr
from sim.model import shape_kinds
from sim.model.shape_kinds import Size
from solvers.types import Floats

_PARALLEL = 1e-9  # difference of the normals of two facets in one plane
_FLAT = 1e-9  # volume, relative to that of the box around the points, below which they span no body


@dataclass(frozen=True)
class Polytope(Solid):
    """The convex hull of points. `vertices` keeps the corners of the hull only.

    A body that takes its inertia from the shape has its origin at the centre of mass: `Polytope.about_centroid(points)`
    moves it there. The keywords of `sim.mechanism.shapes.Solid` give its place in the body.

    Attributes:
        vertices: (n, 3) points in the frame of the shape, at least four, not all in one plane [m].

    Raises:
        ValueError: for fewer points, or points that span no volume.
    """

    code = shape_kinds.Shape.POLYTOPE
    surface = {"scale": (Size.SCALE, 1.0)}

    vertices: ArrayLike

    __repr__ = short_repr

    def __post_init__(self) -> None:
        from scipy.spatial import ConvexHull, QhullError

        super().__post_init__()
        points = checks.array("Polytope(vertices=...)", self.vertices, (None, 3))
        if len(points) < 4:
            raise ValueError(f"Polytope(vertices=...): expected at least 4 points, got {len(points)}")
        size = np.ptp(points, axis=0)
        try:
            hull = ConvexHull(points)
        except QhullError:
            hull = None
        if hull is None or not hull.volume > _FLAT * size.max() ** 3:
            raise ValueError(f"Polytope(vertices=...): its {len(points)} points span no volume")
        object.__setattr__(self, "vertices", tuple(tuple(float(x) for x in p) for p in points[np.sort(hull.vertices)]))

    @classmethod
    def about_centroid(cls, vertices: ArrayLike, **place: Any) -> Polytope:
        """The hull of points, moved so that the centroid of the solid is at the origin.

        Args:
            vertices: (n, 3) points [m].
            **place: further fields of the shape, such as `center` and `orientation`.

        Returns:
            The polytope.

        Raises:
            ValueError: for fewer than four points, or points that span no volume.
        """
        raw = cls(vertices)
        return cls(np.asarray(raw.vertices) - raw.centroid, **place)

    def _moments(self) -> tuple[float, Floats, Floats]:
        """Volume, integral of x (3,), and of x x^T (3, 3), as sums over tetrahedra from the origin to the facets."""
        from scipy.spatial import ConvexHull

        points = np.asarray(self.vertices)
        hull = ConvexHull(points)
        volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
        for corners, plane in zip(hull.simplices, hull.equations, strict=True):
            v = points[corners]
            six = float(np.linalg.det(v))
            if np.cross(v[1] - v[0], v[2] - v[0]) @ plane[:3] < 0.0:
                six = -six
            total = v.sum(axis=0)
            volume += six / 6.0
            first += six / 24.0 * total
            second += six / 120.0 * (v.T @ v + np.outer(total, total))
        return volume, first, second

    @property
    def centroid(self) -> Floats:
        """(3,) centre of the solid, in the frame of the shape [m]."""
        volume, first, _ = self._moments()
        return first / volume

    def inertia(self, mass: float) -> Floats:
        """Inertia about the origin of the shape, which is its centroid.

        Args:
            mass: mass [kg].

        Returns:
            (3, 3) inertia in body axes [kg m^2].

        Raises:
            ValueError: the centroid is elsewhere.
        """
        volume, first, _ = self._moments()
        size = float(np.ptp(np.asarray(self.vertices), axis=0).max())
        if np.abs(first / volume).max() > 1e-9 * size:
            raise ValueError(
                f"Polytope: its centroid is at {np.round(first / volume, 9).tolist()}; a body has its origin there: "
                "use Polytope.about_centroid(vertices), or give inertia=..."
            )
        return self.central_inertia(mass)

    def mass_center(self) -> Floats:
        """Centre of the solid.

        Returns:
            (3,) place from the centre of mass of the body, body axes [m].
        """
        return self.place(self.centroid)

    def central_inertia(self, mass: float) -> Floats:
        """Inertia about the centre of the solid: C = m/V int (x - c)(x - c)^T, J = tr(C) I - C.

        Args:
            mass: mass [kg].

        Returns:
            (3, 3) inertia in body axes [kg m^2].

        Raises:
            ValueError: the mass is negative.
        """
        mass = checks.number("Polytope.central_inertia(mass)", mass, at_least=0.0)
        volume, first, second = self._moments()
        C = mass / volume * (second - np.outer(first, first) / volume)
        R = rotation_matrix(self.orientation)
        return np.asarray(R @ (np.trace(C) * np.eye(3) - C) @ R.T)

    def principal(self, mass: float) -> tuple[float, float, float]:
        """Principal moments of inertia about the centroid, ascending.

        Args:
            mass: mass [kg].

        Returns:
            (3,) moments [kg m^2].

        Raises:
            ValueError: the centroid is not the origin of the shape.
        """
        a, b, c = np.linalg.eigvalsh(self.inertia(mass))
        return float(a), float(b), float(c)

    def sizes(self) -> tuple[float, ...]:
        """The sizes that kernels read: none, as the corners are in a table.

        Returns:
            An empty tuple.
        """
        return ()

    def bounding_radius(self) -> float:
        return float(np.linalg.norm(np.asarray(self.vertices), axis=1).max())

    def volume(self) -> float:
        return self._moments()[0]

    def outline(self) -> Floats:
        return np.asarray(self.vertices)

    def primitives(self) -> list[Primitive]:
        return [Primitive("hull", np.asarray(self.vertices))]

    def stance(self) -> Stance:
        return Stance("corner", np.asarray(self.vertices), 0.0)


def hull_table(shape: Solid) -> tuple[Floats, float]:
    """The table of polytope_table.py, (n, 4), of a shape without its rounding, and the radius of that rounding [m].

    The shape stands on the corners of the hull, or on balls around them.
    """
    stance = shape.stance()
    assert stance is not None
    points = stance.points
    if len(points) > 2:
        return _table(points), stance.radius
    rows = [[len(points), len(points) - 1, 0, 0], *([*p, 0] for p in points), [0, 1, -1, -1]]
    return np.array(rows[: 2 * len(points)], dtype=np.float64), stance.radius


def _table(points: Floats) -> Floats:
    """Rows of a polytope with these corners; facets in one plane are one face."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    faces: list[Floats] = []
    face_of = []
    for plane in hull.equations:
        same = [k for k, f in enumerate(faces) if np.abs(f - plane)[:3].max() < _PARALLEL]
        face_of.append(same[0] if same else len(faces))
        if not same:
            faces.append(plane)
    edges: dict[tuple[int, int], set[int]] = {}
    for corners, face in zip(hull.simplices, face_of, strict=True):
        for a, b in combinations(sorted(int(c) for c in corners), 2):
            edges.setdefault((a, b), set()).add(face)
    sharp = [[a, b, *sorted(pair)] for (a, b), pair in edges.items() if len(pair) == 2]
    rows = [[len(points), len(sharp), len(faces), 0], *([*p, 0] for p in points), *sharp]
    return np.array([*rows, *([*f[:3], -f[3]] for f in faces)], dtype=np.float64)
