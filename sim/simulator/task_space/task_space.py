"""TaskSpace: quantities in task space along trajectories, as compiled calls over checked arrays, for planners."""

from __future__ import annotations

import numpy as np

from sim.contact.group_wrenches import group_wrenches
from sim.model.interruptible_loops import rows as parts_of
from sim.simulator.engines.engine import Engine
from sim.simulator.link_kernels import link_gradient, link_pairs, link_step
from sim.simulator.task_space import contact_rows, distances, frames, momenta
from sim.simulator.task_space.knot_rows import Rows
from solvers.compiler import Table
from solvers.types import Floats, Integers

__all__ = ["Buffers", "TaskSpace"]


class Buffers:
    """Values (m, d) of a quantity at m knots, and their derivatives (m, d, ndx + nu) by tangent state and input."""

    def __init__(self, knots: Integers, width: int, columns: int) -> None:
        self.knots = knots
        self.values = np.zeros((len(knots), width))
        self._jacobians = np.zeros((0, width, columns))

    def rows(self, xs: Floats, us: Floats, part: slice, *, derivatives: bool) -> Rows:
        """Rows of a part of the knots."""
        if derivatives and len(self._jacobians) != len(self.knots):
            self._jacobians = np.zeros((len(self.knots), *self._jacobians.shape[1:]))
        jacobians = self._jacobians[part] if derivatives else self._jacobians[:0]
        return Rows(xs, us, self.knots[part], self.values[part], jacobians)

    def put(self, jacobians: Floats) -> None:
        """Take these as the derivatives."""
        self._jacobians = jacobians

    @property
    def jacobians(self) -> Floats:
        """(m, d, ndx + nu) of the last call with derivatives."""
        return self._jacobians


class TaskSpace:
    """The kernels of this folder for one engine.

    Arrays are float64, C-contiguous and finite. Velocities are the mean ones of the interval that led to a state, so
    they need an engine of order 2.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._scratch = np.zeros((6, engine.sizes.nv))

    def frame_poses(
        self, xs: Floats, us: Floats, frame: tuple[int, Floats, Floats], out: Buffers, *, derivatives: bool
    ) -> None:
        """Place (3) and rotation vector from an aim (3) of a frame: (body, (7,) point and quaternion, (m, 4) aims)."""
        (model, data), h = self._tables(), self._engine.settings.time_step
        body, place, aims = frame
        for part in parts_of(len(out.knots)):
            rows = out.rows(xs, us, part, derivatives=derivatives)
            frames.frame_poses(model, data, h, body, place, aims[part], rows)

    def frame_velocities(
        self, xs: Floats, us: Floats, frame: tuple[int, Floats], out: Buffers, *, derivatives: bool
    ) -> None:
        """Velocity (3) [m/s] and angular velocity (3) [rad/s] of a frame, world axes."""
        (model, data), h = self._tables(), self._engine.settings.time_step
        for part in parts_of(len(out.knots)):
            frames.frame_velocities(model, data, h, *frame, out.rows(xs, us, part, derivatives=derivatives))

    def momenta(self, xs: Floats, us: Floats, out: Buffers, *, derivatives: bool) -> None:
        """Centre of mass (3) [m], momentum (3) [kg m/s], angular momentum about it (3) [kg m^2/s], world axes."""
        (model, data), h = self._tables(), self._engine.settings.time_step
        for part in parts_of(len(out.knots)):
            momenta.momenta(model, data, h, out.rows(xs, us, part, derivatives=derivatives))

    def contact_gaps(self, xs: Floats, us: Floats, contacts: Integers, out: Buffers, *, derivatives: bool) -> None:
        """Gap [m] and slip (2) [m/s] of each contact with the ground."""
        (model, data), h = self._stepping(), self._engine.settings.time_step
        for part in parts_of(len(out.knots)):
            rows = out.rows(xs, us, part, derivatives=derivatives)
            contact_rows.contact_gaps(model, data, h, contacts, self._scratch, rows)

    def contact_forces(
        self, xs: Floats, us: Floats, contacts: Integers, kappa: float | None, out: Buffers, *, derivatives: bool
    ) -> None:
        """Force (3) [N] of each contact with the ground along normal and tangents, in the first step from each knot."""
        (model, data), settings = self._stepping(), self._engine.settings.array(kappa)
        for part in parts_of(len(out.knots)):
            rows = out.rows(xs, us, part, derivatives=derivatives)
            contact_rows.contact_forces(model, data, settings, contacts, self._scratch, rows)

    def distances(self, xs: Floats, us: Floats, out: Buffers, *, derivatives: bool) -> None:
        """Distance [m] of every pair of shapes."""
        model, data = self._engine.linked(link_pairs), self._engine.table()
        for part in parts_of(len(out.knots)):
            distances.distances(model, data, out.rows(xs, us, part, derivatives=derivatives))

    def group_wrenches(self, xs: Floats, forces: Floats, points: Floats, groups: Integers, count: int) -> Floats:
        """Forces [N] of groups of contacts and their torques [N m] about the centre of mass, (n, count, 6), world axes.

        xs: (n, nx) states; forces, points: (n, ncontact, 3); groups: (ncontact,) number of each, -1 for none.
        """
        out = np.empty((len(xs), count, 6))
        group_wrenches(self._engine.step_table(), self._engine.table(), xs, forces, points, groups, out)
        return out

    def _tables(self) -> tuple[Table, Table]:
        return self._engine.linked(), self._engine.table()

    def _stepping(self) -> tuple[Table, Table]:
        return self._engine.linked(link_step, link_gradient), self._engine.table()
