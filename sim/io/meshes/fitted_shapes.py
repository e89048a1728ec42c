"""Spheres, boxes and capsules fitted to a mesh, and the distances of its corners from their surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.io.meshes.reduced_hull import reduced_hull, with_volume
from sim.mechanism.pose import Pose
from solvers.types import Floats


class Fitted(NamedTuple):
    """A primitive in the frame of the mesh."""

    kind: str  # sphere, box, capsule
    sizes: tuple[float, ...]  # radius; x, y, z; or radius and length [m]
    pose: Pose
    error: float  # largest distance of a corner of the convex hull from the surface [m]


def fit(kind: str, points: Floats) -> Fitted:
    """The primitive of that kind for the convex hull of points (n, 3) [m].

    sphere: of least squares over the surface of the hull. box: the smallest one around the hull that has a side in one
    of the facets of the reduced hull. capsule: along the longest side of that box, around the hull. Points in one
    plane, or on one line, have the thickness of their reduced hull.
    """
    from scipy.spatial import ConvexHull

    points = with_volume(points)
    hull = ConvexHull(points)
    corners = points[hull.vertices]
    if kind == "sphere":
        return _sphere(corners, points[hull.simplices].mean(axis=1))
    few = reduced_hull(corners)[0]  # whose facets are enough to try
    pose, size = _box(corners, ConvexHull(few).equations[:, :3])
    local = (corners - pose.point) @ pose.rotation
    if kind == "box":
        error = float((0.5 * size - np.abs(local)).min(axis=1).max())
        return Fitted("box", tuple(float(s) for s in size), pose, error)
    return _capsule(local, pose, int(size.argmax()))


def _sphere(corners: Floats, middles: Floats) -> Fitted:
    """|x|^2 = 2 c.x + (r^2 - |c|^2), linear in c and r^2 - |c|^2, over the corners and the middles of the facets."""
    x = np.concatenate([corners, middles])
    origin = x.mean(axis=0)
    y = x - origin
    solved = np.linalg.lstsq(np.column_stack([2.0 * y, np.ones(len(y))]), (y * y).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(solved[3] + solved[:3] @ solved[:3]))
    if not np.isfinite(radius) or radius > np.linalg.norm(y, axis=1).max() or np.linalg.norm(solved[:3]) > radius:
        solved, radius = np.zeros(4), float(np.linalg.norm(y, axis=1).mean())  # a surface that is not round
    center = origin + solved[:3]
    error = float(np.abs(np.linalg.norm(corners - center, axis=1) - radius).max())
    return Fitted("sphere", (radius,), Pose(np.eye(3), center), error)


def _box(corners: Floats, normals: Floats) -> tuple[Pose, Floats]:
    """Pose and edges of the smallest box with a side in a facet: over it, the smallest rectangle of the shadow."""
    from scipy.spatial import ConvexHull

    best, turned = np.inf, np.eye(3)
    for n in normals[np.unique(np.round(normals, 6), axis=0, return_index=True)[1]]:
        across = np.linalg.svd(n[None])[2][1:]
        flat = corners @ across.T
        outline = flat[ConvexHull(flat).vertices]
        edges = np.roll(outline, -1, axis=0) - outline
        edges /= np.linalg.norm(edges, axis=1)[:, None]
        sides = [np.ptp(outline @ axes.T, axis=0) for axes in (edges, edges[:, ::-1] * (-1.0, 1.0))]
        areas = sides[0] * sides[1]
        k = int(areas.argmin())
        volume = float(areas[k] * np.ptp(corners @ n))
        if volume < best:
            first = edges[k] @ across
            best, turned = volume, np.column_stack([first, np.cross(n, first), n])
    local = corners @ turned
    low, high = local.min(axis=0), local.max(axis=0)
    return Pose(turned, turned @ (0.5 * (low + high))), high - low


def _capsule(local: Floats, pose: Pose, longest: int) -> Fitted:
    """The capsule about the longest axis of the box, with the radius of the farthest corner and a length to fit."""
    order = [(longest + 1) % 3, (longest + 2) % 3, longest]
    x = local[:, order]
    around = np.linalg.norm(x[:, :2], axis=1)
    radius = float(around.max())
    beyond = np.abs(x[:, 2]) - np.sqrt(radius**2 - around**2)
    half = max(float(beyond.max()), 1e-3 * radius)
    rest = np.stack([around, np.maximum(np.abs(x[:, 2]) - half, 0.0)], axis=1)
    error = float((radius - np.linalg.norm(rest, axis=1)).max())
    return Fitted("capsule", (radius, 2.0 * half), Pose(pose.rotation[:, order], pose.point), max(error, 0.0))
