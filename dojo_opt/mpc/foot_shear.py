"""FootShear: forces between the standing feet, which grow until one of them slides and shows its friction.

Feet that stand tell of their friction only that it is at least what they use. Therefore the inputs get an addition

    tau_j = sum_i dp_i/dq_j . f_i,      f_i = s (m |g|/n) (p_i - p)/max_k |p_k - p|

for the points p_i of the n standing feet and their mean p. The forces f_i on the ground balance one another, and the
robot moves on as planned. The share s of the load grows steadily. When it exceeds the friction, feet slide apart; the
forces then stop for a moment, and begin again at a lower share. They end for good when the friction is known.
"""

from __future__ import annotations

import numpy as np

from dojo_opt.mpc.ground_estimate import Ground
from dojo_opt.mpc.servo import driven
from sim.simulator.adjustable_simulator import AdjustableSimulator
from solvers.types import Flags, Stack, Vector

_BEGIN = 0.15  # [s] until then, masses are found
_STANDING = 2e-3  # [m] gap of a foot that stands
_SETTLED = 0.04  # [s] in which a foot comes to rest on the ground
_FAR = 0.02  # [m] slide of a foot that the robot can bear
_PAUSE = 0.05  # [s] after which it has caught itself
_LESS = 0.85  # share of the forces with which it goes on

__all__ = ["FootShear"]


class FootShear:
    """The additions to the inputs of one controller.

    Args:
        sim: the model, with the masses as they are estimated.
        rate: growth of the share of the load [1/s].

    Raises:
        ValueError: an input acts on a body instead of a joint.
    """

    def __init__(self, sim: AdjustableSimulator, rate: float) -> None:
        self._sim, self._rate = sim, rate
        self._dof = driven(sim, "Adaptation(shear=...)")
        self.forget()

    def forget(self) -> None:
        """Begin anew, with the next call."""
        count = len(self._sim.mechanism.contacts)
        self._first: float | None = None  # time of the first call [s]
        self._last, self._until, self._share, self._ended = -np.inf, -np.inf, 0.0, False
        self._since = np.full(count, np.inf)  # when the feet came to stand [s]
        self._places = np.zeros((count, 3))  # where they came to rest [m]

    def __call__(self, now: float, x: Vector, ground: Ground, known: bool) -> Vector:
        """The addition to the inputs.

        Args:
            now: the time [s].
            x: (nx,) measured state.
            ground: the ground as the controller believes it to be.
            known: whether the friction is known.

        Returns:
            (nu,) forces [N, N m].
        """
        none = np.zeros(self._sim.nu)
        self._first = now if self._first is None else self._first
        passed, self._last = max(0.0, now - max(self._last, self._first + _BEGIN)), now
        self._ended = self._ended or known
        if self._ended or now < self._first + _BEGIN:
            return none
        points = ground.points(x)
        stands = ground.gaps(points) < _STANDING
        if self._slid(now, points, stands):
            self._until, self._share = now + _PAUSE, _LESS * self._share
        if now < self._until or stands.sum() < 2:
            return none
        self._share += self._rate * passed
        forces = self._forces(points[stands])
        columns = ground.point_jacobian(x)[stands][..., self._dof]
        return np.asarray(np.einsum("cxj,cx->j", columns, forces) / self._sim.model.input_wrench[:, 0])

    def _forces(self, points: Stack) -> Stack:
        """(n, 3) forces of the standing feet on the ground [N]."""
        off = points - points.mean(axis=0)
        weight = float(self._sim.model.body_mass.sum() * np.linalg.norm(self._sim.mechanism.gravity))
        return np.asarray(self._share * weight / len(off) * off / np.linalg.norm(off, axis=1).max())

    def _slid(self, now: float, points: Stack, stands: Flags) -> bool:
        """Whether a foot has slid far since it came to rest, or since the last time."""
        self._since = np.where(stands, np.minimum(self._since, now), np.inf)
        coming = stands & (now - self._since < _SETTLED)
        slid = stands & ~coming & (np.linalg.norm(points - self._places, axis=1) > _FAR)
        self._places[coming | slid] = points[coming | slid]
        return bool(slid.any() and now >= self._until)
