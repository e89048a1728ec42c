"""StateCalls: the kernels about single states, as functions of checked arrays: poses, coordinates, energy, momentum."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim import coordinates, coordinates_jacobian, energy, start, state, velocity
from sim.bind import bind_nodes, bind_poses
from sim.layout import sizes_of, table
from sim.model import Model, Vector
from sim.pace import rows
from sim.results import SimulationError
from sim.scratch import Scratch
from sim.settings import Settings
from solvers.compiler import Table
from solvers.status import MESSAGES, Status

Floats = NDArray[np.float64]


class StateCalls:
    """A packed mechanism, the scratch of its kernels, and what they say of states."""

    def __init__(self, model: Model, settings: Settings) -> None:
        self.model, self.settings = model, settings
        self.sizes = sizes_of(model)
        self.nx, self.ndx, self.nu = self.sizes.nq + self.sizes.nv, 2 * self.sizes.nv, self.sizes.nu
        bind_poses(model)
        self._bound: set[Callable[[Model], None]] = set()
        self._model = table(model)
        self._scratch = Scratch(self.sizes, model.contact_frame)

    def start(self, q: Vector, v: Vector) -> tuple[int, Vector]:
        """(status, state) with the velocity v at the node q."""
        x = np.concatenate([q, v])
        status = start.start_at(self._model, self._scratch.table(), self.settings.time_step, v, x)
        return int(status), x

    def _table(self, *needs: Callable[[Model], None]) -> Table:
        """Table of the Model, with the kernels bound that a call needs."""
        for bind in needs:
            if bind not in self._bound:
                bind(self.model)
                self._bound.add(bind)
        return self._model

    def started(self, q: Vector, v: Vector) -> Vector:
        """`start`; SimulationError when there is no such state."""
        status, x = self.start(q, v)
        if status != Status.SOLVED:
            reason = Status(status)
            raise SimulationError(f"Simulator.start: {MESSAGES[reason]}", reason)
        return x

    def node_velocities(self, xs: Floats) -> Floats:
        """Joint velocities at the node of every row, (n, nv)."""
        out = np.zeros((len(xs), self.sizes.nv))
        model, work, h = self._table(bind_nodes), self._scratch.table(), self.settings.time_step
        for part in rows(len(xs)):
            velocity.node_velocities(model, work, h, xs[part], out[part])
        return out

    def bodies(self, xs: Floats) -> Floats:
        """Poses and velocities of the bodies at [q; joint velocities] of every row, (n, nbody, 13)."""
        nbody = self.sizes.nbody
        out = np.zeros((len(xs), nbody, 13))
        for part in rows(len(xs)):
            velocity.body_states(self._model, self._scratch.table(), xs[part], out[part].reshape(-1, 13))
        return out

    def integrate(self, xs: Floats, dxs: Floats) -> Floats:
        """x (+) dx of every row."""
        out = np.zeros_like(xs)
        for part in rows(len(xs)):
            state.integrate_states(self._model, xs[part], dxs[part], out[part])
        return out

    def difference(self, x0s: Floats, x1s: Floats) -> Floats:
        """x1 (-) x0 of every row."""
        out = np.zeros((len(x0s), self.ndx))
        for part in rows(len(x0s)):
            state.state_differences(self._model, x0s[part], x1s[part], out[part])
        return out

    def normalise(self, xs: Floats, tolerance: float) -> int:
        """Normalise quaternions in place; see `normalise_quaternions`."""
        for part in rows(len(xs)):
            found = int(state.normalise_quaternions(self._model, xs[part], tolerance))
            if found >= 0:
                return part.start * self.sizes.nbody + found
        return -1

    def maximal(self, xs: Floats, nbody: int) -> Floats:
        """z of every row, (n, nbody, 13)."""
        out = np.zeros((len(xs), nbody, 13))
        work, h = self._scratch.table(), self.settings.time_step
        for part in rows(len(xs)):
            coordinates.maximal_states(self._model, work, h, xs[part], out[part].reshape(-1, 13))
        return out

    def minimal(self, zs: Floats) -> Floats:
        """x of every z, (n, nbody, 13)."""
        out = np.zeros((len(zs), self.nx))
        work, h = self._scratch.table(), self.settings.time_step
        for part in rows(len(zs)):
            coordinates.minimal_states(self._model, work, h, zs[part].reshape(-1, 13), out[part])
        return out

    def maximal_jacobian(self, x: Vector, nbody: int) -> Floats:
        """dz/dx."""
        out = np.zeros((12 * nbody, self.ndx))
        h = self.settings.time_step
        coordinates_jacobian.maximal_jacobian_at(self._model, self._scratch.table(), h, x, out)
        return out

    def minimal_jacobian(self, z: Floats) -> Floats:
        """dx/dz."""
        out = np.zeros((self.ndx, 12 * len(z)))
        h = self.settings.time_step
        coordinates_jacobian.minimal_jacobian_at(self._model, self._scratch.table(), h, z, out)
        return out

    def energies(self, xs: Floats) -> Floats:
        """(kinetic, potential) energy of every row."""
        out = np.zeros((len(xs), 2))
        model, work, h = self._table(bind_nodes), self._scratch.table(), self.settings.time_step
        for part in rows(len(xs)):
            energy.energies(model, work, h, xs[part], out[part])
        return out

    def momenta(self, xs: Floats) -> Floats:
        """(linear, angular) momentum of every row."""
        out = np.zeros((len(xs), 6))
        work, h = self._scratch.table(), self.settings.time_step
        for part in rows(len(xs)):
            energy.momenta(self._model, work, h, xs[part], out[part])
        return out
