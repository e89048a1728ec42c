"""States of order 2: their velocity is the mean over the time step before the node."""

from __future__ import annotations

import numpy as np

from sim.dynamics import coordinates, coordinates_jacobian, energy, state_manifold, velocity
from sim.model.interruptible_loops import rows
from sim.simulator.engines.linked_model import LinkedModel
from sim.simulator.link_kernels import link_momentum, link_nodes
from sim.simulator.results import SimulationError
from sim.solve import start_velocity
from solvers.status import MESSAGES, Status
from solvers.types import Floats, Vector


class MeanStates:
    """The states of one mechanism on their manifold, and other views of them."""

    def __init__(self, kernels: LinkedModel) -> None:
        self._kernels, self._sizes, self.h = kernels, kernels.sizes, kernels.settings.time_step
        self._nx, self._ndx = kernels.nx, kernels.ndx

    @property
    def mean_over(self) -> float:
        """Interval before the node over which velocities are means [s]: the time step."""
        return self.h

    def interval(self, x: Vector) -> float:
        """Interval over which the velocity of the state x is the mean [s]: the time step, unless steps are divided."""
        return self.h

    def start(self, q: Vector, v: Vector, h: float | None = None) -> tuple[int, Vector]:
        """(status, state) with the velocity v at the node q; h: interval of the state, here and below, [s]."""
        x = np.concatenate([q, v])
        status = start_velocity.start_at(self._kernels.linked(link_momentum), self._kernels.table(), h or self.h, v, x)
        return int(status), x

    def started(self, q: Vector, v: Vector, h: float | None = None) -> Vector:
        """`start`; SimulationError if no such state exists."""
        status, x = self.start(q, v, h)
        if status != Status.SOLVED:
            reason = Status(status)
            raise SimulationError(f"Simulator.state_from_velocity: {MESSAGES[reason]}", reason)
        return x

    def along_loops(self, x: Vector) -> Vector | None:
        """Of states with the velocity of their node, the nearest velocity along closed loops and gears; None of others.

        The velocity of a state of order 2 is closed by its interval.
        """
        return None

    def node_velocities(self, xs: Floats, h: float | None = None) -> Floats:
        """Joint velocities at the node of every row, (n, nv)."""
        out = np.zeros((len(xs), self._sizes.nv))
        model, data, h = self._kernels.linked(link_nodes), self._kernels.table(), h or self.h
        for part in rows(len(xs)):
            velocity.node_velocities(model, data, h, xs[part], out[part])
        return out

    def bodies(self, xs: Floats) -> Floats:
        """Poses and velocities of the bodies at [q; joint velocities] of every row, (n, nbody, 13)."""
        out = np.zeros((len(xs), self._sizes.nbody, 13))
        for part in rows(len(xs)):
            velocity.body_states(self._kernels.linked(), self._kernels.table(), xs[part], out[part].reshape(-1, 13))
        return out

    def integrate(self, xs: Floats, dxs: Floats) -> Floats:
        """x (+) dx of every row."""
        out = np.zeros_like(xs)
        for part in rows(len(xs)):
            state_manifold.integrate_states(self._kernels.linked(), xs[part], dxs[part], out[part])
        return out

    def difference(self, x0s: Floats, x1s: Floats) -> Floats:
        """x1 (-) x0 of every row."""
        out = np.zeros((len(x0s), self._ndx))
        for part in rows(len(x0s)):
            state_manifold.state_differences(self._kernels.linked(), x0s[part], x1s[part], out[part])
        return out

    def normalize(self, xs: Floats, tolerance: float) -> int:
        """Normalise quaternions in place; see `normalise_quaternions`."""
        for part in rows(len(xs)):
            found = int(state_manifold.normalize_quaternions(self._kernels.linked(), xs[part], tolerance))
            if found >= 0:
                return part.start * self._sizes.nbody + found
        return -1

    def maximal(self, xs: Floats, h: float | None = None) -> Floats:
        """z of every row, (n, nbody, 13)."""
        out = np.zeros((len(xs), self._sizes.nbody, 13))
        data, h = self._kernels.table(), h or self.h
        for part in rows(len(xs)):
            coordinates.maximal_states(self._kernels.linked(), data, h, xs[part], out[part].reshape(-1, 13))
        return out

    def minimal(self, zs: Floats, h: float | None = None) -> Floats:
        """x of every z, (n, nbody, 13)."""
        out = np.zeros((len(zs), self._nx))
        data, h = self._kernels.table(), h or self.h
        for part in rows(len(zs)):
            coordinates.minimal_states(self._kernels.linked(), data, h, zs[part].reshape(-1, 13), out[part])
        return out

    def maximal_jacobian(self, x: Vector, h: float | None = None) -> Floats:
        """dz/dx."""
        out = np.zeros((12 * self._sizes.nbody, self._ndx))
        step = h or self.h
        coordinates_jacobian.maximal_jacobian_at(self._kernels.linked(), self._kernels.table(), step, x, out)
        return out

    def minimal_jacobian(self, z: Floats, h: float | None = None) -> Floats:
        """dx/dz."""
        out = np.zeros((self._ndx, 12 * len(z)))
        step = h or self.h
        coordinates_jacobian.minimal_jacobian_at(self._kernels.linked(), self._kernels.table(), step, z, out)
        return out

    def energies(self, xs: Floats, h: float | None = None) -> Floats:
        """(kinetic, potential) energy of every row."""
        out = np.zeros((len(xs), 2))
        model, data, h = self._kernels.linked(link_nodes), self._kernels.table(), h or self.h
        for part in rows(len(xs)):
            energy.energies(model, data, h, xs[part], out[part])
        return out

    def momenta(self, xs: Floats, h: float | None = None) -> Floats:
        """(linear, angular) momentum of every row."""
        out = np.zeros((len(xs), 6))
        data, h = self._kernels.table(), h or self.h
        for part in rows(len(xs)):
            energy.momenta(self._kernels.linked(), data, h, xs[part], out[part])
        return out
