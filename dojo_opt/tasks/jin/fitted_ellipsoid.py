"""The ellipsoid whose surface is nearest to that of a convex hull."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.spatial import ConvexHull

from sim.mechanism.shapes import Ellipsoid, rotation_matrix
from solvers.rotation import quat_exp
from solvers.types import Floats, Vector

__all__ = ["fitted_ellipsoid"]

_RAYS = 400  # from the middle of the hull to its surface
_LOWEST = 3.0  # weight of the lowest point: objects of plans float or are pushed up where it is another than the hull's
_TURNED = 1e-4  # [m] weight of the turn, which makes it unique for round hulls
_SCALE = np.repeat([0.01, 0.3, 0.3], 3)  # of places [m], logarithms of semi-axes, rotation vector [rad]


def fitted_ellipsoid(points: ArrayLike) -> Ellipsoid:
    """The ellipsoid with the least squares of distances to points on a convex hull, in evenly spread directions.

    That of the same size as the hull encloses much of it where the hull is slender beside its middle, such as an
    airplane: plans that press on it press on nothing.

    Args:
        points: (n, 3) points that span a volume [m]; the third axis points up.

    Returns:
        The ellipsoid.
    """
    rows = np.asarray(points, dtype=np.float64)
    lowest, highest = rows.min(axis=0), rows.max(axis=0)
    surface = _surface(rows, 0.5 * (lowest + highest))

    def errors(v: Vector) -> Vector:
        """Distances along rays from the centre, in the root of their mean square, that of the lowest points, turn."""
        center, axes, turn = v[:3], np.exp(v[3:6]), rotation_matrix(quat_exp(*v[6:]))
        local = (surface - center) @ turn
        distance = np.linalg.norm(local, axis=1) * (1.0 - 1.0 / np.linalg.norm(local / axes, axis=1))
        low = center[2] - np.linalg.norm(turn[2] * axes) - lowest[2]
        return np.concatenate([distance / np.sqrt(_RAYS), [_LOWEST * low], _TURNED * v[6:]])

    start = np.concatenate([0.5 * (lowest + highest), np.log(0.5 * (highest - lowest)), np.zeros(3)])
    best = least_squares(errors, start, x_scale=_SCALE).x
    x, y, z = np.exp(best[3:6])
    return Ellipsoid(x, y, z, center=best[:3], orientation=quat_exp(*best[6:]))


def _surface(points: Floats, middle: Vector) -> Floats:
    """Points (n, 3) where rays from a point inside the hull leave it; directions of a spiral with the golden angle."""
    k = np.arange(_RAYS) + 0.5
    z, angle = 1.0 - 2.0 * k / _RAYS, np.pi * (1.0 + 5.0**0.5) * k
    across = np.sqrt(1.0 - z**2)
    rays = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
    faces = ConvexHull(points).equations
    gaps = -(faces[:, :3] @ middle + faces[:, 3])
    return np.asarray(middle + rays / np.max(rays @ faces[:, :3].T / gaps, axis=1)[:, None])
