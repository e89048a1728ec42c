"""GroundBalls: the contacts of a mechanism with the ground as arrays, for kinematics in Python."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.mechanism.contact import Contact
from sim.mechanism.shapes import cross_matrix
from sim.model.state_columns import BodyState
from solvers.types import Floats

__all__ = ["GroundBalls"]


class GroundBalls:
    """Balls of bodies beside the ground.

    Args:
        contacts: k contacts.
        bodies: number of the body of each.

    Attributes:
        friction: (k,) coefficients of friction; zero where the law has none.
    """

    def __init__(self, contacts: Sequence[Contact], bodies: Sequence[int]) -> None:
        self._contacts, self._bodies = contacts, np.array(bodies, dtype=np.int64)
        self._points = np.array([c.point for c in contacts], dtype=np.float64).reshape(-1, 3)
        self._normals = np.array([c.normal for c in contacts], dtype=np.float64).reshape(-1, 3)
        self._away = np.array([c.radius + c.height for c in contacts], dtype=np.float64)
        self._uneven = [i for i, c in enumerate(contacts) if c.terrain is not None]
        self.friction = np.array([0.0 if c.law == "impact" else c.friction for c in contacts], dtype=np.float64)

    def places(self, at: Floats, R: Floats) -> tuple[Floats, Floats]:
        """Centres of the balls, and their distances from the ground.

        Args:
            at: (nbody, 3) places of the bodies [m].
            R: (nbody, 3, 3) their rotations.

        Returns:
            (centres (k, 3), gaps (k,)) [m].
        """
        centers = at[self._bodies] + (R[self._bodies] @ self._points[..., None])[..., 0]
        gap = np.einsum("ka,ka->k", centers, self._normals) - self._away
        for i in self._uneven:
            gap[i] = self._contacts[i].gap(centers[i])
        return centers, gap

    def force_map(self, i: int, center: Floats, z: Floats, J: Floats) -> tuple[Floats, Floats]:
        """Generalised forces per unit of normal and tangential forces at the point of a ball nearest to the ground.

        Args:
            i: number of the ball.
            center: (3,) its centre [m].
            z: (nbody, 13) maximal states of the bodies.
            J: (nbody, 6, nv) Jacobians of the bodies.

        Returns:
            (forces (nv, 3), directions (3, 3) by rows in world axes: the normal, and two tangents).
        """
        contact, body = self._contacts[i], self._bodies[i]
        n = np.asarray(contact.normal_at(center), dtype=np.float64)
        k = int(np.abs(n).argmin())
        first = cross_matrix(n) @ np.eye(3)[k]
        first /= np.linalg.norm(first)
        frame = np.stack([n, first, cross_matrix(n) @ first])
        arm = center - contact.radius * n - z[body, BodyState.POSITION]
        return ((frame @ J[body, :3]) - (frame @ cross_matrix(arm)) @ J[body, 3:]).T, frame
