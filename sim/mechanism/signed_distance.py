"""SignedDistance: a solid of any smooth form, given by a field on a grid, as a shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.distances import distances_to_level, distances_to_mesh
from sim.mechanism.level_set import LevelSet, level_set
from sim.mechanism.positional import few_positional
from sim.mechanism.shapes import SURFACE_FIELDS, Primitive, Solid, Stance, rotation_matrix
from sim.mechanism.short_repr import short_repr
from sim.model import shape_kinds
from sim.model.shape_kinds import Size
from solvers.types import Floats

Field = Callable[[Floats], ArrayLike]

_LEAST = 4  # values along each axis
_MARGIN = 3  # cells around a mesh
_PARTS_OF_LONGEST = (25, 50, 100)  # spacings that are tried for a mesh
_ERROR, _VOLUME_ERROR = 0.025, 0.05  # shares of the longest side and of the volume, between a mesh and the surface
_MOST = 1e8  # points of a grid: .8 GB
_FINEST, _COARSEST = 1e-9, 1e6  # spacings [m]: beyond, squares of lengths lose their digits
_STAND = 32  # points on which it stands
_APART = 0.05  # of a cell: balls whose centres are nearer than this become one


@few_positional
@dataclass(frozen=True, eq=False)
class SignedDistance(Solid):
    """The solid inside of the level set phi = 0 of a field on a grid: phi < 0 inside, phi > 0 outside.

    phi is a cubic B-spline through the values: its surface, normals and curvature are smooth. The gap of a contact is
    the Euclidean distance to the level set, whatever the scale of phi; phi itself only leads to the nearest point;
    signed distances are the best values. Edges of the solid are rounded, by about one cell.

    Spheres and capsules collide with it, other shapes do not. A sphere, or an end of a capsule, touches it at the
    nearest point only: a ball that fits a hollow at two places touches them in turn. On planes and ground it stands on
    equal balls inside it, which touch the surface at corners of its convex hull, at most 32. Shapes with the same array
    of values share one table. The keywords of `sim.mechanism.shapes.Solid` give its place in the body.

    Attributes:
        values: (nx, ny, nz) values of phi, at least 4 along each axis; positive on the outermost grid points [m].
        origin: (3,) place of the first value, in the frame of the shape [m].
        spacing: distance of neighbouring grid points, the same along all axes [m].
        offset: distance by which the solid extends beyond the level set, everywhere along the normal [m] (default 0).
            Volume and inertia of the solid with its offset need a grid that contains it.

    Raises:
        ValueError: for values that are nowhere negative, not positive at the edges of the grid, or not finite.
    """

    code = shape_kinds.Shape.FIELD
    surface = {"offset": (Size.BALL, 1.0)}

    values: ArrayLike
    origin: ArrayLike
    spacing: float
    _: KW_ONLY
    offset: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        super().__post_init__()
        call = "SignedDistance"
        values: Any = self.values
        if not (isinstance(values, np.ndarray) and values.dtype == np.float64 and not values.flags.writeable):
            values = np.array(checks.array(f"{call}(values=...)", values, (None, None, None)))
            values.setflags(write=False)
        if min(values.shape) < _LEAST:
            raise ValueError(
                f"{call}(values=...): expected at least {_LEAST} values along each axis, got {values.shape}"
            )
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "origin", checks.vector(f"{call}(origin=...)", self.origin, 3))
        self._positive("spacing")
        if not _FINEST <= self.spacing <= _COARSEST:
            raise ValueError(f"{call}(spacing=...): expected {_FINEST:g} to {_COARSEST:g} m, got {self.spacing:g}")
        object.__setattr__(self, "offset", checks.number(f"{call}(offset=...)", self.offset, at_least=0.0))
        if not values.min() < 0.0:
            raise ValueError(f"{call}(values=...): there is no solid: expected negative values inside, got none")
        edge = _at_edge(values)
        if not edge > 0.0:
            raise ValueError(
                f"{call}(values=...): the solid reaches the edge of the grid, where a value is {edge:g}; "
                "expected positive values there: take a larger grid"
            )
        object.__setattr__(self, "_solid", level_set(values, np.array(self.origin), self.spacing))

    @property
    def level_set(self) -> LevelSet:
        """The solid without its place and offset, with its surface and moments."""
        found: LevelSet = getattr(self, "_solid")  # noqa: B009
        return found

    @classmethod
    def from_function(cls, f: Field, bounds: ArrayLike, spacing: float, **place: Any) -> SignedDistance:
        """A solid given by a function, which is called once, for all grid points.

        Args:
            f: phi of points (n, 3) [m] as an array (n,), negative inside; best the signed distance [m].
            bounds: (2, 3) lowest and highest corner of the grid, with two cells or more around the solid [m].
            spacing: distance of neighbouring grid points [m].
            **place: further fields of the shape, such as `offset`, `center` and `orientation`.

        Returns:
            The shape.

        Raises:
            ValueError: for a wrong number of values, or values that SignedDistance refuses.
        """
        call = "SignedDistance.from_function"
        if not callable(f):
            raise ValueError(f"{call}(f): expected a function of points (n, 3), got {checks.shown(f)}")
        origin, counts, points = _grid(call, bounds, spacing)
        return cls(_sampled(f"{call}(f)", f, points).reshape(counts), origin, spacing, **place)

    @classmethod
    def from_density(
        cls,
        density: Field | ArrayLike,
        level: float,
        spacing: float,
        *,
        bounds: ArrayLike | None = None,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        **place: Any,
    ) -> SignedDistance:
        """The solid in which a density, such as that of a neural radiance field, is above a level.

        The surface is where the cubic B-spline through the density has that level. The values of the shape are the
        distances of the grid points to it, negative where the density is above the level: gaps are distances in
        metres. The spline through the distances has its surface there to the fourth order of the spacing over the
        least radius of curvature; features of less than two cells are lost.

        Args:
            density: values (nx, ny, nz), or a function of points (n, 3) [m] that returns values (n,).
            level: density on the surface, in units of the density.
            spacing: distance of neighbouring grid points [m].
            bounds: (2, 3) lowest and highest corner of the grid [m], for a function.
            origin: (3,) place of the first value, for values [m] (default the origin of the shape).
            **place: further fields of the shape, such as `offset`, `center` and `orientation`.

        Returns:
            The shape.

        Raises:
            ValueError: for a function without bounds, or a density that is nowhere above the level, or somewhere at the
                edge of the grid.
        """
        call = "SignedDistance.from_density"
        level = checks.number(f"{call}(level=...)", level)
        if callable(density):
            if bounds is None:
                raise ValueError(f"{call}(density): give bounds=..., the box in which the function is sampled")
            origin, counts, points = _grid(call, bounds, spacing)
            values = _sampled(f"{call}(density)", density, points).reshape(counts)
        else:
            values = checks.array(f"{call}(density)", density, (None, None, None))
        if values.size and not values.max() > level:
            raise ValueError(f"{call}(level=...): the density is nowhere above {level:g}")
        if min(values.shape) >= _LEAST and _at_edge(-values) <= -level:
            raise ValueError(
                f"{call}(density): it is {-_at_edge(-values):g} at the edge of the grid, expected less than the level "
                f"{level:g} there: take a larger grid"
            )
        raw = cls(level - values, origin, spacing)
        return cls(distances_to_level(raw.level_set), origin, spacing, **place)

    @classmethod
    def from_mesh(cls, mesh: Any, spacing: float | None = None, **place: Any) -> SignedDistance:
        """The solid inside of a closed mesh; edges are rounded, by about one cell.

        Args:
            mesh: path of a file that trimesh reads (extra `meshes`), a trimesh.Trimesh, or (vertices, faces).
            spacing: distance of neighbouring grid points; the grid ends three cells beyond the mesh [m] (default None:
                a twenty-fifth of the longest side of the mesh, or finer, such that the corners and the centres of its
                triangles are within a fortieth of this side of the surface, and the volume right to 5 %).
            **place: further fields of the shape, such as `offset`, `center` and `orientation`.

        Returns:
            The shape, in the frame of the mesh.

        Raises:
            ImportError: a path, without trimesh.
            ValueError: the mesh is not closed, or thinner than the grid resolves, be it the finest that is chosen.
        """
        call = "SignedDistance.from_mesh"
        vertices, faces = _triangles(call, mesh)
        if spacing is not None:
            spacing = checks.number(f"{call}(spacing=...)", spacing, above=0.0)
            return cls(*_around(call, vertices, faces, spacing), spacing, **place)
        longest = float(np.ptp(vertices, axis=0).max(initial=0.0))
        corners = vertices[faces]
        seen = np.concatenate([corners.reshape(-1, 3), corners.mean(axis=1)])
        volume = abs(float(np.linalg.det(corners - vertices.mean(axis=0)).sum())) / 6.0
        for part in _PARTS_OF_LONGEST:
            values, origin = _around(call, vertices, faces, longest / part)
            if values.min() < 0.0:
                solid = LevelSet(values, origin, longest / part)
                error = float(np.linalg.norm(solid.settled(seen)[0] - seen, axis=1).max())
                if error <= _ERROR * longest and abs(solid.moments(0.0)[0] - volume) <= _VOLUME_ERROR * volume:
                    return cls(values, origin, longest / part, **place)
        raise ValueError(
            f"{call}(mesh): parts of it are too thin for a spacing of {longest / part:.3g} m, the finest that is "
            "chosen; give spacing=..."
        )

    def about_centroid(self) -> SignedDistance:
        """The shape with the centroid of the solid at its origin, as needed for a body that takes its inertia from the
        shape.

        Returns:
            The shape; its values are the same.
        """
        place = {f: getattr(self, f) for f in ("center", "orientation", *SURFACE_FIELDS, "name")}
        return SignedDistance(
            self.values, np.asarray(self.origin) - self.centroid, self.spacing, offset=self.offset, **place
        )

    @cached_property
    def _moments(self) -> tuple[float, Floats, Floats]:
        return self.level_set.moments(self.offset)

    @cached_property
    def _vertices(self) -> Floats:
        """Points of the surface (n, 3), with the offset."""
        vertices = self.level_set.surface[0]
        return vertices + self.offset * self.level_set.settled(vertices)[1]

    @property
    def centroid(self) -> Floats:
        """(3,) centre of the solid, in the frame of the shape [m]."""
        volume, first, _ = self._moments
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
        mass = checks.number("SignedDistance.inertia(mass)", mass, at_least=0.0)
        if np.abs(self.centroid).max() > 1e-6 * self.bounding_radius():
            raise ValueError(
                f"SignedDistance: its centroid is at {np.round(self.centroid, 9).tolist()}; a body has its origin "
                "there: use shape.about_centroid(), or give inertia=..."
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
        mass = checks.number("SignedDistance.central_inertia(mass)", mass, at_least=0.0)
        volume, first, second = self._moments
        C = mass / volume * (second - np.outer(first, first) / volume)
        R = rotation_matrix(self.orientation)
        return np.asarray(R @ (np.trace(C) * np.eye(3) - C) @ R.T)

    def principal(self, mass: float) -> tuple[float, float, float]:
        """Principal moments of inertia about the centroid, ascending.

        Args:
            mass: mass [kg].

        Returns:
            (3,) moments [kg m^2].
        """
        a, b, c = np.linalg.eigvalsh(self.central_inertia(mass))
        return float(a), float(b), float(c)

    def volume(self) -> float:
        return self._moments[0]

    def bounding_radius(self) -> float:
        # the surface bulges between its vertices, by less than half a cell where the grid resolves it
        return float(np.linalg.norm(self._vertices, axis=1).max()) + 0.5 * self.spacing

    def outline(self) -> Floats:
        return self._vertices

    def primitives(self) -> list[Primitive]:
        faces = self.level_set.surface[1]
        return [Primitive("triangles", self._vertices[faces].reshape(-1, 3))]

    @cached_property
    def _stand(self) -> Floats:
        """Corners (n, 3) of the convex hull of the level set, at most 32: those that are farthest from the hull of the
        others, one by one.
        """
        from scipy.spatial import ConvexHull

        points = self.level_set.surface[0]
        corners = points[ConvexHull(points).vertices]
        chosen = list({int(np.argmax(s * corners[:, k])) for k in range(3) for s in (-1.0, 1.0)})
        while len(chosen) < min(_STAND, len(corners)):
            try:
                planes = ConvexHull(corners[chosen]).equations
                far = (corners @ planes[:, :3].T + planes[:, 3]).max(axis=1)
            except Exception:  # too few, or all in one plane
                far = np.min(np.linalg.norm(corners[:, None] - corners[chosen], axis=2), axis=1)
            far[chosen] = -1.0
            if far.max() < 1e-3 * self.spacing:
                break
            chosen.append(int(np.argmax(far)))
        return corners[sorted(chosen)]

    @cached_property
    def _balls(self) -> tuple[Floats, float]:
        """Centres (n, 3) and common radius of the largest equal balls inside the level set that touch it at `_stand`.

        Between its points a round solid would sink into a plane; its balls are nearly as round.
        """
        at, normals = self.level_set.settled(self._stand)
        step = 1e-3 * self.spacing
        ways = step * np.eye(3)
        H = np.stack(
            [(self.level_set.field(at + e)[1] - self.level_set.field(at - e)[1]) / (2 * step) for e in ways], 1
        )
        P = np.eye(3) - normals[:, :, None] * normals[:, None, :]
        slopes = np.linalg.norm(self.level_set.field(at)[1], axis=1)
        bends = np.linalg.eigvalsh(P @ (0.5 * (H + H.swapaxes(1, 2))) @ P).max(axis=1) / slopes  # largest curvature
        radius = 1.0 / max(float(bends.max()), 1.0 / self.bounding_radius())
        for p, n in zip(at, normals, strict=True):  # |v - p + r n| >= r for all points v of the surface
            away = self.level_set.surface[0] - p
            below, squares = -2.0 * away @ n, (away**2).sum(axis=1)
            inward = below > 1e-3 * self.spacing
            radius = min(radius, float((squares[inward] / below[inward]).min(initial=np.inf)))
        centers = at - radius * normals
        apart = np.unique(np.round(centers / (_APART * self.spacing)), axis=0, return_index=True)[1]
        return centers[np.sort(apart)], radius

    def stance(self) -> Stance:
        centers, radius = self._balls
        return Stance("point", centers, self.offset + radius)


def _at_edge(values: Floats) -> float:
    """Least value at the edge of a grid."""
    return min(float(np.take(values, [0, -1], axis=k).min()) for k in range(3))


def _grid(call: str, bounds: ArrayLike, spacing: float) -> tuple[Floats, tuple[int, ...], Floats]:
    """Lowest corner, numbers of points along the axes, and all points (n, 3) of a grid that covers a box."""
    box = checks.array(f"{call}(bounds=...)", bounds, (2, 3))
    spacing = checks.number(f"{call}(spacing=...)", spacing, above=0.0)
    if not np.all(box[1] > box[0]):
        raise ValueError(f"{call}(bounds=...): expected a lowest and a highest corner, got {box.tolist()}")
    cells = np.ceil((box[1] - box[0]) / spacing - 1e-9)
    if not np.prod(cells + 1.0) <= _MOST:
        raise ValueError(f"{call}(spacing=...): {np.prod(cells + 1.0):.3g} grid points, expected at most {_MOST:.0e}")
    counts = cells.astype(int) + 1
    if counts.min() < _LEAST:
        raise ValueError(
            f"{call}(spacing=...): expected at least {_LEAST} grid points along each axis, got {tuple(counts.tolist())}"
        )
    axes = [box[0, k] + spacing * np.arange(counts[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return box[0], tuple(counts.tolist()), points


def _around(call: str, vertices: Floats, faces: NDArray[np.int64], spacing: float) -> tuple[Floats, Floats]:
    """Signed distances to a mesh on a grid around it, and its first point."""
    around = _MARGIN * spacing
    bounds = np.array([vertices.min(axis=0) - around, vertices.max(axis=0) + around])
    origin, counts, points = _grid(call, bounds, spacing)
    return distances_to_mesh(call, points, counts, vertices, faces), origin


def _sampled(call: str, f: Field, points: Floats) -> Floats:
    return checks.array(f"{call}: its values", f(points), (len(points),))


def _triangles(call: str, mesh: Any) -> tuple[Floats, NDArray[np.int64]]:
    """Vertices (n, 3) and faces (k, 3)."""
    if isinstance(mesh, tuple) and len(mesh) == 2:
        vertices, faces = mesh
    else:
        if not hasattr(mesh, "vertices"):
            try:
                import trimesh
            except ImportError as error:
                raise ImportError('meshes need trimesh: pip install "dojo-opt[meshes]"') from error
            mesh = trimesh.load(mesh, force="mesh")
        vertices, faces = mesh.vertices, mesh.faces
    points = checks.array(f"{call}(mesh): vertices", vertices, (None, 3))
    return points, np.asarray(faces, dtype=np.int64).reshape(-1, 3)
