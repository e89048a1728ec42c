"""Ground: how far contacts are from it, and its height learnt from what stands on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dojo_opt.policy import Policy
from sim.layout import read_model
from sim.simulator import Simulator

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_TOUCHING = 5e-3  # gap of a contact that counts as touching [m]
_PLANNED = 1e-2  # planned gap of a contact that is meant to stand [m]
_STILL = 0.2  # speed of a contact point that stands [m/s]

__all__ = ["Ground"]


class Ground:
    """The half-spaces under the contacts of a simulator, as that simulator believes them to be.

    `learn` moves them: to the height of every contact that is planned to stand and does not move. It writes into the
    model of this simulator, so give it one of its own (`sim.replace()`).
    """

    def __init__(self, sim: Simulator) -> None:
        self._sim = sim
        contacts = sim.mechanism.contacts
        names = sim.mechanism.body_names
        self.names = sim.mechanism.contact_names
        self._body = np.array([names.index(c.body) for c in contacts], dtype=np.int64)
        self._point = np.array([c.point for c in contacts], dtype=np.float64).reshape(-1, 3)
        self._radius = np.array([c.radius for c in contacts], dtype=np.float64)
        self._normal = sim.mechanism.contact_normals
        self.height = read_model(sim.model_floats, sim.model_ints).contact_height  # (ncontact,) [m], a view
        self._flat = self.height.copy()

    @property
    def rise(self) -> float:
        """Mean height that was learnt, above the one at the beginning [m]."""
        return float(np.mean(self.height - self._flat)) if self.height.size else 0.0

    def forget(self) -> None:
        """Back to the heights at the beginning."""
        self.height[:] = self._flat

    def points(self, x: Vector) -> Matrix:
        """Lowest points of the contacts at x, (ncontact, 3) [m]."""
        z = self._sim.maximal(x)[self._body]
        w, r = z[:, 6:7], z[:, 7:10]
        twice = 2.0 * np.cross(r, self._point)
        turned = self._point + w * twice + np.cross(r, twice)
        return np.asarray(z[:, :3] + turned - self._radius[:, None] * self._normal)

    def gaps(self, x: Vector) -> Vector:
        """Distances of the contacts from their half-spaces at x, (ncontact,) [m]."""
        return np.einsum("ci,ci->c", self._normal, self.points(x)) - self.height

    def touching(self, gaps: Vector) -> tuple[str, ...]:
        """Names of the contacts that touch."""
        return tuple(name for name, gap in zip(self.names, gaps, strict=True) if gap < _TOUCHING)

    def learn(self, policy: Policy, time: float, x: Vector, before: tuple[float, Vector]) -> None:
        """Take the heights of what stands at x, measured at `time`; before: an earlier time and its state."""
        then, x0 = before
        if time <= then:
            return
        points = self.points(x)
        still = np.linalg.norm(points - self.points(x0), axis=1) < _STILL * (time - then)
        stands = still & (self.gaps(policy.state(time)) < _PLANNED)
        self.height[stands] = np.einsum("ci,ci->c", self._normal, points)[stands]
