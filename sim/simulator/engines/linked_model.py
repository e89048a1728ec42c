"""LinkedModel: a Model as kernels read it, with its optional kernels and this thread's scratch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sim.model.layout import sizes_of, table
from sim.model.model import Model
from sim.model.scratch import Scratch
from sim.simulator.link_kernels import link_far, link_gradient, link_planner, link_poses, link_step
from sim.simulator.settings import Settings
from solvers.compiler import Table, link
from solvers.types import Floats


class LinkedModel:
    """The tables of one packed mechanism and of its scratch; a call links the optional kernels that it needs."""

    def __init__(self, model: Model, settings: Settings) -> None:
        self.model, self.settings = model, settings
        self.sizes = sizes_of(model)
        self.nx, self.ndx, self.nu = self.sizes.nq + self.sizes.nv, 2 * self.sizes.nv, self.sizes.nu
        link_poses(model)
        self._steps = (link_step, link_far) if settings.cutoff else (link_step,)
        self._linked: set[Callable[[Model], None]] = set()
        self._model = table(model)
        self._scratch = Scratch(self.sizes, model.contact_frame)

    def __getstate__(self) -> tuple[Model, Settings]:
        """Tables and kernels are addresses in this process: another one makes its own."""
        return self.model._replace(optional=np.zeros_like(self.model.optional)), self.settings

    def __setstate__(self, state: tuple[Model, Settings]) -> None:
        self.__init__(*state)  # type: ignore[misc]

    def linked(self, *needs: Callable[[Model], None]) -> Table:
        """Table of the Model, with the optional kernels linked that a call needs."""
        if not self._linked.issuperset(needs):
            new = [need for need in needs if need not in self._linked]
            kernels: Any = []  # of all needs at once, so that two processes can compile them
            for need in new:
                need(self.model._replace(optional=kernels))
            link(self.model.optional, *kernels)
            self._linked.update(new)
        return self._model

    def step_table(self, *needs: Callable[[Model], None]) -> Table:
        """Table of the Model, with the step of its order and further needs of a call linked."""
        return self.linked(*self._steps, *needs)

    def gradient_table(self, *needs: Callable[[Model], None]) -> Table:
        """Table of the Model, with the step, its derivatives, and further needs of a call linked."""
        return self.linked(*self._steps, link_gradient, *needs)

    def prepare(self) -> None:
        """Link the kernels of rollouts and their derivatives at once: two processes can then compile them."""
        self.gradient_table(link_planner)

    def tables(self, *needs: Callable[[Model], None]) -> tuple[Table, Table]:
        """Tables of the Model, linked for derivatives and further needs of a call, and of this thread's first Data."""
        return self.gradient_table(*needs), self._scratch.table()

    def table(self) -> Table:
        """Table of this thread's first Data."""
        return self._scratch.table()

    def chunks(self, count: int) -> Table:
        """Tables of this thread's Data for a parallel call over `count` items, one per chunk."""
        return self._scratch.chunks(count)

    def turn_ground(self, frame: Floats) -> None:
        """Give all contacts with half-spaces the frame (3, 3): rows normal and two tangents."""
        self.model.contact_frame[self.model.contact_terrain == 0] = frame.ravel()
        self.refresh()

    def refresh(self) -> None:
        """Reload the copies of model arrays in Data after the model changed."""
        self._scratch.refresh_contact_frames()
