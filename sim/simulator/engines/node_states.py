"""States of orders 4 to 8, and of steps with an accuracy: their velocity is that of the node."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from sim.dynamics import coordinates, maximal_energy
from sim.model.state_columns import BodyState
from sim.simulator.engines.linear_systems import solved
from sim.simulator.engines.linked_model import LinkedModel
from sim.simulator.engines.mean_states import MeanStates
from solvers.status import Status
from solvers.types import Floats, Vector

_BRIEF = 1e-3  # time steps, an interval in which dampers have next to no inertia


class NodeStates(MeanStates):
    """As MeanStates, with the velocity at the node; an interval means nothing here."""

    def __init__(self, kernels: LinkedModel) -> None:
        super().__init__(kernels)
        self._model = kernels.model

    @property
    def mean_over(self) -> float:
        """Zero: velocities are no means."""
        return 0.0

    def start(self, q: Vector, v: Vector, h: float | None = None) -> tuple[int, Vector]:
        """The state is that of the node."""
        return int(Status.SOLVED), np.concatenate([q, v])

    def node_velocities(self, xs: Floats, h: float | None = None) -> Floats:
        """The velocities of the states."""
        return np.array(xs[:, self._sizes.nq :])

    def energies(self, xs: Floats, h: float | None = None) -> Floats:
        """(kinetic, potential) energy of every row."""
        potential = super().energies(xs)[:, 1]
        rotors = 0.5 * xs[:, self._sizes.nq :] ** 2 @ self._model.dof_armature
        return np.stack([maximal_energy.kinetic_energy(self._model, self.bodies(xs)) + rotors, potential], axis=1)

    def momenta(self, xs: Floats, h: float | None = None) -> Floats:
        """(linear, angular) momentum of every row."""
        return maximal_energy.momentum(self._model, self.bodies(xs))

    def maximal(self, xs: Floats, h: float | None = None) -> Floats:
        """z of every row, with velocities at the node."""
        return self.bodies(xs)

    def minimal(self, zs: Floats, h: float | None = None) -> Floats:
        """x of every z; of velocities that violate a joint, the part of least kinetic energy off them is dropped."""
        still = zs.copy()
        still[..., BodyState.VELOCITY] = still[..., BodyState.SPIN] = 0.0
        xs = np.zeros((len(zs), self._nx))
        coordinates.minimal_states(self._kernels.linked(), self._kernels.table(), 1.0, still.reshape(-1, 13), xs)
        for x, z in zip(xs, zs, strict=True):
            columns, weighted = self._columns(x)
            rates = np.concatenate([z[:, BodyState.VELOCITY], z[:, BodyState.SPIN]], axis=1).ravel()
            x[self._sizes.nq :] = solved(weighted @ columns.T, weighted @ rates)
        return xs

    def mass_matrix(self, x: Vector) -> Floats:
        """M(q), (nv, nv)."""
        columns, weighted = self._columns(x)
        return np.asarray(weighted @ columns.T + np.diag(self._model.dof_armature))

    def _columns(self, x: Vector) -> tuple[Floats, Floats]:
        """d(velocities of the bodies)/d(joint velocities), (nv, 6 nbody), and the same times their inertias."""
        xs = np.tile(x, (self._sizes.nv, 1))
        xs[:, self._sizes.nq :] = np.eye(self._sizes.nv)
        z = self.bodies(xs)
        inertia = self._model.body_inertia.reshape(-1, 3, 3)
        linear = self._model.body_mass[:, None] * z[..., BodyState.VELOCITY]
        angular = np.einsum("bij,nbj->nbi", inertia, z[..., BodyState.SPIN])
        columns = np.concatenate([z[..., BodyState.VELOCITY], z[..., BodyState.SPIN]], axis=2)
        return columns.reshape(len(z), -1), np.concatenate([linear, angular], axis=2).reshape(len(z), -1)

    def maximal_jacobian(self, x: Vector, h: float | None = None) -> Floats:
        """Refused."""
        self._refuse("Jacobians are")

    def minimal_jacobian(self, z: Floats, h: float | None = None) -> Floats:
        """Refused."""
        self._refuse("Jacobians are")

    def _refuse(self, feature: str) -> NoReturn:
        s = self._kernels.settings
        raise ValueError(f"Simulator of {s.kind}: {feature} those of order 2; use {s.way_to_order_two}")


class ClosingStates(NodeStates):
    """As NodeStates, of mechanisms with loops and gears, too, which states of order 2 close."""

    def __init__(self, kernels: LinkedModel, second: MeanStates) -> None:
        super().__init__(kernels)
        self._second = second

    def along_loops(self, x: Vector) -> Vector:
        """The velocity (nv,) nearest to that of x, in the metric of the masses, that keeps loops and gears closed."""
        nq, h = self._sizes.nq, _BRIEF * self.h
        return np.asarray(self._second.node_velocities(self._second.started(x[:nq], x[nq:], h)[None], h)[0])
