"""Steps of independent rows: each its own state, input, parameters and smoothing, on all cores."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from threading import get_ident
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.integrators.parallel_loops import BatchBuffers, RowTables, linearize_rows, roll_rows
from sim.integrators.rollout import Linearized, MotionBuffers
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import room_for
from sim.mechanism.renamed import renamed
from sim.mechanism.short_repr import short_repr
from sim.model.interruptible_loops import pieces
from sim.model.record_columns import Dry, StepReport, StepSetting
from sim.simulator.engines.division import DIVISIBLE, Division
from sim.simulator.engines.engine import BOUND, CONE, REPORT, Engine, finite_rows, refuse
from sim.simulator.results import (
    STATUSES,
    Contacts,
    Result,
    StepResult,
    checked,
    contacts_of,
    reservation,
    status_message,
)
from sim.simulator.row_impulses import RowImpulses
from sim.simulator.state_space import StateSpace
from solvers.status import Status
from solvers.types import Integers

Floats = NDArray[np.float64]

_KEPT = 512  # models
_UNDIVIDED = 1, 1.0, 0.0  # numbers of a Division


@dataclass(frozen=True)
class StepBatch(Result):
    """One knot of every row. An unsolved row keeps its state, and its derivatives are zero.

    Attributes:
        x: (n, nx) states after the knot.
        status: (n,) Status of each row.
        iterations: (n,) iterations of the last step of each row.
        A: (n, ndx, ndx) derivatives by the state of each row, or (0, ndx, ndx).
        B: (n, ndx, nu) derivatives by its input, held over the knot, or (0, ndx, nu).
        detail: sentence about an unsolved row, with its numbers.
        contacts: contacts of the last step of each row, if the call asked for them.
    """

    x: Floats
    status: Integers
    iterations: Integers
    A: Floats
    B: Floats
    detail: str = ""
    contacts: Contacts | None = None

    @property
    def unsolved(self) -> Integers:
        """Indices of the unsolved rows."""
        return np.flatnonzero(self.status)

    __repr__ = short_repr


def _is_row(values: Any, size: int) -> bool:
    """Whether it is an array (1, size) of finite floats, which needs no other check."""
    fits = type(values) is np.ndarray and values.dtype == np.float64 and values.shape == (1, size)
    return fits and isfinite(float(values.sum()))


class RowModels:
    """Engines by values of parameters; those of the last rows are kept."""

    def __init__(self, own: Engine, size: Callable[[str], int], make: Callable[[dict[str, Floats]], Engine]) -> None:
        """own: engine of rows without values; size: of a parameter; make: the engine of values."""
        self._own, self._size_of, self._make = own, size, make
        self._kept: OrderedDict[bytes, Engine] = OrderedDict()
        self._sizes: dict[str, int] = {}
        self._last: tuple[tuple[str, ...], Floats, list[Engine], Integers] | None = None

    def of(self, call: str, parameters: Mapping[str, ArrayLike] | None, count: int) -> tuple[list[Engine], Integers]:
        """Distinct engines, and which of them each of `count` rows has."""
        if not parameters:
            return [self._own], np.zeros(count, dtype=np.int64)
        sizes = {name: self._size(name) for name in parameters}
        columns = [self._columns(call, name, values, count) for name, values in parameters.items()]
        shared = all(len(column) == 1 for column in columns)
        if not shared:
            columns = [np.broadcast_to(column, (count, column.shape[1])) for column in columns]
        joined, names = np.concatenate(columns, axis=1), tuple(sizes)
        last = self._last  # calls repeat their models: to compare them takes a tenth of the time below
        if last is not None and last[0] == names and len(last[3]) == count and np.array_equal(last[1], joined):
            return last[2], last[3]
        rows, index = (joined, np.zeros(count, dtype=np.int64)) if shared else _distinct(joined)
        bounds = np.cumsum([0, *sizes.values()])
        engines = []
        for row in rows:
            key = repr(names).encode() + row.tobytes()
            if key not in self._kept:
                own = {name: row[a:b] for name, a, b in zip(sizes, bounds[:-1], bounds[1:], strict=True)}
                self._kept[key] = self._make(own)
            self._kept.move_to_end(key)
            engines.append(self._kept[key])
        while len(self._kept) > max(_KEPT, len(rows)):
            self._kept.popitem(last=False)
        self._last = names, joined, engines, index
        return engines, index

    def _columns(self, call: str, name: str, values: ArrayLike, count: int) -> Floats:
        """Values of a parameter, (count, components), or one row for all."""
        size = self._size(name)
        given = checks.floats(f"{call}: {name!r}", values)
        shaped = given[:, None] if given.ndim == 1 and size == 1 else given
        if shaped.shape in ((1, size), (count, size)):
            return shaped
        try:
            return np.broadcast_to(shaped, (count, size))
        except ValueError:
            raise ValueError(
                f"{call}: {name!r}: expected shape ({count}, {size}), or one row of it, got {given.shape}"
            ) from None

    def _size(self, name: str) -> int:
        """Number of components of a parameter."""
        if name not in self._sizes:
            self._sizes[name] = self._size_of(name)
        return self._sizes[name]


def _distinct(rows: Floats) -> tuple[Floats, Integers]:
    """The different rows, and which of them each is; mostly all are alike, which a comparison tells sooner."""
    if len(rows) and (rows == rows[0]).all():
        return rows[:1], np.zeros(len(rows), dtype=np.int64)
    found, index = np.unique(rows, axis=0, return_inverse=True)
    return found, index.reshape(-1)


@dataclass(frozen=True)
class RowBatch:
    """Rows that are stepped together."""

    engines: Sequence[Engine]
    index: Integers  # (n,) which engine each row has
    xs: Floats  # (n, nx)
    us: Floats  # (n, nu)
    substeps: int
    kappas: Floats  # (n,), NaN for that of the engine
    contacts: Floats  # (n, ncontact, 11) out, of the last step of each row, or (0, ncontact, 11): not kept
    impulses: RowImpulses  # of n rows, or of none

    __repr__ = short_repr

    def step(self, derivatives: bool) -> tuple[StepBatch, Floats]:
        """One knot of every row, and the report of each."""
        first = self.engines[0]
        n = len(self.us)
        A, B = (np.zeros((n if derivatives else 0, first.ndx, size)) for size in (first.ndx, first.nu))
        x_next, reports = np.array(self.xs), np.zeros((n, REPORT))
        if not first.in_one_kernel:
            self._by_engine(derivatives, A, B, x_next, reports)
        elif n and derivatives:
            self._linearize(A, B, x_next, reports)
        elif n:
            self._roll(x_next, reports)
        whole = reports[:, StepReport.STATUS] == Status.SOLVED
        for i in np.flatnonzero(reports[:, StepReport.STATUS]):
            if int(reports[i, StepReport.STATUS]) in DIVISIBLE:
                self._divide(int(i), derivatives, A, B, x_next, reports)
        if derivatives and (refuse(reports, n, A, B) < n or reports[:, StepReport.STATUS].any()):
            solved = reports[:, StepReport.STATUS] == Status.SOLVED
            reports[solved & ~(finite_rows(A) & finite_rows(B)), StepReport.STATUS] = Status.NOT_FINITE
        for i in np.flatnonzero(reports[:, StepReport.STATUS]):
            x_next[i] = self.xs[i]
            A[i : i + 1], B[i : i + 1] = 0.0, 0.0
        if len(self.impulses):
            self.impulses.known[:] = whole & (reports[:, StepReport.STATUS] == Status.SOLVED)
        statuses, iterations = (reports[:, k].astype(np.int64) for k in (StepReport.STATUS, StepReport.ITERATIONS))
        return StepBatch(x_next, statuses, iterations, A, B), reports

    def _kappa(self, row: int) -> float | None:
        """Kappa of a row; None for that of its engine."""
        level = float(self.kappas[row])
        return None if np.isnan(level) else level

    def _tables(self, derivatives: bool) -> tuple[RowTables, int]:
        """Tables of all rows, and the number of chunks."""
        n = len(self.us)
        works = self.engines[0].chunks(n)
        count = len(works)
        chunk = np.searchsorted(np.arange(1, count + 1) * n // count, np.arange(n), side="right")
        models = [engine.gradient_table() if derivatives else engine.step_table() for engine in self.engines]
        scratch = works[chunk]
        frames = np.array([engine.model.contact_frame for engine in self.engines])
        for k in map(int, np.flatnonzero((frames != frames[0]).reshape(len(frames), -1).any(axis=1))):
            own = self.index == k  # a Data has the contact frames of its Model
            scratch[own] = self.engines[k].chunks(n)[chunk[own]]
        different = {engine.settings: engine.settings.array() for engine in self.engines}
        settings = np.array([different[engine.settings] for engine in self.engines])[self.index]
        given = ~np.isnan(self.kappas)
        settings[given, StepSetting.KAPPA] = self.kappas[given]
        kept = self.impulses
        if len(kept):
            settings[:, StepSetting.IMPULSES] = kept.known
        return RowTables(
            np.array(models, dtype=models[0].dtype)[self.index], scratch, settings, kept.cones, kept.bounds, kept.dry
        ), count

    def _linearize(self, A: Floats, B: Floats, x_next: Floats, reports: Floats) -> None:
        """Steps and their derivatives."""
        rows, chunks = self._tables(derivatives=True)
        line = Linearized(self.xs, self.us, self.engines[0].no_wrenches, A, B, x_next, reports)
        done = np.zeros(len(self.us), dtype=np.int64)
        deadline = np.zeros(len(StepSetting))
        for _ in pieces(deadline, 2):
            rows.settings[:, StepSetting.DEADLINE] = deadline[StepSetting.DEADLINE]
            linearize_rows(rows, self.substeps, line, done, chunks)
            if np.all(done == self.substeps):
                break

    def _roll(self, x_next: Floats, reports: Floats) -> None:
        """Steps alone."""
        rows, chunks = self._tables(derivatives=False)
        first, n = self.engines[0], len(self.us)
        xs = np.empty((n, self.substeps + 1, first.nx))
        xs[:, 0] = self.xs
        us = np.repeat(self.us[:, None], self.substeps, axis=1)
        knots = np.zeros(n, dtype=np.int64)
        contacts = np.zeros((len(self.contacts) * self.substeps, *self.contacts.shape[1:]))
        motions = BatchBuffers(xs, us, reports[:, None], knots, first.no_wrenches, contacts, *first.no_outputs[1:])
        deadline = np.zeros(len(StepSetting))
        for _ in pieces(deadline, 2):
            rows.settings[:, StepSetting.DEADLINE] = deadline[StepSetting.DEADLINE]
            roll_rows(rows, motions, chunks)
            if np.all((knots == self.substeps) | (reports[:, StepReport.STATUS] != Status.SOLVED)):
                break
        x_next[:] = xs[:, -1]
        self.contacts[:] = contacts[self.substeps - 1 :: self.substeps]

    def _divide(self, row: int, derivatives: bool, A: Floats, B: Floats, x_next: Floats, reports: Floats) -> None:
        """A row that was not solved in whole steps."""
        engine = self.engines[self.index[row]]
        us = np.repeat(self.us[row : row + 1], self.substeps, axis=0)
        rolled = engine.roll(self.xs[row], us, kappa=self._kappa(row), derivatives=derivatives)
        reports[row] = rolled.reports[min(rolled.solved_steps, self.substeps - 1)]
        if rolled.solved_steps < self.substeps:
            return
        x_next[row] = rolled.xs[-1]
        if len(self.contacts):
            self.contacts[row] = rolled.contacts[-1]
        if derivatives:
            A[row], B[row] = np.eye(engine.ndx), 0.0
            for dx, du in zip(rolled.A, rolled.B, strict=True):
                A[row], B[row] = dx @ A[row], dx @ B[row] + du

    def _by_engine(self, derivatives: bool, A: Floats, B: Floats, x_next: Floats, reports: Floats) -> None:
        """Steps that compiled loops cannot make, the rows of an engine at a time."""
        for k, engine in enumerate(self.engines):
            rows = np.flatnonzero(self.index == k)
            xs, us = self.xs[rows], self.us[rows]
            if derivatives:
                A[rows], B[rows], x_next[rows], reports[rows] = engine.linearize(xs, us, self.substeps, None)
            else:
                found, status, _ = engine.roll_batch(xs, np.repeat(us[:, None], self.substeps, axis=1))
                reports[rows, StepReport.STATUS], reports[rows, StepReport.WORST] = status, -1.0  # not reported
                x_next[rows] = found[:, -1]


class KnotStepper:
    """Knots of one row after another, in buffers of its own: its threads and arrays would take as long as its steps.

    Args:
        mechanism: of a simulator.
        engine: of the simulator.
        steps: per knot.
        contacts: whether those of the last step are kept.
    """

    def __init__(self, mechanism: Mechanism, engine: Engine, steps: int, contacts: bool) -> None:
        self._mechanism, self._engine, self._steps = mechanism, engine, steps
        xs, us, reports = np.empty((steps + 1, engine.nx)), np.empty((steps, engine.nu)), np.empty((steps, REPORT))
        rows = np.zeros((steps if contacts else 0, *engine.no_outputs[0].shape[1:]))
        self._motion = MotionBuffers(xs, us, engine.external(None), reports, rows, *engine.no_outputs[1:])
        self._division = Division.none(steps)
        self._none = np.zeros((0, engine.ndx, engine.ndx)), np.zeros((0, engine.ndx, engine.nu))
        self._start, self.end, self._knot = xs[0], xs[-1], 0

    def advance(self, x: Floats, u: Floats) -> bool:
        """Take the steps of a knot; `end` (nx,) is the state after them until the next call.

        Args:
            x: (nx,) finite state.
            u: (nu,) finite input [N, N m].

        Returns:
            Whether all steps were solved; `result` says why not.
        """
        motion = self._motion
        self._start[:], motion.us[:] = x, u
        motion.reports.fill(0.0)
        motion.contacts.fill(0.0)
        for numbers, undivided in zip(self._division, _UNDIVIDED, strict=True):
            numbers.fill(undivided)
        self._knot = self._engine.take_steps(self._engine.step_table(), motion, None, self._division)
        return self._knot == self._steps

    def last_step(self) -> StepResult:
        """The last step of a knot that was solved, with the contacts that are kept."""
        (parts, fractions, errors), motion = self._division, self._motion
        status, iterations, residual, violation, _, _ = motion.reports[-1].tolist()
        scene = self._mechanism, self._engine.settings.time_step, motion.contacts[-1].copy()
        solved = self.end.copy(), STATUSES[int(status)], int(iterations), residual, violation, scene
        if parts[-1] == 1:
            return StepResult(*solved)
        division = int(parts[-1]), float(fractions[-1]), float(errors[-1])
        return StepResult(*solved, *division, reservation(fractions[-1:], errors[-1:]))

    def step(self, states: Floats, inputs: Floats) -> StepBatch:
        """The knot of a row.

        Args:
            states: (1, nx) finite state; columns behind it, as of a command, are ignored.
            inputs: (1, nu) finite inputs [N, N m].

        Returns:
            StepBatch without derivatives.
        """
        states = states[:, : self._engine.nx]
        self.advance(states[0], inputs[0])
        return self.result(states)

    def result(self, states: Floats) -> StepBatch:
        """How the knot ended that began at these states (1, nx), which a row keeps that was not solved."""
        solved = self._knot == self._steps
        last = self._motion.reports[-1 if solved else self._knot]
        status, iterations = last[:2].astype(np.int64)[:, None]
        if solved:
            return StepBatch(self.end[None].copy(), status, iterations, *self._none, contacts=self.contacts)
        detail = status_message(self._mechanism, "Simulator.step_batch: row 0", last, self._engine.settings.tolerance)
        return StepBatch(states, status, iterations, *self._none, detail, self.contacts)

    @property
    def contacts(self) -> Contacts | None:
        """Contacts (1, ncontact) of the last step, where they are kept."""
        rows = self.last_contacts
        return contacts_of(self._mechanism, self._engine.settings.time_step, rows.copy()) if len(rows) else None

    @property
    def last_contacts(self) -> Floats:
        """The same as rows (1, ncontact, 11) of `ContactRow`, until the next call; (0, ncontact, 11) without."""
        return self._motion.contacts[-1:]


class BatchStepping(StateSpace):
    """Steps of independent rows, for simulators."""

    def step_batch(
        self,
        X: ArrayLike,
        U: ArrayLike,
        substeps: int = 1,
        derivatives: bool = False,
        kappa: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        contacts: bool = False,
        impulses: RowImpulses | None = None,
        throw: bool = False,
    ) -> StepBatch:
        """One knot of independent rows, over all cores: row i goes from X[i] by `substeps` steps with U[i] held.

        A row starts from its own state alone, so its result depends neither on the other rows nor on the cores.

        Args:
            X: (n, nx) states.
            U: (n, nu) inputs [N, N m].
            substeps: time steps per knot.
            derivatives: whether to return those of every row by its state and input, too.
            kappa: central-path parameter, one or (n,); that of the simulator by default. Order 2 only.
            parameters: {name: (n,) or (n, components), or one row for all}, as in `parameters`: the rows are those of
                `with_parameters`, with the kappa of this simulator. A model is made once for each row of new values,
                and kept.
            contacts: whether to return those of the last step of every row, too; without derivatives.
            impulses: those with which the last steps of these rows ended, of `row_impulses`; written, so that a motion
                of many calls starts each knot where the last one ended, with fewer iterations. `forget` rows that jump
                (default None: every row starts from its state alone).
            throw: raise SimulationError where a step is not solved.

        Returns:
            StepBatch with the states after the knot, and A (n, ndx, ndx), B (n, ndx, nu).

        Raises:
            ValueError: a value is out of range, or has the wrong shape.
        """
        call = "Simulator.step_batch"
        quick = _is_row(X, self.nx) and _is_row(U, self.nu)
        inputs: Any = U if quick else self._arguments.inputs("step_batch", "U", U, ("n", self.nu))
        count = len(inputs)
        given: Any = X if quick else checks.array(f"{call}(X)", X, (count, self.nx))
        states = self._arguments.states(f"{call}(X)", given)
        steps = room_for(f"{call}(substeps=...)", substeps, 8.0 * (self.nx + self.nu) * max(count, 1))
        parameters = checks.mapping(f"{call}(parameters=...)", parameters)
        contacts = checks.flag(f"{call}(contacts=...)", contacts)
        derivatives = checks.flag(f"{call}(derivatives=...)", derivatives)
        kept = self._impulses(call, impulses, count)
        alone = count == 1 and kappa is None and not parameters and not derivatives and not len(kept)
        if alone and self.has_stepper:
            return checked(self.stepper(steps, contacts).step(states, inputs), throw)
        kappas = np.full(count, np.nan)
        if kappa is not None:
            if self.order > 2:
                raise ValueError(f"{call}(kappa=...): steps of order {self.order} have none")
            kappas[:] = checks.array(
                f"{call}(kappa=...)", kappa, () if checks.ndim(f"{call}(kappa=...)", kappa) == 0 else (count,)
            )
            if not np.all(kappas > 0.0):
                raise ValueError(f"{call}(kappa=...): expected numbers above 0, got {kappa!r}")
        if contacts and (derivatives or not self._engine.in_one_kernel):
            raise ValueError(f"{call}(contacts=True): expected no derivatives, and a simulator without an accuracy")
        engines, index = self._row_models.of(f"{call}(parameters=...)", parameters, count)
        rows = np.zeros((count if contacts else 0, *self._engine.no_outputs[0].shape[1:]))
        found, reports = RowBatch(engines, index, states, inputs, steps, kappas, rows, kept).step(derivatives)
        if contacts:
            found = replace(found, contacts=contacts_of(self.mechanism, self.time_step, rows))
        if len(found.unsolved):
            i = int(found.unsolved[0])
            found = replace(
                found, detail=status_message(self.mechanism, f"{call}: row {i}", reports[i], self.tolerance)
            )
        return checked(found, throw)

    def row_impulses(self, count: int) -> RowImpulses:
        """Room for the impulses of independent rows between calls of `step_batch`; in the beginning, none are known.

        Args:
            count: number of rows.

        Returns:
            RowImpulses.

        Raises:
            ValueError: count is not a whole number, or the rows do not fit the memory.
        """
        model = self._engine.model
        size = CONE * len(model.contact_body) + BOUND * len(model.limit_dof) + len(Dry) * len(model.dry_dof)
        return RowImpulses.of(model, room_for("Simulator.row_impulses(count)", count, 8.0 * (1 + size), least=0))

    def _impulses(self, call: str, given: RowImpulses | None, count: int) -> RowImpulses:
        """Checked impulses of `count` rows; of none where there are none, or where engines have no use for them."""
        if given is None or not self._engine.in_one_kernel:
            return self._no_impulses
        if not isinstance(given, RowImpulses):
            raise TypeError(f"{call}(impulses=...): expected impulses of Simulator.row_impulses, got {given!r}")
        none = self._no_impulses
        if given.cones.shape != (count, *none.cones.shape[1:]) or given.bounds.shape[1] != none.bounds.shape[1]:
            raise ValueError(f"{call}(impulses=...): expected those of {count} rows of this simulator, got {given!r}")
        return given

    @cached_property
    def _no_impulses(self) -> RowImpulses:
        return RowImpulses.of(self._engine.model, 0)

    @cached_property
    def _steppers(self) -> dict[tuple[int, int, bool], KnotStepper]:
        """By threads, numbers of steps, and whether they keep contacts."""
        return {}

    def stepper(self, substeps: int = 1, contacts: bool = False) -> KnotStepper:
        """Steps of a single state, as `step_batch` takes them, without checks of arguments: for many short calls.

        Args:
            substeps: time steps per knot.
            contacts: whether those of the last step are kept.

        Returns:
            KnotStepper of this thread, whose `step(X, U)` takes finite (1, nx) and (1, nu).

        Raises:
            ValueError: substeps is not a whole number above 0, or the simulator has no stepper.
        """
        if type(substeps) is not int or type(contacts) is not bool:
            substeps = checks.whole_number("Simulator.stepper(substeps)", substeps)
            contacts = checks.flag("Simulator.stepper(contacts)", contacts)
        key = get_ident(), substeps, contacts
        if key not in self._steppers:
            each = 8.0 * (self.nx + self.nu + REPORT)
            steps = room_for("Simulator.stepper(substeps)", substeps, each)
            if not self.has_stepper:
                raise ValueError(
                    "Simulator.stepper: expected a simulator without an accuracy, and of order 2 where there are "
                    "contacts or limits"
                )
            self._steppers[key] = KnotStepper(self.mechanism, self._engine, steps, contacts)
        return self._steppers[key]

    @property
    def has_stepper(self) -> bool:
        """Whether the simulator has a `stepper`: only with steps of one order in compiled loops, without an
        accuracy.
        """
        return self._engine.in_one_kernel

    single_row = renamed("stepper")
    has_single_rows = renamed("has_stepper")

    @cached_property
    def _row_models(self) -> RowModels:
        """Models of rows with other parameters."""
        simulator: Any = self
        return RowModels(
            self._engine,
            lambda name: len(self.parameters((name,)).values),
            lambda values: simulator.with_parameters(values)._engine,
        )
