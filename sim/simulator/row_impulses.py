"""RowImpulses: the impulses with which the last steps of independent rows ended, for the start of their next ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism.short_repr import short_repr
from sim.model.model import Model
from sim.model.record_columns import Dry
from sim.simulator.engines.engine import BOUND, CONE
from solvers.types import Floats

__all__ = ["RowImpulses"]


@dataclass(frozen=True)
class RowImpulses:
    """Impulses of n rows, of `Simulator.row_impulses`; `step_batch` starts from them and writes them.

    A row starts from its own impulses alone, so its result depends neither on the other rows nor on the cores. They
    are only a guess: a step ends in the same solution, up to its tolerance, after fewer iterations.

    Attributes:
        cones: (n, ncontact, 16) variables of the contacts.
        bounds: (n, nlimit, 2) of the limits.
        dry: (n, ndry, 4) of the dry friction.
        known: (n,) whether a row has them; one that was not solved, or whose step was divided, has none.
        rows: RowSteps of the simulator that made them, if any.
    """

    cones: Floats
    bounds: Floats
    dry: Floats
    known: NDArray[np.bool_]
    rows: Any = None

    __repr__ = short_repr

    @classmethod
    def of(cls, model: Model, count: int) -> RowImpulses:
        """Room for `count` rows about which nothing is known.

        Args:
            model: of the simulator.
            count: number of rows.

        Returns:
            RowImpulses.
        """
        sizes = (len(model.contact_body), CONE), (len(model.limit_dof), BOUND), (len(model.dry_dof), len(Dry))
        cones, bounds, dry = (np.zeros((count, *size)) for size in sizes)
        return cls(cones, bounds, dry, np.zeros(count, dtype=np.bool_))

    def __len__(self) -> int:
        return len(self.known)

    def forget(self, rows: Any) -> None:
        """Let rows start without impulses, as where another motion begins.

        Args:
            rows: numbers of rows, or (n,) flags.
        """
        self.known[rows] = False

    def stepper(
        self, substeps: int, kappa: ArrayLike | None = None, parameters: Mapping[str, ArrayLike] | None = None
    ) -> Any:
        """Many knots of the rows of these impulses: models and settings are checked, and looked up, once.

        Args:
            substeps: as for `Simulator.step_batch`.
            kappa: the same.
            parameters: the same.

        Returns:
            RowStepper, whose steps start from these impulses, and write them.
        """
        return self.rows.row_stepper(self, substeps, kappa, parameters)

    def of_rows(self, rows: Any) -> RowImpulses:
        """The impulses of some rows.

        Args:
            rows: numbers of rows, or (n,) flags.

        Returns:
            RowImpulses, a copy.
        """
        return RowImpulses(self.cones[rows], self.bounds[rows], self.dry[rows], self.known[rows], self.rows)
