"""Quantity: named numbers that depend on states and inputs, evaluated at knots with their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim.simulator.simulator import Simulator
from sim.simulator.task_space.task_space import Buffers, TaskSpace
from solvers.types import Integers, Matrix, Stack, Vector

_SMOOTH = 1e-3  # of the normal force of the weight: below it, the size of a tangential force is rounded off


class Quantity:
    """Numbers y (m, d) at m knots; `names` has one for each of the d, `groups` names several of them.

    Attributes:
        kappa: central-path parameter at which forces are taken; None for that of the simulator.
    """

    point_body: int | None = None  # body on which it has a point other than the centre of mass

    def __init__(
        self, sim: Simulator, knots: Integers, names: Sequence[str], groups: Mapping[str, Sequence[int]]
    ) -> None:
        self.names, self.groups = tuple(names), dict(groups)
        self.knots = knots
        self.kappa: float | None = None
        self.space: TaskSpace = sim.task_space()
        self.buffers = Buffers(knots, len(names), sim.ndx + sim.nu)

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        """Evaluate into `buffers`."""
        raise NotImplementedError

    def values(self, xs: Matrix, us: Matrix) -> Matrix:
        """y (m, d); overwritten by the next call."""
        self.fill(xs, us, derivatives=False)
        return self.buffers.values

    def expansion(self, xs: Matrix, us: Matrix) -> tuple[Matrix, Stack]:
        """y (m, d) and its derivatives (m, d, ndx + nu); overwritten by the next call."""
        self.fill(xs, us, derivatives=True)
        return self.buffers.values, self.buffers.jacobians


class FramePoses(Quantity):
    """Place of a frame, and its rotation vector from an aim, in the axes of the aim."""

    def __init__(self, sim: Simulator, knots: Integers, frame: tuple[int, Vector], aims: Matrix) -> None:
        groups = {"place": (0, 1, 2), "orientation": (3, 4, 5)}
        super().__init__(sim, knots, ("x", "y", "z", "rx", "ry", "rz"), groups)
        self._frame, self.point_body = (*frame, aims), _body_of(frame)

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self.space.frame_poses(xs, us, self._frame, self.buffers, derivatives=derivatives)


class FrameVelocities(Quantity):
    """Velocity of the origin of a frame, and its angular velocity, world axes."""

    def __init__(self, sim: Simulator, knots: Integers, frame: tuple[int, Vector]) -> None:
        groups = {"linear": (0, 1, 2), "angular": (3, 4, 5)}
        super().__init__(sim, knots, ("x", "y", "z", "rx", "ry", "rz"), groups)
        self._frame, self.point_body = frame, _body_of(frame)

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self.space.frame_velocities(xs, us, self._frame, self.buffers, derivatives=derivatives)


class Momenta(Quantity):
    """Centre of mass, momentum, and angular momentum about the centre of mass, world axes."""

    def __init__(self, sim: Simulator, knots: Integers) -> None:
        groups = {"place": (0, 1, 2), "linear": (3, 4, 5), "angular": (6, 7, 8)}
        super().__init__(sim, knots, [f"{letter}{axis}" for letter in ("", "p", "l") for axis in "xyz"], groups)

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self.space.momenta(xs, us, self.buffers, derivatives=derivatives)


class Distances(Quantity):
    """Distances of all pairs of shapes of a simulator of the same states, which has the collisions in question."""

    def __init__(self, sim: Simulator, other: Any, knots: Integers, names: Sequence[str]) -> None:
        super().__init__(sim, knots, names, {})
        self.space = other.task_space()

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self.space.distances(xs, us, self.buffers, derivatives=derivatives)


class ContactQuantity(Quantity):
    """Three numbers per contact with the ground: those along its normal and its two tangents."""

    def __init__(self, sim: Simulator, knots: Integers, contacts: Integers) -> None:
        labels = [sim.mechanism.contacts[c].name for c in contacts]
        self._contacts = contacts
        names = [f"{label} {part}" for label in labels for part in ("normal", "first", "second")]
        groups: dict[str, Sequence[int]] = {label: range(3 * i, 3 * i + 3) for i, label in enumerate(labels)}
        groups |= {part: range(k, len(names), 3) for k, part in enumerate(("normal", "first", "second"))}
        super().__init__(sim, knots, names, groups)


class ContactGaps(ContactQuantity):
    """Gap and slips of contacts."""

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self.space.contact_gaps(xs, us, self._contacts, self.buffers, derivatives=derivatives)


class ContactForces(ContactQuantity):
    """Forces of contacts in the first step from each knot."""

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self.space.contact_forces(xs, us, self._contacts, self.kappa, self.buffers, derivatives=derivatives)


class Slips(Quantity):
    """Slips of contacts; faded by 1/(1 + (gap/near)^2) where `near` is finite."""

    def __init__(self, sim: Simulator, knots: Integers, contacts: Integers, near: float) -> None:
        labels = [sim.mechanism.contacts[c].name for c in contacts]
        names = [f"{label} {part}" for label in labels for part in ("first", "second")]
        groups = {label: (2 * i, 2 * i + 1) for i, label in enumerate(labels)}
        super().__init__(sim, knots, names, groups)
        self._gaps, self._near = ContactGaps(sim, knots, contacts), near

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self._gaps.fill(xs, us, derivatives=derivatives)
        m, n = len(self.knots), len(self.names) // 2
        y = self._gaps.buffers.values.reshape(m, n, 3)
        share = 1.0 / (1.0 + (y[..., :1] / self._near) ** 2)
        self.buffers.values[:] = (share * y[..., 1:]).reshape(m, 2 * n)
        if derivatives:
            J = self._gaps.buffers.jacobians.reshape(m, n, 3, -1)
            fade = -2.0 * share**2 * y[..., :1] / self._near**2
            out = share[..., None] * J[:, :, 1:] + (fade * y[..., 1:])[..., None] * J[:, :, :1]
            self.buffers.put(out.reshape(m, 2 * n, -1))


class FrictionReserves(Quantity):
    """|f_t| - share mu f_n of contacts [N]: negative where less than that share of the friction is used.

    |f_t| is sqrt(f_1^2 + f_2^2 + e^2) - e, with a small e [N], for a derivative where there is no such force.
    """

    def __init__(self, sim: Simulator, knots: Integers, contacts: Integers, share: float) -> None:
        mech = sim.mechanism
        super().__init__(sim, knots, [mech.contacts[c].name for c in contacts], {})
        weight = sum(body.mass for body in mech.bodies) * float(np.linalg.norm(mech.gravity))
        self._forces = ContactForces(sim, knots, contacts)
        self._bound = share * np.array([mech.contacts[c].friction for c in contacts])
        self._e = max(_SMOOTH * weight, 1e-9)

    def fill(self, xs: Matrix, us: Matrix, *, derivatives: bool) -> None:
        self._forces.kappa = self.kappa
        self._forces.fill(xs, us, derivatives=derivatives)
        m, n = len(self.knots), len(self.names)
        f = self._forces.buffers.values.reshape(m, n, 3)
        size = np.sqrt(f[..., 1] ** 2 + f[..., 2] ** 2 + self._e**2)
        self.buffers.values[:] = size - self._e - self._bound * f[..., 0]
        if derivatives:
            J = self._forces.buffers.jacobians.reshape(m, n, 3, -1)
            slope = np.stack([np.broadcast_to(-self._bound, (m, n)), f[..., 1] / size, f[..., 2] / size], axis=-1)
            self.buffers.put(np.einsum("mnk,mnkz->mnz", slope, J))


def _body_of(frame: tuple[int, Vector]) -> int | None:
    """The body of a frame, None where its origin is the centre of mass."""
    body, place = frame
    return body if place[:3].any() else None
