"""Steps of independent rows: each its own state, input, parameters and smoothing, on all cores."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import get_ident

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.integrators.parallel_loops import BatchBuffers, RowTables, linearize_rows, roll_rows
from sim.integrators.rollout import Linearized
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.model.interruptible_loops import pieces
from sim.model.record_columns import StepReport, StepSetting
from sim.simulator.engines.division import DIVISIBLE
from sim.simulator.engines.engine import REPORT, Engine, chained, finite_rows, refuse
from sim.simulator.results import Contacts, Result
from sim.simulator.row_impulses import RowImpulses
from solvers.compiler import Table
from solvers.status import Status
from solvers.types import Integers

Floats = NDArray[np.float64]

_KEPT = 512  # models
_STATUS, _ITERATIONS = int(StepReport.STATUS), int(StepReport.ITERATIONS)  # NumPy is slower with members of an enum
_IMPULSES, _DEADLINE, _SETTINGS = int(StepSetting.IMPULSES), int(StepSetting.DEADLINE), len(StepSetting)


@dataclass(frozen=True)
class StepBatch(Result):
    """One knot of every row. An unsolved row keeps its state, and its derivatives are zero.

    Attributes:
        x: (n, nx) states after the knot.
        status: (n,) Status of each row.
        iterations: (n,) iterations of the last step of each row; 0 for orders above 2 and an accuracy, whose steps have
            several solves or none.
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


@dataclass(frozen=True)
class RowEngines:
    """The engines of rows, and the tables that all steps of these rows share.

    Attributes:
        engines: distinct engines.
        index: (n,) which of them each row has.
    """

    engines: Sequence[Engine]
    index: Integers

    __repr__ = short_repr

    @cached_property
    def step_tables(self) -> Table:
        """(n, ...) tables of the Models of rows, with steps linked."""
        return self._by_row([engine.step_table() for engine in self.engines])

    @cached_property
    def gradient_tables(self) -> Table:
        """(n, ...) the same, with derivatives linked."""
        return self._by_row([engine.gradient_table() for engine in self.engines])

    @cached_property
    def settings(self) -> Floats:
        """(n, 10) settings of rows, of StepSetting."""
        different = {engine.settings: engine.settings.array() for engine in self.engines}
        return np.array([different[engine.settings] for engine in self.engines])[self.index]

    @cached_property
    def turned(self) -> list[int]:
        """Engines whose contact frames are not those of the first one."""
        frames = np.array([engine.model.contact_frame for engine in self.engines])
        return [int(k) for k in np.flatnonzero((frames != frames[0]).reshape(len(frames), -1).any(axis=1))]

    def scratch(self, data_tables: Table) -> Table:
        """(n, ...) tables of the Data of rows, whose chunks share those given; kept for the next call of a thread."""
        n, count, whole = len(self.index), len(data_tables), data_tables.base
        before, kept = self._kept_scratch.get(get_ident(), (None, data_tables))
        if whole is not None and whole is before and not self.turned:
            return kept
        chunk = np.searchsorted(np.arange(1, count + 1) * n // count, np.arange(n), side="right")
        found: Table = data_tables[chunk]
        for k in self.turned:
            own = self.index == k  # a Data has the contact frames of its Model
            found[own] = self.engines[k].chunks(n)[chunk[own]]
        self._kept_scratch[get_ident()] = whole, found
        return found

    @cached_property
    def _kept_scratch(self) -> dict[int, tuple[Table | None, Table]]:
        """By thread, the array that the last tables of Data are a part of, and the tables of rows."""
        return {}

    def _by_row(self, tables: list[Table]) -> Table:
        found: Table = np.array(tables, dtype=tables[0].dtype)[self.index]
        return found


class RowModels:
    """Engines by values of parameters; those of the last rows are kept."""

    def __init__(self, own: Engine, size: Callable[[str], int], make: Callable[[dict[str, Floats]], Engine]) -> None:
        """own: engine of rows without values; size: of a parameter; make: the engine of values."""
        self._own, self._size_of, self._make = own, size, make
        self._kept: OrderedDict[bytes, Engine] = OrderedDict()
        self._sizes: dict[str, int] = {}
        self._last: tuple[tuple[str, ...], Floats, RowEngines] | None = None
        self._alike = RowEngines([own], np.zeros(0, dtype=np.int64))

    def of(self, call: str, parameters: Mapping[str, ArrayLike] | None, count: int) -> RowEngines:
        """The engines of `count` rows."""
        if not parameters:
            if len(self._alike.index) != count:
                self._alike = RowEngines([self._own], np.zeros(count, dtype=np.int64))
            return self._alike
        sizes = {name: self._size(name) for name in parameters}
        columns = [self._columns(call, name, values, count) for name, values in parameters.items()]
        shared = all(len(column) == 1 for column in columns)
        if not shared:
            columns = [np.broadcast_to(column, (count, column.shape[1])) for column in columns]
        joined, names = np.concatenate(columns, axis=1), tuple(sizes)
        last = self._last  # calls repeat their models: to compare them takes a tenth of the time below
        if last is not None and last[0] == names and len(last[2].index) == count and np.array_equal(last[1], joined):
            return last[2]
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
        found = RowEngines(engines, index)
        self._last = names, joined, found
        return found

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


def row_settings(rows: RowEngines, kappas: Floats) -> Floats:
    """(n, 10) settings of rows, of StepSetting, with these kappas (n,) where they are not NaN."""
    settings = rows.settings.copy()
    given = ~np.isnan(kappas)
    settings[given, StepSetting.KAPPA] = kappas[given]
    return settings


@dataclass(frozen=True)
class RowBatch:
    """Rows that are stepped together."""

    rows: RowEngines
    xs: Floats  # (n, nx)
    us: Floats  # (n, nu)
    substeps: int
    kappas: Floats  # (n,), NaN for that of the engine
    contacts: Floats  # (n, ncontact, 11) out, of the last step of each row, or (0, ncontact, 11): not kept
    impulses: RowImpulses  # of n rows, or of none
    settings: Floats  # (n, 10) of StepSetting

    __repr__ = short_repr

    def step(self, derivatives: bool, room: tuple[Floats, Floats] | None = None) -> tuple[StepBatch, Floats]:
        """One knot of every row, and the report of each; room for derivatives: A and B."""
        first = self.rows.engines[0]
        n = len(self.us)
        if room is None:
            room = (
                np.zeros((n if derivatives else 0, first.ndx, first.ndx)),
                np.zeros((n if derivatives else 0, first.ndx, first.nu)),
            )
        A, B = room
        x_next, reports = np.array(self.xs), np.zeros((n, REPORT))
        if not first.in_one_kernel:
            self._by_engine(derivatives, A, B, x_next, reports)
        elif n and derivatives:
            self._linearize(A, B, x_next, reports)
        elif n:
            self._roll(x_next, reports)
        known = first.in_one_kernel or not derivatives  # the kernel looks at the derivatives of every step
        if reports[:, _STATUS].any() or not (known or refuse(reports, n, A, B) == n):
            self._mend(derivatives, A, B, x_next, reports)
        elif len(self.impulses):
            self.impulses.known[:] = True
        statuses, iterations = reports[:, _STATUS].astype(np.int64), reports[:, _ITERATIONS].astype(np.int64)
        return StepBatch(x_next, statuses, iterations, A, B), reports

    def _mend(self, derivatives: bool, A: Floats, B: Floats, x_next: Floats, reports: Floats) -> None:
        """Divide unsolved steps; rows that remain unsolved keep their states, with derivatives of zero."""
        n = len(self.us)
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

    def _kappa(self, row: int) -> float | None:
        """Kappa of a row; None for that of its engine."""
        level = float(self.kappas[row])
        return None if np.isnan(level) else level

    def _tables(self, derivatives: bool) -> tuple[RowTables, int]:
        """Tables of all rows, and the number of chunks."""
        n, rows = len(self.us), self.rows
        models = rows.gradient_tables if derivatives else rows.step_tables
        data_tables = rows.engines[0].chunks(n)
        scratch, count = rows.scratch(data_tables), len(data_tables)
        settings, kept = self.settings, self.impulses
        if len(kept):
            settings[:, _IMPULSES] = kept.known
        return RowTables(models, scratch, settings, kept.cones, kept.bounds, kept.dry), count

    def _linearize(self, A: Floats, B: Floats, x_next: Floats, reports: Floats) -> None:
        """Steps and their derivatives."""
        rows, chunks = self._tables(derivatives=True)
        line = Linearized(self.xs, self.us, self.rows.engines[0].no_wrenches, A, B, x_next, reports)
        done = np.zeros(len(self.us), dtype=np.int64)
        deadline = np.zeros(_SETTINGS)
        for _ in pieces(deadline, 2):
            rows.settings[:, _DEADLINE] = deadline[_DEADLINE]
            linearize_rows(rows, self.substeps, line, done, chunks)
            if (done == self.substeps).all():
                break

    def _roll(self, x_next: Floats, reports: Floats) -> None:
        """Steps alone."""
        rows, chunks = self._tables(derivatives=False)
        first, n = self.rows.engines[0], len(self.us)
        xs = np.empty((n, self.substeps + 1, first.nx))
        xs[:, 0] = self.xs
        us = np.repeat(self.us[:, None], self.substeps, axis=1)
        knots = np.zeros(n, dtype=np.int64)
        contacts = np.zeros((len(self.contacts) * self.substeps, *self.contacts.shape[1:]))
        motions = BatchBuffers(xs, us, reports[:, None], knots, first.no_wrenches, contacts, *first.no_outputs[1:])
        deadline = np.zeros(_SETTINGS)
        for _ in pieces(deadline, 2):
            rows.settings[:, StepSetting.DEADLINE] = deadline[StepSetting.DEADLINE]
            roll_rows(rows, motions, chunks)
            if np.all((knots == self.substeps) | (reports[:, StepReport.STATUS] != Status.SOLVED)):
                break
        x_next[:] = xs[:, -1]
        self.contacts[:] = contacts[self.substeps - 1 :: self.substeps]

    def _divide(self, row: int, derivatives: bool, A: Floats, B: Floats, x_next: Floats, reports: Floats) -> None:
        """A row that was not solved in whole steps."""
        engine = self.rows.engines[self.rows.index[row]]
        us = np.repeat(self.us[row : row + 1], self.substeps, axis=0)
        rolled = engine.roll(self.xs[row], us, kappa=self._kappa(row), derivatives=derivatives)
        reports[row] = rolled.summary()
        if rolled.solved_steps < self.substeps:
            return
        x_next[row] = rolled.xs[-1]
        if len(self.contacts):
            self.contacts[row] = rolled.contacts[-1]
        if derivatives:
            A[row], B[row] = chained(np.eye(engine.ndx), rolled)

    def _by_engine(self, derivatives: bool, A: Floats, B: Floats, x_next: Floats, reports: Floats) -> None:
        """Steps that compiled loops cannot make, the rows of an engine at a time."""
        for k, engine in enumerate(self.rows.engines):
            rows = np.flatnonzero(self.rows.index == k)
            xs, us = self.xs[rows], self.us[rows]
            if derivatives:
                A[rows], B[rows], x_next[rows], reports[rows] = engine.linearize(xs, us, self.substeps, None)
            else:
                found, reports[rows], _ = engine.roll_batch(xs, np.repeat(us[:, None], self.substeps, axis=1))
                x_next[rows] = found[:, -1]
