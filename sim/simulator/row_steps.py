"""RowSteps: the steps of independent rows of one simulator, for `step_batch` and `stepper`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import isfinite
from threading import get_ident
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import room_for
from sim.model.record_columns import Dry
from sim.simulator.arguments import Arguments
from sim.simulator.engines.engine import BOUND, CONE, REPORT, Engine
from sim.simulator.knot_stepper import KnotStepper
from sim.simulator.results import contacts_of, reservation, status_message
from sim.simulator.row_impulses import RowImpulses
from sim.simulator.row_stepper import RowStepper
from sim.simulator.step_batch import RowBatch, RowModels, StepBatch, row_settings
from solvers.types import Floats

_CALL = "Simulator.step_batch"


def _is_row(values: Any, size: int) -> bool:
    """Whether it is an array (1, size) of finite floats, which needs no other check."""
    fits = type(values) is np.ndarray and values.dtype == np.float64 and values.shape == (1, size)
    return fits and isfinite(float(values.sum()))


class RowSteps:
    """Steps of rows: models of other parameters, room for impulses, and steppers are made once and kept.

    Args:
        mechanism: of the simulator.
        engine: of the simulator.
        arguments: checks of its arguments.
        size: number of components of a parameter.
        make: the engine of the simulator with other values of parameters.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        engine: Engine,
        arguments: Arguments,
        size: Callable[[str], int],
        make: Callable[[dict[str, Floats]], Engine],
    ) -> None:
        self._mechanism, self._engine, self._arguments = mechanism, engine, arguments
        self._models = RowModels(engine, size, make)
        self._no_impulses = RowImpulses.of(engine.model, 0)
        self._steppers: dict[tuple[int, int, bool], KnotStepper] = {}  # by threads, steps, whether contacts are kept

    def step(  # noqa: PLR0913
        self,
        X: ArrayLike,
        U: ArrayLike,
        substeps: int,
        derivatives: bool,
        kappa: ArrayLike | None,
        parameters: Mapping[str, ArrayLike] | None,
        contacts: bool,
        impulses: RowImpulses | None,
    ) -> StepBatch:
        """As `Simulator.step_batch`, which describes the arguments."""
        engine, check = self._engine, self._arguments
        quick = _is_row(X, engine.nx) and _is_row(U, engine.nu)
        inputs: Any = U if quick else check.inputs("step_batch", "U", U, ("n", engine.nu))
        count = len(inputs)
        given: Any = X if quick else checks.array(f"{_CALL}(X)", X, (count, engine.nx))
        states = check.states(f"{_CALL}(X)", given)
        steps = room_for(f"{_CALL}(substeps=...)", substeps, 8.0 * (engine.nx + engine.nu) * max(count, 1))
        parameters = checks.mapping(f"{_CALL}(parameters=...)", parameters)
        contacts = checks.flag(f"{_CALL}(contacts=...)", contacts)
        derivatives = checks.flag(f"{_CALL}(derivatives=...)", derivatives)
        kept = self._checked_impulses(impulses, count)
        alone = count == 1 and kappa is None and not parameters and not derivatives and not len(kept)
        if alone and engine.in_one_kernel:
            return self.stepper(steps, contacts).step(states, inputs)
        kappas = self._kappas(kappa, count)
        if contacts and derivatives:
            raise ValueError(f"{_CALL}(contacts=True): expected no derivatives")
        if contacts and not engine.in_one_kernel:
            s = engine.settings
            raise ValueError(
                f"{_CALL}(contacts=True): expected a simulator of order 2, got {s.kind}; use {s.way_to_order_two}, or "
                "step(...).contacts of each row"
            )
        rows = self._models.of(f"{_CALL}(parameters=...)", parameters, count)
        touched = np.zeros((count if contacts else 0, *engine.no_outputs[0].shape[1:]))
        settings = row_settings(rows, kappas)
        found, reports = RowBatch(rows, states, inputs, steps, kappas, touched, kept, settings).step(derivatives)
        if contacts:
            found = replace(found, contacts=contacts_of(self._mechanism, engine.settings.time_step, touched))
        if not len(found.unsolved):
            detail = reservation(reports, "row")
            return replace(found, detail=detail) if detail else found
        i = int(found.unsolved[0])
        detail = status_message(self._mechanism, f"{_CALL}: row {i}", reports[i], engine.settings.tolerance)
        return replace(found, detail=detail)

    def _kappas(self, kappa: ArrayLike | None, count: int) -> Floats:
        """(count,) central-path parameters, NaN for that of the simulator."""
        if kappa is None:
            return np.full(count, np.nan)
        name, order = f"{_CALL}(kappa=...)", self._engine.settings.order
        if order > 2:
            raise ValueError(f"{name}: steps of order {order} have none")
        if isinstance(kappa, float) and 0.0 < kappa < np.inf:  # an array of one number would take as long as two rows
            return np.full(count, kappa)
        given = checks.array(name, kappa, () if checks.ndim(name, kappa) == 0 else (count,))
        if not np.all(given > 0.0):
            raise ValueError(f"{name}: expected numbers above 0, got {kappa!r}")
        return np.array(np.broadcast_to(given, (count,)))

    def impulses(self, count: int) -> RowImpulses:
        """As `Simulator.row_impulses`."""
        model = self._engine.model
        size = CONE * len(model.contact_body) + BOUND * len(model.limit_dof) + len(Dry) * len(model.dry_dof)
        found = RowImpulses.of(model, room_for("Simulator.row_impulses(count)", count, 8.0 * (1 + size), least=0))
        return replace(found, rows=self)

    def row_stepper(
        self,
        impulses: RowImpulses,
        substeps: int,
        kappa: ArrayLike | None,
        parameters: Mapping[str, ArrayLike] | None,
    ) -> RowStepper:
        """As `RowImpulses.stepper`."""
        engine, count = self._engine, len(impulses)
        kept, kappas = self._checked_impulses(impulses, count), self._kappas(kappa, count)
        steps = room_for(f"{_CALL}(substeps=...)", substeps, 8.0 * (engine.nx + engine.nu) * max(count, 1))
        given = checks.mapping(f"{_CALL}(parameters=...)", parameters)
        rows = self._models.of(f"{_CALL}(parameters=...)", given, count)
        return RowStepper(rows, steps, kappas, kept, self._arguments)

    def _checked_impulses(self, given: RowImpulses | None, count: int) -> RowImpulses:
        """Checked impulses of `count` rows; of none where there are none, or where engines have no use for them."""
        none = self._no_impulses
        if given is None or not self._engine.in_one_kernel:
            return none
        if not isinstance(given, RowImpulses):
            raise TypeError(f"{_CALL}(impulses=...): expected impulses of Simulator.row_impulses, got {given!r}")
        if given.cones.shape != (count, *none.cones.shape[1:]) or given.bounds.shape[1] != none.bounds.shape[1]:
            raise ValueError(f"{_CALL}(impulses=...): expected those of {count} rows of this simulator, got {given!r}")
        return given

    def stepper(self, substeps: int, contacts: bool) -> KnotStepper:
        """As `Simulator.stepper`."""
        if type(substeps) is not int or type(contacts) is not bool:
            substeps = checks.whole_number("Simulator.stepper(substeps)", substeps)
            contacts = checks.flag("Simulator.stepper(contacts)", contacts)
        key, engine = (get_ident(), substeps, contacts), self._engine
        if key not in self._steppers:
            steps = room_for("Simulator.stepper(substeps)", substeps, 8.0 * (engine.nx + engine.nu + REPORT))
            if not engine.in_one_kernel:
                s = engine.settings
                raise ValueError(
                    "Simulator.stepper: expected a simulator of order 2, or of a higher one without contacts, limits "
                    f"and stiff joints, got {s.kind}; use {s.way_to_order_two}"
                )
            self._steppers[key] = KnotStepper(self._mechanism, engine, steps, contacts)
        return self._steppers[key]
