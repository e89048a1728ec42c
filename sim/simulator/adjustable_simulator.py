"""AdjustableSimulator: a simulator whose model changes in place, for loops that estimate it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.axes import contact_frame
from sim.model.model import Model
from sim.simulator.simulator import Simulator

__all__ = ["AdjustableSimulator"]


class _Values:
    """The values in a model: a new version with each change, and one version for models with equal values."""

    def __init__(self) -> None:
        self.version = object()

    def change(self) -> None:
        """There are other values from now on."""
        self.version = object()


class AdjustableSimulator(Simulator):
    """A simulator that its owner changes in place, because a new one for every measurement would take too long.

    Only motions change: `mechanism`, `parameters`, `describe`, copies, and rows of `step_batch` with own parameters
    keep the values that it was made with.
    """

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        """As Simulator."""
        self._values = _Values()
        super().__init__(*arguments, **settings)

    @classmethod
    def like(cls, sim: Simulator) -> AdjustableSimulator:
        """A copy of a simulator.

        Args:
            sim: the simulator, which stays as it is.

        Returns:
            The copy.
        """
        return cls(*sim.__reduce__()[1])

    def turn_ground(self, normal: ArrayLike) -> None:
        """Turn the half-spaces under all contacts; heights along the normals stay.

        Args:
            normal: (3,) outward normal.

        Raises:
            ValueError: the normal is zero, a body that cannot move freely has a contact, or the simulator has steps of
                a higher order or an accuracy.
        """
        call = "AdjustableSimulator.turn_ground"
        unit = checks.direction(f"{call}(normal)", normal)
        if np.any(self.model.contact_hold) or self.order != 2 or self.accuracy:
            raise ValueError(f"{call}: expected steps of order 2, and contacts that move freely")
        self._values.change()
        self._engine.turn_ground(contact_frame(unit))

    def follow(self, other: Simulator) -> None:
        """Take over the parameters and the ground of another simulator, as they are now.

        Args:
            other: a simulator of the same mechanism, also one that was changed; time step and kappa stay.
        """
        version = other._values.version if isinstance(other, AdjustableSimulator) else object()
        if version is self._values.version:
            return
        self._values.change()  # until all arrays have been written
        for name, own, theirs in zip(Model._fields, self.model, other.model, strict=True):
            if name != "optional":  # addresses of the kernels that each has linked
                np.copyto(own, theirs)
        self._by_parameters.follow(other._by_parameters)
        self._engine.refresh()
        self._values.version = version

    def set_parameters(self, values: Mapping[str, ArrayLike]) -> None:
        """Give parameters other values; those that are not named have the values that the simulator was made with.

        Kappa stays. `with_parameters` returns a new simulator instead.

        Args:
            values: {name: value}, with the names of `parameters`.

        Raises:
            ValueError: for an unknown name, a value that no mechanism has, or one that changes the structure of the
                model, such as a damper where there was none; the simulator has steps of a higher order or an accuracy.
        """
        self._values.change()
        self._by_parameters.adopt("AdjustableSimulator.set_parameters(values)", values)
