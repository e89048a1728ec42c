"""RowStepper: independent rows stepped again and again, with models and settings that were looked up once."""

from __future__ import annotations

from math import isfinite

import numpy as np

from sim.mechanism import checks
from sim.simulator.arguments import Arguments
from sim.simulator.row_impulses import RowImpulses
from sim.simulator.step_batch import RowBatch, RowEngines, StepBatch, row_settings
from solvers.types import Floats

__all__ = ["RowStepper"]

_CALL = "RowStepper.step"


class RowStepper:
    """Knots of rows, one after another: to look up models and settings takes as long as many a step.

    Args:
        rows: engines of the rows.
        substeps: time steps per knot.
        kappas: (n,) central-path parameters, NaN for that of an engine.
        impulses: of n rows, or of none.
        arguments: checks of the simulator.
    """

    def __init__(
        self, rows: RowEngines, substeps: int, kappas: Floats, impulses: RowImpulses, arguments: Arguments
    ) -> None:
        engine = rows.engines[0]
        self._rows, self._substeps, self._kappas, self._impulses = rows, substeps, kappas, impulses
        self._check, self._settings = arguments, row_settings(rows, kappas)
        self._sizes, self._untouched = (engine.nx, engine.nu), np.zeros((0, *engine.no_outputs[0].shape[1:]))

    def step(self, xs: Floats, us: Floats, room: tuple[Floats, Floats] | None = None) -> StepBatch:
        """One knot of every row.

        Args:
            xs: (n, nx) states.
            us: (n, nu) inputs [N, N m].
            room: for the derivatives by state and input, A (n, ndx, ndx) and B (n, ndx, nu); none by default.

        Returns:
            StepBatch, without a sentence about unsolved rows.
        """
        count, (nx, nu) = len(self._kappas), self._sizes
        if xs.shape != (count, nx) or us.shape != (count, nu) or not isfinite(xs.sum() + us.sum()):
            xs = checks.array(f"{_CALL}(xs)", xs, (count, nx))
            us = checks.array(f"{_CALL}(us)", us, (count, nu))
        states = self._check.states(f"{_CALL}(xs)", xs)
        batch = RowBatch(
            self._rows, states, us, self._substeps, self._kappas, self._untouched, self._impulses, self._settings
        )
        return batch.step(room is not None, room)[0]
