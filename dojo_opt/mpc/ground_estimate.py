"""Ground: the distances of the contacts from it, and its height and slope learnt from the stance contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.mpc.policy import Policy
from dojo_opt.planning.manifold import cross
from dojo_opt.plant.ground_plane import GroundPlane
from sim.mechanism.shapes import rotation_matrices
from sim.model.state_columns import BodyState
from sim.simulator.adjustable_simulator import AdjustableSimulator
from solvers.types import Matrix, Stack, Vector

_TOUCHING = 5e-3  # gap of a contact that counts as touching [m]
_PLANNED = 1e-2  # planned gap of a contact that is meant to stand [m]
_STILL = 0.2  # speed of a contact point that stands [m/s]
_BESIDE = 0.03  # gap of a foot that may stand on the plane that is learnt [m]: at the top of a swing it is still, too
_LIGHT = 2.0  # a foot that stands may carry so many times less than its share of the weight
_MEMORY = 0.5  # [s] in which a place where a contact stood loses 63 % of its weight
_STIFF = 1e-4  # [m^2] weight of the slope known before: less than that of two feet 2 cm apart

_NOTHING: tuple[Vector | None, Stack] = (None, np.zeros(0))

__all__ = ["Ground"]


class Ground:
    """The ground under the contacts of a simulator, as that simulator believes it to be.

    `learn` moves it: to the height of every contact that is planned to stand and does not move, or, with `slope`, to
    the plane through the last places of standing contacts, held near the plane before where they do not determine it:

        min  sum_i w_i (z_i - z(p_i))^2 + s |slope - slope before|^2,   w_i = exp(-age/.5 s)

    It writes into the model of this simulator.

    Args:
        sim: the simulator, of its own.
        kappa: smoothing of the plans, if the contacts are on one plane whose slope is to be learnt, too: a foot that
            stands in a plan floats at kappa over its impulse [N s m] (default None: only heights are learnt).

    Raises:
        ValueError: the slope is to be learnt of a robot that does not float, or on ground that is no level plane.
    """

    def __init__(self, sim: AdjustableSimulator, kappa: float | None = None) -> None:
        self._sim = sim
        contacts = sim.mechanism.contacts
        names = sim.mechanism.body_names
        self.names = sim.mechanism.ground_contact_names
        self._body = np.array([names.index(c.body) for c in contacts], dtype=np.int64)
        self._point = np.array([c.point for c in contacts], dtype=np.float64).reshape(-1, 3)
        self._radius = np.array([c.radius for c in contacts], dtype=np.float64)[:, None]
        self._normal = np.array(sim.mechanism.contact_normals)
        self._surfaces = [(k, c.terrain.surface(c.radius)) for k, c in enumerate(contacts) if c.terrain is not None]
        self.height = sim.model.contact_height  # (ncontact,) [m], a view
        self._flat, self._level = self.height.copy(), self._normal.copy()
        self._slope, self._planned = kappa is not None, _PLANNED
        if kappa is not None:
            self._check_level()
            self._planned += _LIGHT * kappa / (sim.time_step * self._load())
        self.forget()

    def _check_level(self) -> None:
        """Refuse to learn a slope unless there is a level plane under a floating base."""
        mechanism, flat = self._sim.mechanism, self._flat
        level = not self._surfaces and np.all(self._level == (0.0, 0.0, 1.0)) and np.all(flat == flat[:1])
        if not level or mechanism.joints[0].kind != "floating" or flat.size == 0:
            raise ValueError(
                f"MPC(learn_ground='slope'): expected a robot on a floating base with contacts on one level plane, "
                f"got {mechanism!r}"
            )

    def _load(self) -> float:
        """Weight that a foot carries when all stand [N]."""
        mechanism = self._sim.mechanism
        inner = {joint.parent for joint in mechanism.joints}
        feet = sum(contact.body not in inner for contact in mechanism.contacts)
        return float(np.linalg.norm(mechanism.gravity)) * sum(body.mass for body in mechanism.bodies) / max(feet, 1)

    @property
    def rise(self) -> float:
        """Mean height that was learnt, above the one at the beginning [m]."""
        return float(np.mean(self.height - self._flat)) if self.height.size else 0.0

    @property
    def plane(self) -> GroundPlane:
        """The learnt change of the ground: references made for the initial ground are carried onto it."""
        if not self._slope:
            return GroundPlane(self.rise)
        n = self._normal[0]
        return GroundPlane(float(self.height[0] / n[2] - self._flat[0]), (-n[0] / n[2], -n[1] / n[2]))

    @property
    def normal(self) -> Vector | None:
        """(3,) normal of the plane that is learnt; None where only heights are."""
        return self._normal[0] if self._slope else None

    def forget(self) -> None:
        """Back to the ground at the beginning."""
        self.height[:] = self._flat
        if self._slope:
            self._turn(self._level[0])
        self._seen = _NOTHING  # the state learnt from last, and its points
        self._places = np.zeros((len(self.names), 3))  # where contacts stood last [m]
        self._stood = np.full(len(self.names), -np.inf)  # when [s]

    def _turn(self, normal: Vector) -> None:
        """Turn the ground under all contacts to a unit normal (3,)."""
        self._normal[:] = normal
        self._sim.turn_ground(normal)

    def points(self, xs: ArrayLike) -> Stack:
        """Lowest points of the contacts at the states xs (..., nx), (..., ncontact, 3) [m]."""
        z = self._sim.maximal(xs)[..., self._body, :]
        w, r = z[..., BodyState.SCALAR], z[..., BodyState.VECTOR]
        twice = 2.0 * cross(r, self._point)
        return np.asarray(
            z[..., BodyState.POSITION] + self._point + w * twice + cross(r, twice) - self._radius * self._normal
        )

    def point_jacobian(self, x: ArrayLike) -> Stack:
        """d(points)/d(coordinates) at the state x (nx,), as of the bodies there: (ncontact, 3, nv)."""
        z = self._sim.maximal(x)[self._body]
        R = rotation_matrices(z[:, BodyState.QUATERNION])
        slopes = self._sim.maximal_jacobian(x).reshape(-1, 4, 3, self._sim.ndx)[self._body, ..., : self._sim.nv]
        arms = (R @ self._point[..., None])[..., 0] - self._radius * self._normal
        turns = R @ slopes[:, 2]  # about world axes
        return np.asarray(slopes[:, 0] + np.cross(turns, arms[..., None], axis=1))

    def gaps(self, points: Stack) -> Matrix:
        """Distances of the points (..., ncontact, 3) of the contacts from their ground, (..., ncontact) [m]."""
        out = np.asarray((self._normal * points).sum(axis=-1) - self.height)
        for k, surface in self._surfaces:  # vertically: the height that is learnt is added to it
            centers = points[..., k, :] + self._radius[k] * self._normal[k]
            out[..., k] = centers[..., 2] - surface.height(centers[..., 0], centers[..., 1]) - self.height[k]
        return out

    def touching(self, x: Vector) -> tuple[str, ...]:
        """Names of the contacts that touch at x."""
        gaps = self.gaps(self._seen[1] if self._seen[0] is x else self.points(x))
        return tuple(name for name, gap in zip(self.names, gaps, strict=True) if gap < _TOUCHING)

    def learn(self, policy: Policy, time: float, x: Vector, before: tuple[float, Vector]) -> None:
        """Take the ground from the contacts that stand at x, measured at `time`; before: an earlier sample."""
        then, x0 = before
        self._seen = _NOTHING
        if time <= then:
            return
        now, earlier, planned = self.points(np.stack([x, x0, policy.state(time)]))
        if not self._slope:  # points lie on balls, and move as the normal turns
            self._seen = x, now
        still = ((now - earlier) ** 2).sum(axis=1) < (_STILL * (time - then)) ** 2
        stands = still & (self.gaps(planned) < self._planned)
        if not self._slope:
            self.height[stands] += self.gaps(now)[stands]
            return
        stands &= self.gaps(now) < _BESIDE
        if stands.any():
            self._places[stands], self._stood[stands] = now[stands], time
            self._fit(time)

    def _fit(self, time: float) -> None:
        """Lay the plane through the places where contacts stood."""
        w = np.exp((self._stood - time) / _MEMORY)
        mean = w @ self._places / w.sum()
        off, slope = self._places - mean, np.array(self.plane.slope)
        along = w[:, None] * off[:, :2]
        slope += np.linalg.solve(along.T @ off[:, :2] + _STIFF * np.eye(2), along.T @ (off[:, 2] - off[:, :2] @ slope))
        normal = GroundPlane(0.0, (float(slope[0]), float(slope[1]))).normal
        self._turn(normal)
        self.height[:] = normal @ mean
