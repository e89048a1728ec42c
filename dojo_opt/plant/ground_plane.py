"""GroundPlane: a controller's estimate of the ground as a plane, and references on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pose import quat_product
from sim.model.state_columns import BaseState
from solvers.types import Matrix, Vector

__all__ = ["GroundPlane"]


class GroundPlane(NamedTuple):
    """The plane z = height + slope . (x, y).

    Attributes:
        height: height at the origin [m].
        slope: (2,) rise along x and along y [m/m].
    """

    height: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)

    @property
    def normal(self) -> Vector:
        """(3,) upward unit normal."""
        a, b = self.slope
        return np.array([-a, -b, 1.0]) / np.sqrt(1.0 + a * a + b * b)

    @property
    def level(self) -> bool:
        """Whether it does not slope."""
        return self.slope == (0.0, 0.0)

    def carry(self, x: ArrayLike, mechanism: Mechanism) -> Matrix:
        """States of a robot on the ground z = 0, carried onto the plane: turned with it above the same x and y.

        On a level plane the base is raised; one that cannot rise stays where it is. Only a floating base is turned.

        Args:
            x: (n, nx) states.
            mechanism: the robot; its first base is carried.

        Returns:
            (n, nx) states.
        """
        out, nq = np.array(x, dtype=np.float64), mechanism.nq
        if self.level:
            for _, places, rates in mechanism.rising_bases[:1]:
                out[:, places] += self.height * rates
            return out
        n = self.normal
        out[:, 2] = self.height + out[:, :2] @ np.asarray(self.slope) + out[:, 2] / n[2]
        turn = _upright(n)
        out[:, BaseState.QUATERNION] = quat_product(turn, out[:, BaseState.QUATERNION])
        out[:, nq : nq + 3] = _turned(turn, out[:, nq : nq + 3])
        return out


def _upright(n: Vector) -> Vector:
    """(4,) quaternion of the shortest turn from the vertical to n."""
    half = np.array([1.0 + n[2], -n[1], n[0], 0.0])
    return np.asarray(half / np.linalg.norm(half))


def _turned(q: Vector, v: Matrix) -> Matrix:
    """Vectors (n, 3) turned by a quaternion (4,)."""
    twice = 2.0 * np.cross(q[1:], v)
    return np.asarray(v + q[0] * twice + np.cross(q[1:], twice))
