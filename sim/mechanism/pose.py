"""Pose of a frame in another one; and quaternions from the angles of URDF files."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from solvers.rotation import quat_mul
from solvers.types import Floats


class Pose(NamedTuple):
    """Rotation (3, 3) and origin (3,) [m] of a frame in another one."""

    rotation: Floats
    point: Floats

    def then(self, inner: Pose) -> Pose:
        """The pose in the outer frame that corresponds to the pose `inner` in this one."""
        return Pose(self.rotation @ inner.rotation, self.at(inner.point))

    def at(self, point: ArrayLike) -> Floats:
        """A point of this frame, in the outer one."""
        return np.asarray(self.rotation @ np.asarray(point, dtype=np.float64) + self.point)

    @property
    def quaternion(self) -> tuple[float, ...]:
        """The rotation as a unit quaternion (w, x, y, z)."""
        return quaternion(self.rotation)


HERE = Pose(np.eye(3), np.zeros(3))


def roll_pitch_yaw(angles: ArrayLike) -> Floats:
    """Rz(yaw) Ry(pitch) Rx(roll), (3, 3): the fixed-axis angles of URDF [rad]."""
    (r, p, y) = np.asarray(angles, dtype=np.float64)
    cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def turn(axis: ArrayLike, angle: float) -> Floats:
    """Rotation (3, 3) by an angle [rad] about a unit axis: cos I + sin [a] + (1 - cos) a a^T."""
    a = np.asarray(axis, dtype=np.float64)
    cross = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    return np.asarray(np.cos(angle) * np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * np.outer(a, a))


def quat_product(a: ArrayLike, b: ArrayLike) -> Floats:
    """Hamilton products of quaternions (..., 4), those of `quat_mul` with NumPy's arrays, broadcast."""
    parts = (*np.moveaxis(np.asarray(a, dtype=np.float64), -1, 0), *np.moveaxis(np.asarray(b, dtype=np.float64), -1, 0))
    return np.stack(getattr(quat_mul, "py_func", quat_mul)(*parts), axis=-1)


def quaternion(rotation: Floats) -> tuple[float, ...]:
    """Unit quaternion (w, x, y, z) of a rotation matrix, w >= 0; from its largest component, so without cancellation.

    4 q q^T in terms of R: the row of the largest diagonal entry is q up to its length (Shepperd 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = np.asarray(rotation).tolist()  # arrays of three take five times as long
    wx, wy, wz, xy, xz, yz = h - f, c - g, d - b, d + b, c + g, h + f
    diagonal = (1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i)
    rows = (
        (diagonal[0], wx, wy, wz),
        (wx, diagonal[1], xy, xz),
        (wy, xy, diagonal[2], yz),
        (wz, xz, yz, diagonal[3]),
    )
    row = rows[diagonal.index(max(diagonal))]
    length = sqrt(sum(x * x for x in row)) * (1.0 if row[0] >= 0.0 else -1.0)
    return tuple(x / length for x in row)
