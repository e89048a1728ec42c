"""Feet: the balls by which a robot stands on the ground, their places, and the joint angles for given places."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.manifold import cross
from sim.mechanism import checks
from sim.mechanism.contact import Contact
from sim.mechanism.joint import require_floating_base
from sim.model.interruptible_loops import rows
from sim.model.state_columns import BodyState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["Feet"]

_STEP = 1e-6  # of the differences: positions are smooth in the angles, so its square is the error
_ITERATIONS = 50
_PROGRESS, _PATIENCE = 0.999, 8  # a target that is not nearer after so many iterations is out of reach
_CLOSE = 1e-10  # [m] a foot this near to its target is there
_DAMPING = 1e-8  # keeps a stretched leg solvable


class Feet:
    """Contacts of a robot as points that move with its state.

    The first joint of the mechanism is the base of the robot; the others are its legs.

    Args:
        sim: simulator of the robot.
        names: names of k contacts (default None: those of the bodies at the ends of the tree).

    Raises:
        ValueError: a name is unknown, or no body at the end of the tree has a contact.
    """

    def __init__(self, sim: Simulator, names: Sequence[str] | None = None) -> None:
        mech = sim.mechanism
        inner = {joint.parent for joint in mech.joints}
        if names is None:
            names = [c.name for c in mech.contacts if c.body not in inner]
        if not names:
            raise ValueError(f"Feet({mech.name!r}): no body at the end of the tree has a contact; give names=...")
        for name in names:
            checks.one_of("Feet(names=...)", name, mech.ground_contact_names)
        self.sim = sim
        self.names = tuple(names)
        self.contacts = [mech.contacts[mech.ground_contact_names.index(name)] for name in names]
        self.base = mech.joints[0].nv
        self._body = np.array([mech.body_names.index(c.body) for c in self.contacts])
        self._point = np.array([np.asarray(c.point) for c in self.contacts])
        self.radius = np.array([c.radius for c in self.contacts])
        self.normal = np.array([np.asarray(c.normal) for c in self.contacts])
        self.height = np.array([c.height for c in self.contacts])
        self._grounds = _grounds(self.contacts)

    @property
    def flat(self) -> bool:
        """Whether some feet have several contacts, and so an attitude on the ground."""
        return len({contact.body for contact in self.contacts}) < len(self.contacts)

    def positions(self, x: ArrayLike) -> Floats:
        """Places of the balls.

        Args:
            x: (..., nx) states.

        Returns:
            (..., k, 3) centres, world axes [m].
        """
        z = self.sim.maximal(x)[..., self._body, :]
        w, v = z[..., BodyState.SCALAR], z[..., BodyState.VECTOR]
        side = cross(v, self._point)
        return np.asarray(z[..., BodyState.POSITION] + self._point + 2.0 * (w * side + cross(v, side)))

    def gaps(self, x: ArrayLike) -> Floats:
        """Distances of the balls from the ground.

        Args:
            x: (..., nx) states.

        Returns:
            (..., k) distances [m].
        """
        at = self.positions(x)
        out = np.empty(at.shape[:-1])
        for contact, on in self._grounds:
            out[..., on] = contact.gap(at[..., on, :])
        return out

    def landed(self, x: Floats) -> Floats:
        """Places of the balls where the feet stand below or above where they are.

        The balls of a body move down or up together, until the lowest one touches the ground: a sole that is not quite
        flat, as the hull of a mesh, keeps its form.

        Args:
            x: (nx,) state.

        Returns:
            (k, 3) centres, world axes [m].
        """
        out, gaps = self.positions(x), self.gaps(x)
        for body in set(self._body.tolist()):
            out[self._body == body, 2] -= gaps[self._body == body].min()
        return out

    def put_down(self, x: Floats) -> Floats:
        """Move a robot on a floating base up or down until its lowest ball touches the ground.

        Args:
            x: (nx,) state.

        Returns:
            (nx,) state.

        Raises:
            ValueError: the robot has no floating base, or no height is found at which it touches the ground.
        """
        require_floating_base("Feet.put_down(x)", self.sim.mechanism.joints[0])
        out = x.copy()
        for _ in range(_ITERATIONS):
            least = float((self.gaps(out) / self.normals(out)[:, 2]).min())
            out[2] -= least
            if abs(least) < _CLOSE:
                return out
        raise ValueError(
            f"Feet.put_down(x): found no height at which the lowest ball touches the ground near {out[:2]}"
        )

    def normals(self, x: Floats) -> Floats:
        """Outward normals of the ground at the balls.

        Args:
            x: (nx,) state.

        Returns:
            (k, 3) unit normals, world axes.
        """
        at = self.positions(x)
        out = np.empty(at.shape)
        for contact, on in self._grounds:
            out[on] = contact.normal_at(at[on])
        return out

    def touching(self, x: Floats) -> Feet:
        """The points of the balls nearest to the ground, instead of their centres.

        Args:
            x: (nx,) state that determines the points.

        Returns:
            The points, fixed on their bodies.
        """
        z = self.sim.maximal(x)[self._body]
        w, v, arm = z[:, BodyState.SCALAR], -z[:, BodyState.VECTOR], -self.radius[:, None] * self.normals(x)
        side = cross(v, arm)
        other = copy.copy(self)
        other._point = self._point + arm + 2.0 * (w * side + cross(v, side))
        return other

    def jacobian(self, x: ArrayLike) -> Floats:
        """Derivatives of the positions by the coordinates, by central differences.

        Args:
            x: (..., nx) states.

        Returns:
            (..., k, 3, nv) derivatives.
        """
        states = np.asarray(x, dtype=float)
        if states.ndim == 1:
            return self._slopes(states)
        flat = states.reshape(-1, self.sim.nx)
        out = np.empty((len(flat), len(self.names), 3, self.sim.nv))
        for part in rows(len(flat)):  # in pieces, so that Python can handle Ctrl-C between them
            out[part] = self._slopes(flat[part])
        return out.reshape(*states.shape[:-1], *out.shape[1:])

    def _slopes(self, x: Floats) -> Floats:
        """`jacobian` of states (..., nx), which takes 2 nv states for each of them."""
        sim = self.sim
        steps = np.zeros((2 * sim.nv, sim.ndx))
        steps[: sim.nv, : sim.nv] = _STEP * np.eye(sim.nv)
        steps[sim.nv :] = -steps[: sim.nv]
        moved = self.positions(sim.integrate(x[..., None, :], steps))
        slope = (moved[..., : sim.nv, :, :] - moved[..., sim.nv :, :, :]) / (2.0 * _STEP)
        return np.moveaxis(slope, -3, -1)

    def place(self, x: ArrayLike, targets: ArrayLike) -> Floats:
        """Inverse kinematics: joint angles for given places of the feet, with a fixed base.

        Damped Gauss-Newton starts at the joint angles of x, so a knee stays bent to its side. It solves all states at
        once.

        Args:
            x: (n, nx) or (nx,) states.
            targets: (n, k, 3) centres of the balls, world axes [m].

        Returns:
            (n, nx) states.

        Raises:
            ValueError: a target is out of reach, or requires a joint beyond its limits.
        """
        sim, nb = self.sim, self.base
        x = np.array(np.broadcast_to(x, (len(np.asarray(targets)), sim.nx)), dtype=float)
        goal = checks.array("Feet.place(targets)", targets, (len(x), len(self.names), 3))
        least, waited = np.inf, 0
        for _ in range(_ITERATIONS):
            error = (goal - self.positions(x)).reshape(len(x), -1)
            worst = float(np.abs(error).max())
            least, waited = (worst, 0) if worst < _PROGRESS * least else (least, waited + 1)
            if worst <= _CLOSE or waited > _PATIENCE:
                break
            J = self.jacobian(x)[..., nb:].reshape(len(x), error.shape[1], -1)
            H = np.einsum("nij,nik->njk", J, J) + _DAMPING * np.eye(J.shape[2])
            step = np.linalg.solve(H, np.einsum("nij,ni->nj", J, error)[..., None])[..., 0]
            step *= np.minimum(1.0, 0.5 / np.abs(step).max(axis=1, keepdims=True).clip(1e-12))  # half a radian at most
            x = sim.integrate(x, np.concatenate([np.zeros((len(x), nb)), step, np.zeros((len(x), sim.nv))], axis=1))
        miss = np.linalg.norm(goal - self.positions(x), axis=-1)
        if miss.max() > 1e-6:
            t, k = (int(i) for i in np.unravel_index(miss.argmax(), miss.shape))
            raise ValueError(
                f"Feet.place(targets): foot {self.names[k]!r} comes no nearer than {miss[t, k]:.3g} m to its target "
                f"{goal[t, k]} in row {t}"
            )
        self._check_stops(x)
        return x

    def _check_stops(self, x: Floats) -> None:
        """Refuse angles beyond the limits of a joint."""
        low, high = self.sim.mechanism.coordinate_limits
        for joint in self.sim.mechanism.joints[1:]:
            at = self.sim.mechanism.q_slice(joint.name)
            for q, lo, hi in zip(x[:, at].T, low[at], high[at], strict=True):
                worst = float(np.maximum(lo - q, q - hi).max())
                if worst > 0.0:
                    raise ValueError(
                        f"Feet.place(targets): joint {joint.name!r} would have to go {worst:.3g} rad beyond its limits "
                        f"[{lo:g}, {hi:g}]"
                    )


def _grounds(contacts: Sequence[Contact]) -> list[tuple[Contact, int | list[int]]]:
    """Contacts, each with its place in the sequence, or with those of all balls of its size on its terrain.

    A spline takes as long for one place as for a hundred.
    """
    flat: list[tuple[Contact, int | list[int]]] = [(c, k) for k, c in enumerate(contacts) if c.terrain is None]
    alike: dict[tuple[int, float, float], tuple[Contact, list[int]]] = {}
    for k, c in enumerate(contacts):
        if c.terrain is not None:
            alike.setdefault((id(c.terrain), c.radius, c.height), (c, []))[1].append(k)
    return [*flat, *alike.values()]
