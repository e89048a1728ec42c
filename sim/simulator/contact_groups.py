"""ContactGroups: forces and torques of groups of contacts, as touch sensors of a robot's parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.model.record_columns import ContactRow
from sim.simulator.results import Contacts
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["ContactGroups"]


class ContactGroups:
    """Groups of contacts with the ground, such as those of each part of a robot.

    Args:
        sim: the simulator.
        groups: names of the contacts of each group; a contact is in one group, or in none.

    Raises:
        ValueError: an unknown name, or a contact in two groups.
    """

    def __init__(self, sim: Simulator, groups: Sequence[Sequence[str]]) -> None:
        call, names = "ContactGroups(groups)", sim.mechanism.contact_names
        numbers = np.full(len(names), -1, dtype=np.int64)
        for g, group in enumerate(groups):
            for name in checks.names(call, group):
                checks.one_of(call, name, names)
                if numbers[k := names.index(name)] >= 0:
                    raise ValueError(f"{call}: {name!r} is in two groups")
                numbers[k] = g
        self.sim, self.count, self._numbers = sim, len(groups), numbers
        self._space = sim.task_space()

    def __repr__(self) -> str:
        return f"ContactGroups({self.count} of {self.sim.mechanism.name!r})"

    def wrenches(self, X: ArrayLike, contacts: Contacts) -> Floats:
        """Forces of groups on the robot, and their torques about its centre of mass, in world axes.

        Args:
            X: (n, nx) states at the end of the step of the contacts.
            contacts: (n, ncontact), as of `step_batch(..., contacts=True)`.

        Returns:
            (n, count, 6) forces [N], then torques [N m].

        Raises:
            ValueError: a wrong shape.
        """
        states = checks.array("ContactGroups.wrenches(X)", X, (len(contacts.impulse), self.sim.nx))
        return self._sums(states, (contacts.impulse, contacts.point, contacts.moment_impulse), contacts.time_step)

    def of_rows(self, states: Floats, rows: Floats) -> Floats:
        """As `wrenches`, without checks: from rows of `ContactRow` of a step of the simulator.

        Args:
            states: (n, nx) at the end of the step.
            rows: (n, ncontact, 11).

        Returns:
            (n, count, 6) forces [N], then torques [N m].
        """
        impulses, points = (rows[..., k : k + 3] for k in (ContactRow.IMPULSE, ContactRow.POINT))
        moments = rows[..., ContactRow.MOMENT :] if rows.shape[-1] > ContactRow.MOMENT else None
        return self._sums(np.ascontiguousarray(states), (impulses, points, moments), self.sim.time_step)

    def _sums(self, states: Floats, found: tuple[Floats, Floats, Floats | None], time_step: float) -> Floats:
        """Sums over the contacts of the groups, of their impulses at their points and of their moments."""
        impulses, points, moments = found
        forces = np.ascontiguousarray(impulses / time_step)
        out = self._space.group_wrenches(states, forces, np.ascontiguousarray(points), self._numbers, self.count)
        if moments is not None:
            for group in range(self.count):
                out[:, group, 3:] += moments[:, self._numbers == group].sum(axis=1) / time_step
        return out
