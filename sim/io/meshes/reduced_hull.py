"""reduced_hull: a convex hull with few corners, and its distance from the full hull."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from solvers.types import Floats

CORNERS = 32  # of a hull at most
THIN = 1e-3  # [m] half thickness that a flat mesh gets


def reduced_hull(points: Floats, corners: int = CORNERS) -> tuple[Floats, float]:
    """Corners (n, 3) of a convex hull inside that of the points, n <= `corners`, and its Hausdorff distance to it [m].

    The first corners are the extremes along the principal axes; each further one is the point farthest outside of the
    facets so far. Points in one plane, or on one line, get a thickness of 2 THIN across.

    The Hausdorff distance of a polytope to one inside of it is taken at a corner of the outer one: it is the largest
    distance of a point from the inner hull.
    """
    return _reduced(np.ascontiguousarray(points, dtype=np.float64).tobytes(), corners)


@lru_cache(maxsize=256)
def _reduced(data: bytes, corners: int) -> tuple[Floats, float]:
    """Result of `reduced_hull`, kept: a robot has a mesh many times."""
    from scipy.spatial import ConvexHull

    points = np.frombuffer(data).reshape(-1, 3)
    spread = with_volume(points)
    full = spread[ConvexHull(spread).vertices]
    if len(full) <= corners:
        return full, 0.0
    chosen = _extremes(full)
    while len(chosen) < corners:
        hull = ConvexHull(full[chosen])
        outside = (full @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        outside[chosen] = -np.inf
        chosen.append(int(outside.argmax()))
    inner = full[chosen]
    return inner, float(distances(full, inner).max())


def _extremes(full: Floats) -> list[int]:
    """Indices of at least four points that span a volume: the extremes along the principal axes, and one off them."""
    centered = full - full.mean(axis=0)
    axes = np.linalg.svd(centered, full_matrices=False)[2]
    along = centered @ axes.T
    chosen = list(dict.fromkeys(int(i) for k in range(3) for i in (along[:, k].argmin(), along[:, k].argmax())))
    while np.linalg.matrix_rank(full[chosen[1:]] - full[chosen[0]], tol=1e-9 * np.abs(centered).max()) < 3:
        base = full[chosen[1:]] - full[chosen[0]]
        rows = np.linalg.svd(base)[2][: np.linalg.matrix_rank(base, tol=1e-9 * np.abs(centered).max())]
        off = (full - full[chosen[0]]) - (full - full[chosen[0]]) @ rows.T @ rows
        chosen.append(int(np.linalg.norm(off, axis=1).argmax()))
    return chosen


def with_volume(points: Floats) -> Floats:
    """The points; where they lie in a plane or on a line, twice, THIN to either side of it."""
    center = points.mean(axis=0)
    sizes, axes = np.linalg.svd(points - center, full_matrices=False)[1:]
    if len(sizes) < 3:  # fewer points than dimensions
        axes = np.linalg.svd(points - center)[2]
    along = (points - center) @ axes.T
    out = points
    for k in range(3):
        if np.ptp(along[:, k]) < 2.0 * THIN * 1e-3:
            out = np.concatenate([out - THIN * axes[k], out + THIN * axes[k]])
    return np.asarray(out)


def distances(points: Floats, corners: Floats) -> Floats:
    """(n,) distances of points from the convex hull of `corners`, zero inside [m]."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    signed = points @ hull.equations[:, :3].T + hull.equations[:, 3]
    outside = signed.max(axis=1) > 0.0
    out = np.zeros(len(points))
    out[outside] = _to_triangles(points[outside], corners[hull.simplices])
    return out


def _to_triangles(points: Floats, triangles: Any) -> Floats:
    """(n,) distance of each point from the nearest of the triangles (k, 3, 3) [m].

    The nearest point is the foot in the plane where that lies inside, or else on one of the edges. One coordinate at a
    time, in arrays (n, k): NumPy is slow along axes of three.
    """
    a, b, c = (triangles[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=-1)
    unit = normal / np.where(area > 0.0, area, 1.0)[:, None]
    height = points @ unit.T - (a * unit).sum(axis=-1)
    inside = np.tile(area > 0.0, (len(points), 1))
    nearest = np.full(height.shape, np.inf)  # squared
    for start, end in ((a, b), (b, c), (c, a)):
        edge, inwards = end - start, np.cross(unit, end - start)
        inside &= points @ inwards.T >= (start * inwards).sum(axis=-1)
        length = np.maximum((edge * edge).sum(axis=-1), 1e-300)
        share = np.clip((points @ edge.T - (start * edge).sum(axis=-1)) / length, 0.0, 1.0)
        offsets = (start[:, k] + share * edge[:, k] - points[:, k : k + 1] for k in range(3))
        nearest = np.minimum(nearest, sum(offset * offset for offset in offsets))
    return np.asarray(np.where(inside, np.abs(height), np.sqrt(nearest)).min(axis=1))
