"""Terrain: ground other than a level plane; a slope, steps, or any smooth height z = f(x, y).

A height field is kept as heights on a grid and is the C2 cubic spline through them (height_field.py). The lower
bound of the centre of a ball, the surface at its radius, is a height field too,

    F(x) = max over s of  f(s) + sqrt(radius^2 - |s - x|^2),

and is computed once for every radius (ball_surface.py): kernels then know points only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.ball_surface import raised
from sim.mechanism.memory_limit import check_room
from sim.mechanism.positional import few_positional
from sim.mechanism.short_repr import short_repr
from sim.mechanism.spline import spline, spline_coefficients, spline_gradient, spline_shares
from solvers.types import Floats

_LINEAR = 1e-9  # [m] by which a function between two grid lines may be off a straight line, and of its height
_EDGE = 16  # grid lines across an edge of a step
_MARGIN = 8  # level grid lines around kinks: the waves of a spline fade by .27 per line


@few_positional
@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground for contacts: `mechanism.with_terrain(terrain)` for all, or Contact(..., terrain=...) for one.

    Derivatives by parameters of the heights follow by the chain rule. For a loss L and the rises of stairs:

        by_height = sim.vjp(trajectory, dL_dx, wrt=("terrain",))["terrain"]
        by_rise = [by_height @ Terrain.steps(unit, depth).heights.ravel() for unit in np.eye(len(rises))]

    A slope is a half-space: its parameters are contact_normal and contact_height, of all contacts "contact_normal:*".

    Attributes:
        heights: (nx, ny) above the lines of a grid [m], with a C2 spline in between; one column (nx, 1) is the same for
            all y. Beyond the grid the ground goes on as smoothly, and is level from two grid lines on, about as high as
            the slope at the edge reaches in one: at the height of the edge where the heights are level there (default
            level ground).
        origin: (2,) place (x, y) of heights[0, 0] [m] (default the origin).
        spacing: (2,) spacing (dx, dy) of the grid [m] (default 1).
        direction: (2,) direction (x, y) of the first grid axis (default x).
        plane: (normal, height [m]) of a slope, without a grid and as cheap as level ground (default None: the grid).
        name: name of the ground in those of its parameters: "terrain:ground[3,5]" is heights[3, 5] (default "ground").
        coefficients: (nx + 2, ny + 2) coefficients of the spline, computed.

    Raises:
        ValueError: for a value of the wrong shape or out of range.
    """

    heights: ArrayLike = ((0.0,),)
    origin: ArrayLike = (0.0, 0.0)
    spacing: ArrayLike = (1.0, 1.0)
    _: KW_ONLY
    direction: ArrayLike = (1.0, 0.0)
    plane: tuple[Any, float] | None = None
    name: str = "ground"
    coefficients: Floats = field(init=False, repr=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        heights = np.array(checks.array("Terrain(heights=...)", self.heights, (None, None)))
        if heights.size == 0:
            raise ValueError(f"Terrain(heights=...): expected one height at least, got shape {heights.shape}")
        heights.flags.writeable = False
        object.__setattr__(self, "name", checks.name("Terrain(name=...)", self.name))
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "origin", checks.vector("Terrain(origin=...)", self.origin, 2))
        spacing = checks.vector("Terrain(spacing=...)", self.spacing, 2)
        if min(spacing) <= 0.0:
            raise ValueError(f"Terrain(spacing=...): expected numbers > 0, got {spacing}")
        object.__setattr__(self, "spacing", spacing)
        object.__setattr__(self, "direction", _heading("Terrain(direction=...)", self.direction))
        if self.plane is not None:
            try:
                given, height = self.plane
            except (TypeError, ValueError):
                raise ValueError(
                    f"Terrain(plane=...): expected (normal, height), got {checks.shown(self.plane)}"
                ) from None
            normal = checks.direction("Terrain(plane=...): normal", given)
            if normal[2] <= 0.0:
                raise ValueError(f"Terrain(plane=...): expected a normal that points up, got {normal}")
            object.__setattr__(self, "plane", (normal, checks.number("Terrain(plane=...): height", height)))
        object.__setattr__(self, "coefficients", spline_coefficients(heights))

    @staticmethod
    def from_function(f: Callable[[Floats, Floats], ArrayLike], x: ArrayLike, y: ArrayLike) -> Terrain:
        """The spline through f at equally spaced grid lines.

        Its error is about (spacing / wavelength)^4 of the height of a wave; check with `terrain.height(x, y)`.

        Args:
            f: heights f(X, Y) (nx, ny) [m] of places X, Y (nx, ny) [m].
            x: grid lines (nx,) [m], such as np.linspace(-3, 3, 61); one if f does not depend on x.
            y: grid lines (ny,) [m], likewise.

        Returns:
            The terrain.

        Raises:
            TypeError: `f` is not a function.
            ValueError: the grid lines are not equally spaced, two of them are given for an f that is not linear between
                them, or a height is not finite.
        """
        if not callable(f):
            raise TypeError(f"Terrain.from_function(f): expected a function of (X, Y), got {f!r}")
        lines = [_lines(f"Terrain.from_function({name})", given) for name, given in (("x", x), ("y", y))]
        heights = _heights(f, lines)
        for axis, name in enumerate("xy"):
            if len(lines[axis]) == 2:
                _check_linear(f"Terrain.from_function({name})", f, lines, axis, heights)
        spacing = [line[1] - line[0] if len(line) > 1 else 1.0 for line in lines]
        return Terrain(heights, (lines[0][0], lines[1][0]), spacing)

    @staticmethod
    def slope(angle: float, direction: ArrayLike = (1.0, 0.0), height: float = 0.0) -> Terrain:
        """A plane that rises towards `direction`.

        Args:
            angle: slope [rad], below a right angle.
            direction: (2,) direction along x, y.
            height: height at x = y = 0 [m].

        Returns:
            The terrain.

        Raises:
            ValueError: for an angle of a right angle or more, or a value of the wrong shape.
        """
        angle = checks.number("Terrain.slope(angle)", angle)
        if not abs(angle) < 0.5 * np.pi:
            raise ValueError(f"Terrain.slope(angle): expected less than a right angle, got {angle:g} rad")
        u, w = _heading("Terrain.slope(direction)", direction)
        normal = (-np.sin(angle) * u, -np.sin(angle) * w, np.cos(angle))
        return Terrain(plane=(normal, checks.number("Terrain.slope(height)", height) * normal[2]))

    @staticmethod
    def steps(
        rises: Sequence[float],
        depth: float = 0.3,
        start: float = 0.0,
        edge: float = 0.04,
        direction: ArrayLike = (1.0, 0.0),
    ) -> Terrain:
        """Stairs across `direction`, level before and after.

        The ground rises by rises[k] at start + k depth. Each rise is spread over `edge` by the quintic
        6 t^5 - 15 t^4 + 10 t^3: the radius of its edges is edge^2 / (5.77 |rise|) [m], the slope of its face
        1.875 |rise| / edge.

        Args:
            rises: heights of the steps (n,) [m].
            depth: distance between rises [m].
            start: place of the first rise along `direction` [m].
            edge: width of a rise [m], at most `depth`.
            direction: (2,) direction along x, y.

        Returns:
            The terrain.

        Raises:
            ValueError: for an edge wider than the depth, or a value of the wrong shape or out of range.
        """
        call = "Terrain.steps"
        jumps = np.atleast_1d(checks.floats(f"{call}(rises)", rises))
        jumps = checks.array(f"{call}(rises)", jumps, (None,))
        if not len(jumps):
            raise ValueError(f"{call}(rises): expected one step at least, got none")
        depth, edge = (checks.number(f"{call}({n}=...)", v, above=0.0) for n, v in (("depth", depth), ("edge", edge)))
        start = checks.number(f"{call}(start=...)", start)
        if edge > depth:
            raise ValueError(f"{call}(edge=...): expected at most the depth {depth:g}, got {edge:g}")
        dx = edge / _EDGE
        margin = 0.5 * edge + _MARGIN * dx
        lines = ((len(jumps) - 1) * depth + 2.0 * margin) / dx + 1.0
        remedy = "choose a wider edge, or less depth"
        check_room(f"{call}(depth=..., edge=...)", int(min(lines, 1e300)), 32.0 * len(jumps), remedy, "grid lines")
        s = np.arange(-margin, (len(jumps) - 1) * depth + margin + 0.5 * dx, dx)
        t = np.clip((s[:, None] - depth * np.arange(len(jumps))) / edge + 0.5, 0.0, 1.0)
        heights = (t**3 * (10.0 - 15.0 * t + 6.0 * t**2)) @ jumps
        u, w = _heading(f"{call}(direction=...)", direction)
        place = start + s[0]
        return Terrain(heights[:, None], (place * u, place * w), (dx, 1.0), direction=(u, w))

    def height(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Height of the ground.

        Args:
            x: (...,) places along x [m].
            y: (...,) places along y [m].

        Returns:
            (...,) heights [m].

        Raises:
            ValueError: a place is not finite, or the shapes do not fit each other.
        """
        x, y = _places("Terrain.height", x, y)
        if self.plane is not None:
            (a, b, c), d = self.plane
            return np.asarray((d - a * x - b * y) / c)
        return self._spline(self.coefficients, x, y)[0]

    def normal(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Outward normal of the ground.

        Args:
            x: (...,) places along x [m].
            y: (...,) places along y [m].

        Returns:
            (..., 3) unit normals, world axes.

        Raises:
            ValueError: a place is not finite, or the shapes do not fit each other.
        """
        x, y = _places("Terrain.normal", x, y)
        if self.plane is not None:
            return np.array(np.broadcast_to(np.asarray(self.plane[0]), (*x.shape, 3)))
        _, fx, fy = self._spline(self.coefficients, x, y)
        n = np.stack([-fx, -fy, np.ones_like(fx)], axis=-1)
        return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))

    def _spline(self, coefficients: Floats, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """(F, F_x, F_y) of the spline with these coefficients."""
        (ox, oy), (dx, dy), (C, S) = (np.asarray(a, float) for a in (self.origin, self.spacing, self.direction))
        s, t = (C * (x - ox) + S * (y - oy)) / dx, (C * (y - oy) - S * (x - ox)) / dy
        f, fs, ft = spline(coefficients, s, t)
        fs, ft = fs / dx, ft / dy
        return f, C * fs - S * ft, S * fs + C * ft

    def offset(self, radius: float) -> Terrain:
        """The lower bound of the centre of a ball that touches the ground.

        Args:
            radius: radius of the ball [m].

        Returns:
            The terrain of the centres, over a grid wider by the radius.

        Raises:
            ValueError: the radius is negative, or its grid larger than the memory.
        """
        return self._offset(checks.number("Terrain.offset(radius)", radius, at_least=0.0))[0]

    def surface(self, radius: float) -> Terrain:
        """`offset`, computed once per radius.

        Args:
            radius: radius of the ball [m].

        Returns:
            The terrain of the centres.

        Raises:
            ValueError: the radius is negative, or its grid larger than the memory.
        """
        return self._kept(checks.number("Terrain.surface(radius)", radius, at_least=0.0))[0]

    def height_gradient(self, radius: float, rows: Floats) -> Floats:
        """Gradients by the heights, from those by the coefficients of the surface at a radius.

        The surface at a height of its grid is as high as the ground where the ball touches.

        Args:
            radius: radius of the ball [m].
            rows: (n, ncoefficient) gradients by the coefficients of `surface(radius)`.

        Returns:
            (n, nx, ny) gradients by `heights`.

        Raises:
            ValueError: the radius is negative, or the rows have another length.
        """
        radius = checks.number("Terrain.height_gradient(radius)", radius, at_least=0.0)
        surface, touched = self._kept(radius)
        rows = checks.array("Terrain.height_gradient(rows)", rows, (None, surface.coefficients.size))
        gradient = rows.reshape(len(rows), *surface.coefficients.shape)
        if touched is not None:
            kept = self.__dict__.setdefault("_shares", {})
            if radius not in kept:
                kept[radius] = spline_shares(self.coefficients.shape, touched[..., 0], touched[..., 1])
            gradient = spline_gradient(gradient).reshape(len(rows), -1) @ kept[radius]
            gradient = gradient.reshape(-1, *self.coefficients.shape)
        return spline_gradient(gradient)

    def radius_rate(self, radius: float) -> Floats:
        """Rates of the coefficients of `surface` with the radius.

        The surface rises by sqrt(1 + |grad|^2) at the touched ground per unit of the radius.

        Args:
            radius: radius of the ball [m].

        Returns:
            d(coefficients)/d(radius), of their shape.

        Raises:
            ValueError: the radius is negative, or its grid larger than the memory.
        """
        radius = checks.number("Terrain.radius_rate(radius)", radius, at_least=0.0)
        kept: dict[float, Floats] = self.__dict__.setdefault("_rates", {})
        if radius not in kept:
            touched = self._kept(radius)[1]
            if touched is None:
                touched = np.stack(np.meshgrid(*(np.arange(float(n)) for n in self.shape), indexing="ij"), axis=-1)
            _, fs, ft = spline(self.coefficients, touched[..., 0], touched[..., 1])
            dx, dy = np.asarray(self.spacing)
            kept[radius] = spline_coefficients(np.sqrt(1.0 + (fs / dx) ** 2 + (ft / dy) ** 2))
        return kept[radius]

    def _kept(self, radius: float) -> tuple[Terrain, Floats | None]:
        kept = self.__dict__.setdefault("_surfaces", {})
        if radius not in kept:
            kept[radius] = self._offset(radius)
        found: tuple[Terrain, Floats | None] = kept[radius]
        return found

    def _offset(self, radius: float) -> tuple[Terrain, Floats | None]:
        """The surface, and where balls over its grid touch, (..., 2) in our grid; None where it is ourselves."""
        if radius == 0.0 or self.plane is not None:
            return self, None
        spacing, direction = np.asarray(self.spacing), np.asarray(self.direction)
        wider = np.where(np.equal(self.shape, 1), 0.0, np.ceil(radius / spacing) + _MARGIN)
        points = float(np.prod(self.shape + 2.0 * wider))
        check_room("Terrain.offset(radius)", int(min(points, 1e300)), 64.0, "choose a smaller radius", "grid points")
        pads = [int(p) for p in wider]
        lines = [d * np.arange(-p, n + p) for n, d, p in zip(self.shape, spacing, pads, strict=True)]
        here = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
        heights, arm = raised(self.coefficients, spacing, here, radius)
        x, y = (-p * d for p, d in zip(pads, spacing, strict=True))
        start = np.asarray(self.origin) + x * direction + y * np.array([-direction[1], direction[0]])
        return Terrain(heights, start, spacing, direction=direction, name=self.name), (here + arm) / spacing

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of sqrt(1 + |grad F|^2) and of |second derivative| [1/m], from the differences of coefficients."""
        P, (dx, dy) = np.pad(self.coefficients, 2, mode="edge"), np.asarray(self.spacing, float)
        slopes = np.abs(np.diff(P, axis=0)).max() / dx, np.abs(np.diff(P, axis=1)).max() / dy
        xx, yy = np.abs(np.diff(P, 2, axis=0)).max() / dx**2, np.abs(np.diff(P, 2, axis=1)).max() / dy**2
        xy = np.abs(np.diff(np.diff(P, axis=0), axis=1)).max() / (dx * dy)
        return float(np.sqrt(1.0 + np.dot(slopes, slopes))), float(np.sqrt(xx**2 + 2.0 * xy**2 + yy**2))

    @property
    def shape(self) -> tuple[int, int]:
        """Number of grid lines across both axes."""
        nx, ny = self.coefficients.shape
        return nx - 2, ny - 2


def _places(call: str, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
    """Finite places along x and y of the same shape."""
    along, across = checks.floats(f"{call}(x)", x), checks.floats(f"{call}(y)", y)
    along, across = checks.array(f"{call}(x)", along, along.shape), checks.array(f"{call}(y)", across, across.shape)
    try:
        first, second = np.broadcast_arrays(along, across)
    except ValueError:
        raise ValueError(f"{call}(x, y): the shapes {along.shape} and {across.shape} do not fit each other") from None
    return first, second


def _heights(f: Callable[[Floats, Floats], ArrayLike], lines: list[Floats]) -> Floats:
    """(nx, ny) heights of f above the grid."""
    X, Y = np.meshgrid(*lines, indexing="ij")
    values = checks.floats("Terrain.from_function(f)", f(X, Y))
    try:
        values = np.array(np.broadcast_to(values, X.shape))
    except ValueError:
        raise ValueError(f"Terrain.from_function(f): expected shape {X.shape}, got {values.shape}") from None
    return checks.array("Terrain.from_function(f)", values, X.shape)


def _check_linear(
    call: str, f: Callable[[Floats, Floats], ArrayLike], lines: list[Floats], axis: int, heights: Floats
) -> None:
    """Refuse two grid lines along an axis, which were meant as a range, of an f that is not linear between them."""
    between = [0.7 * line[:1] + 0.3 * line[1:] if k == axis else line for k, line in enumerate(lines)]
    first, last = np.split(heights, 2, axis)
    off = float(np.abs(_heights(f, between) - (0.7 * first + 0.3 * last)).max())
    if off > _LINEAR * max(float(np.abs(heights).max()), 1.0):
        low, high = lines[axis]
        raise ValueError(
            f"{call}: expected the grid lines, such as np.linspace({low:g}, {high:g}, 61); two lines give a plane, "
            f"{off:.2g} m off the function between them"
        )


def _heading(call: str, direction: ArrayLike) -> tuple[float, float]:
    """A unit vector in the plane."""
    x, y, _ = checks.direction(call, (*checks.vector(call, direction, 2), 0.0))
    return x, y


def _lines(call: str, given: ArrayLike) -> Floats:
    """Equally spaced grid lines."""
    lines = checks.array(call, given, (None,))
    if len(lines) == 0 or (len(lines) > 1 and not lines[0] < lines[1]):
        raise ValueError(f"{call}: expected increasing numbers, got {lines.tolist()[:3]}...")
    if not np.allclose(np.diff(lines), lines[-1] - lines[-2] if len(lines) > 1 else 0.0, rtol=1e-6, atol=0.0):
        raise ValueError(f"{call}: expected equally spaced grid lines, as of np.linspace")
    return lines
