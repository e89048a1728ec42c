"""Ground: the distances of the contacts from it, and its height learnt from the contacts that stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.mpc.policy import Policy
from dojo_opt.planning.manifold import cross
from sim.simulator.simulator import Simulator

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]

_TOUCHING = 5e-3  # gap of a contact that counts as touching [m]
_PLANNED = 1e-2  # planned gap of a contact that is meant to stand [m]
_STILL = 0.2  # speed of a contact point that stands [m/s]

__all__ = ["Ground"]


class Ground:
    """The ground under the contacts of a simulator, as that simulator believes it to be.

    `learn` moves them: to the height of every contact that is planned to stand and does not move. It writes into the
    model of this simulator, so give it one of its own (`sim.replace()`).
    """

    def __init__(self, sim: Simulator) -> None:
        self._sim = sim
        contacts = sim.mechanism.contacts
        names = sim.mechanism.body_names
        self.names = sim.mechanism.contact_names[: len(contacts)]  # those with the ground, collisions are no ground
        self._body = np.array([names.index(c.body) for c in contacts], dtype=np.int64)
        self._point = np.array([c.point for c in contacts], dtype=np.float64).reshape(-1, 3)
        self._normal = sim.mechanism.contact_normals
        self._lowest = np.array([c.radius for c in contacts], dtype=np.float64)[:, None] * self._normal
        self._surfaces = [(k, c.terrain.surface(c.radius)) for k, c in enumerate(contacts) if c.terrain is not None]
        self.height = sim.model.contact_height  # (ncontact,) [m], a view
        self._flat = self.height.copy()

    @property
    def rise(self) -> float:
        """Mean height that was learnt, above the one at the beginning [m]."""
        return float(np.mean(self.height - self._flat)) if self.height.size else 0.0

    def forget(self) -> None:
        """Back to the heights at the beginning."""
        self.height[:] = self._flat

    def points(self, xs: ArrayLike) -> Stack:
        """Lowest points of the contacts at the states xs (..., nx), (..., ncontact, 3) [m]."""
        z = self._sim.maximal(xs)[..., self._body, :]
        w, r = z[..., 6:7], z[..., 7:10]
        twice = 2.0 * cross(r, self._point)
        return np.asarray(z[..., :3] + self._point + w * twice + cross(r, twice) - self._lowest)

    def gaps(self, points: Stack) -> Matrix:
        """Distances of the points (..., ncontact, 3) of the contacts from their ground, (..., ncontact) [m]."""
        out = np.asarray((self._normal * points).sum(axis=-1) - self.height)
        for k, surface in self._surfaces:  # vertically: the height that is learnt is added to it
            centres = points[..., k, :] + self._lowest[k]
            out[..., k] = centres[..., 2] - surface.height(centres[..., 0], centres[..., 1]) - self.height[k]
        return out

    def touching(self, x: Vector) -> tuple[str, ...]:
        """Names of the contacts that touch at x."""
        gaps = self.gaps(self.points(x))
        return tuple(name for name, gap in zip(self.names, gaps, strict=True) if gap < _TOUCHING)

    def learn(self, policy: Policy, time: float, x: Vector, before: tuple[float, Vector]) -> None:
        """Take the heights of the contacts that stand at x, measured at `time`; before: an earlier sample."""
        then, x0 = before
        if time <= then:
            return
        now, earlier, planned = self.points(np.stack([x, x0, policy.state(time)]))
        still = ((now - earlier) ** 2).sum(axis=1) < (_STILL * (time - then)) ** 2
        stands = still & (self.gaps(planned) < _PLANNED)
        self.height[stands] += self.gaps(now)[stands]
