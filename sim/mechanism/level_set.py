"""LevelSet: the solid phi < 0 of a field on a grid: spline, surface, moments. Compiled code reads `table`
(sim/contact/collision/level_set.py).

Shapes with the same values share one LevelSet, and one table.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import product
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.spline import spline_basis, spline_coefficients_along
from solvers.types import Floats, Integers

_PARTS = 4  # of a cell along each axis, where its volume is counted
_CHUNK = 20_000  # points at once
_RETURNS = 30  # steps to the level set
_KNOWN: WeakValueDictionary[tuple[int, tuple[float, ...], float], LevelSet] = WeakValueDictionary()
_CORNERS = np.array(list(product((0, 1), repeat=3)))


class LevelSet:
    """The solid phi < 0, phi a cubic B-spline through values on a grid, not-a-knot at the edges of the grid.

    Attributes:
        values: (nx, ny, nz) values of phi.
        origin: (3,) place of the first of them [m].
        spacing: distance of neighbours [m].
        coefficients: (nx + 2, ny + 2, nz + 2) of the spline.
    """

    def __init__(self, values: Floats, origin: Floats, spacing: float) -> None:
        self.values, self.origin, self.spacing = values, origin, spacing
        self.coefficients = values
        for axis in range(3):
            self.coefficients = spline_coefficients_along(self.coefficients, axis)

    @cached_property
    def table(self) -> Floats:
        """(n, 4) rows for `Model.hull`."""
        head = [*self.coefficients.shape, 1.0 / self.spacing, *self.origin, 0.0]
        flat = np.concatenate([head, self.coefficients.ravel()])
        return np.concatenate([flat, np.zeros(-len(flat) % 4)]).reshape(-1, 4)

    def field(self, points: Floats) -> tuple[Floats, Floats]:
        """phi (n,) and its gradient (n, 3) [1/m] at points (n, 3) [m]; beyond the grid, those of its edge."""
        values, gradients = np.empty(len(points)), np.empty((len(points), 3))
        for start in range(0, len(points), _CHUNK):
            s = (points[start : start + _CHUNK] - self.origin) / self.spacing
            s = np.clip(s, 0.0, np.array(self.values.shape) - 1.0)
            (a, da, i), (b, db, j), (c, dc, k) = (spline_basis(s[:, e], self.coefficients.shape[e]) for e in range(3))
            part = self.coefficients[i[:, :, None, None], j[:, None, :, None], k[:, None, None, :]]
            along = np.einsum("nijk,nk->nij", part, c)
            here = slice(start, start + len(s))
            values[here] = np.einsum("nij,ni,nj->n", along, a, b)
            gradients[here, 0] = np.einsum("nij,ni,nj->n", along, da, b)
            gradients[here, 1] = np.einsum("nij,ni,nj->n", along, a, db)
            gradients[here, 2] = np.einsum("nijk,ni,nj,nk->n", part, a, b, dc, optimize=True)
        return values, gradients / self.spacing

    def settled(self, points: Floats) -> tuple[Floats, Floats]:
        """The level set from points (n, 3) along the gradient, and its outward normals (n, 3)."""
        x = points
        for _ in range(_RETURNS):
            f, g = self.field(x)
            step = -f / np.maximum((g * g).sum(axis=1), 1e-300)
            step = step[:, None] * g
            size = np.linalg.norm(step, axis=1)
            x = x + step * np.minimum(1.0, self.spacing / np.maximum(size, 1e-300))[:, None]
            if size.max(initial=0.0) < 1e-12 * self.spacing:
                break
        g = self.field(x)[1]
        return x, g / np.maximum(np.linalg.norm(g, axis=1), 1e-300)[:, None]

    @cached_property
    def mixed(self) -> NDArray[np.bool_]:
        """(nx - 1, ny - 1, nz - 1) cells with corners on both sides of the level set."""
        low = [slice(0, -1), slice(1, None)]
        signs = [self.values[low[a], low[b], low[c]] < 0.0 for a, b, c in _CORNERS.tolist()]
        return np.asarray(np.any(signs, axis=0) & ~np.all(signs, axis=0))

    @cached_property
    def surface(self) -> tuple[Floats, Integers]:
        """Vertices (n, 3) on the level set [m], and triangles (k, 3), counter-clockwise seen from outside.

        One vertex in each mixed cell, at the mean of the crossings of its edges, then moved to the level set; four of
        them around an edge of the grid that crosses it (surface nets, Gibson 1998).
        """
        cells = np.argwhere(self.mixed)
        number = np.full(self.mixed.shape, -1, dtype=np.int64)
        number[tuple(cells.T)] = np.arange(len(cells))
        total, count = np.zeros((len(cells), 3)), np.zeros(len(cells))
        quads = []
        for axis in range(3):
            ahead = np.eye(3, dtype=np.int64)[axis]
            n = np.array(self.values.shape) - ahead
            a = self.values[: n[0], : n[1], : n[2]]
            b = self.values[ahead[0] :, ahead[1] :, ahead[2] :]
            crossing = (a < 0.0) != (b < 0.0)
            at = np.argwhere(crossing)
            t = (a[crossing] / (a[crossing] - b[crossing]))[:, None]
            out = a[crossing] < 0.0  # the solid is behind
            u, v = np.eye(3, dtype=np.int64)[(axis + 1) % 3], np.eye(3, dtype=np.int64)[(axis + 2) % 3]
            around = [number[tuple((at - i * u - j * v).T)] for i, j in ((1, 1), (0, 1), (0, 0), (1, 0))]
            for cell in around:
                np.add.at(total, cell, at + t * ahead)
                np.add.at(count, cell, 1.0)
            quad = np.stack(around, axis=1)
            quads.append(np.where(out[:, None], quad, quad[:, ::-1]))
        vertices = self.settled(self.origin + self.spacing * total / count[:, None])[0]
        corners = np.concatenate(quads)
        return vertices, np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])

    def moments(self, offset: float) -> tuple[float, Floats, Floats]:
        """Volume, integral of x (3,), and of x x^T (3, 3), of the solid with an offset.

        Cells near the surface are counted in parts, each by the share of it that a plane leaves inside.

        Raises:
            ValueError: the solid with its offset reaches beyond the grid, where phi is not known.
        """
        if offset > 0.0 and not self._edge_distance > offset:
            raise ValueError(
                f"SignedDistance(offset=...): with an offset of {offset:g} m the solid reaches beyond its grid, whose "
                f"edge is {self._edge_distance:.3g} m away, and volume and inertia are counted inside: take a larger "
                "grid, or give Body(inertia=...) where the body has no other shape"
            )
        from scipy.ndimage import binary_dilation

        h = self.spacing
        near = binary_dilation(self.mixed, np.ones((3, 3, 3)), iterations=1 + int(np.ceil(offset / h)))
        low = [slice(0, -1), slice(1, None)]
        full = ~near & (self.values[low[0], low[0], low[0]] < 0.0)
        centers = self.origin + h * (np.argwhere(full) + 0.5)
        volume, first = h**3 * len(centers), h**3 * centers.sum(axis=0)
        second = h**3 * (centers.T @ centers + len(centers) * h**2 / 12.0 * np.eye(3))
        small = h / _PARTS
        for x in self._parts(np.argwhere(near)):
            f, g = self.field(x)
            size = np.linalg.norm(g, axis=1)
            width = small * np.abs(g).sum(axis=1)
            inside = small**3 * np.clip(0.5 - (f - offset * size) / np.maximum(width, 1e-300), 0.0, 1.0)
            volume += inside.sum()
            first += inside @ x
            second += (x * inside[:, None]).T @ x + inside.sum() * small**2 / 12.0 * np.eye(3)
        return float(volume), first, second

    @cached_property
    def _edge_distance(self) -> float:
        """Least distance of the level set from the outermost grid points, as phi and its gradient tell [m]."""
        outer = np.ones(self.values.shape, dtype=bool)
        outer[1:-1, 1:-1, 1:-1] = False
        f, g = self.field(self.origin + self.spacing * np.argwhere(outer))
        return float((f / np.maximum(np.linalg.norm(g, axis=1), 1e-300)).min())

    def _parts(self, cells: Integers) -> Iterator[Floats]:
        """Centres of the parts of cells, in portions that fit the memory."""
        steps = (np.array(list(product(range(_PARTS), repeat=3))) + 0.5) / _PARTS
        for start in range(0, len(cells), _CHUNK // 64):
            some = cells[start : start + _CHUNK // 64]
            yield self.origin + self.spacing * (some[:, None, :] + steps).reshape(-1, 3)


def level_set(values: Floats, origin: Floats, spacing: float) -> LevelSet:
    """The LevelSet of read-only values, the same one as long as it is in use."""
    key = (id(values), tuple(origin.tolist()), spacing)
    found = _KNOWN.get(key)
    if found is None:
        found = LevelSet(values, origin, spacing)
        _KNOWN[key] = found
    return found
