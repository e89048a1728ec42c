"""Engine: the compiled calls of one packed mechanism, as functions of checked arrays.

Settings, reports and contacts are those of sim/integrators/rollout.py.

Calls that may take long are made in pieces (interruptible_loops.py). Ctrl-C between two pieces raises Interrupted
with the part of the result that is done.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.integrators import parallel_loops, rollout
from sim.integrators.feedback import FeedbackLaw, FeedbackRun, Path
from sim.integrators.rollout import MotionBuffers
from sim.model.data import Data
from sim.model.interruptible_loops import pieces
from sim.model.layout import Sizes, data_view
from sim.model.model import Model
from sim.model.record_columns import ContactRow, Inactive, StepReport
from sim.simulator.engines.linked_model import LinkedModel
from sim.simulator.engines.mean_states import MeanStates
from sim.simulator.results import IMPULSE, MOMENT, NORMAL, POINT, Interrupted
from sim.simulator.settings import Settings, of_call
from solvers.compiler import Table
from solvers.status import Status
from solvers.types import Cube, Floats, Integers, Vector

# numbers of a step, in loops that follow a law one more; and of one of its contacts or limits
REPORT, CONE, BOUND = int(StepReport.EARLIER), 16, 2
_LARGEST = [int(StepReport.LOST), int(StepReport.ERROR)]  # of several steps, the largest
_PARTS = int(StepReport.PARTS)
_SMALL = 4096  # numbers; `dot` of more may wake up threads
_WORTH_THREADS = 1000  # knots times tangent dimension: below, one core is done before the others wake up


def contact_rows(sizes: Sizes, *counts: int) -> Floats:
    """(*counts, ncontact, 11) zeros, 14 with the moments where a contact has torsional or rolling friction."""
    return np.zeros((*counts, sizes.ncontact, int(ContactRow.MOMENT) + (3 if sizes.nmoment else 0)))


class DividedStep(NamedTuple):
    """A divided step; see dividing_engine.py."""

    engine: Engine  # that of its parts
    rolled: Rolled  # its parts
    x: Vector  # (nx,) the state after it
    share: float  # of the momentum of bodies against each other that the parts end with and x has; nearly always 1

    @property
    def parts(self) -> int:
        """Their number."""
        return len(self.rolled.reports)

    def report(self) -> Vector:
        """(9,) that of the whole: all iterations, the largest of the other numbers."""
        out = self.rolled.reports.max(axis=0)
        out[StepReport.ITERATIONS], out[StepReport.WORST] = self.rolled.reports[:, StepReport.ITERATIONS].sum(), -1.0
        out[StepReport.PARTS], out[StepReport.LOST] = self.parts, 1.0 - self.share
        return np.asarray(out)

    def contacts(self) -> Floats:
        """(ncontact, 11) of the whole."""
        return contacts_of_parts(self.rolled.contacts)


def contacts_of_parts(parts: Floats) -> Floats:
    """(ncontact, 11) of a step in parts (n, ncontact, 11): impulses add up and act at their mean point.

    Their normal is the mean one, and gap and slip are those of the end. A sum over cones that turned may lie outside
    that of the mean normal.
    """
    out = parts[-1].copy()
    out[:, IMPULSE] = parts[..., IMPULSE].sum(axis=0)
    weight = np.linalg.norm(parts[..., IMPULSE], axis=2)
    out[:, MOMENT] = parts[..., MOMENT].sum(axis=0)
    total = weight.sum(axis=0)
    pressed = total > 0.0
    points, normals = (np.einsum("tc,tcj->cj", weight, parts[..., part]) for part in (POINT, NORMAL))
    out[pressed, POINT] = points[pressed] / total[pressed, None]
    length = np.linalg.norm(normals, axis=1)
    turned = (length > 0.0) & out[:, NORMAL].any(axis=1)  # without a normal, it is beyond its reach at the end
    out[turned, NORMAL] = normals[turned] / length[turned, None]
    return np.asarray(out)


class Rolled(NamedTuple):
    """A rollout; rows after the solved steps are undefined."""

    solved_steps: int
    xs: Floats  # (T + 1, nx)
    reports: Floats  # (T, 9) of StepReport
    contacts: Floats  # (T, ncontact, 11), or (0, ncontact, 11) beside derivatives
    A: Floats  # (T, ndx, ndx) derivatives, or (0, ndx, ndx)
    B: Floats  # (T, ndx, nu)

    @property
    def parts(self) -> Integers:
        """(T,) steps that each was divided into, 1 for whole ones."""
        return parts_of(self.reports)

    def summary(self) -> Vector:
        """(9,) report of the last step that was tried, with the largest loss and error of the solved ones."""
        if not len(self.reports):
            return np.zeros(REPORT)
        out = self.reports[min(self.solved_steps, len(self.reports) - 1)].copy()
        out[_LARGEST] = self.reports[: self.solved_steps, _LARGEST].max(axis=0, initial=0.0)
        return np.asarray(out)


def parts_of(reports: Floats) -> Integers:
    """(n,) steps that each of n steps was divided into, 1 for whole ones."""
    return np.maximum(reports[:, _PARTS], 1.0).astype(np.int64)


def add_report(total: Vector, report: Vector) -> None:
    """total = the report (9,) of the steps that come next, with the largest loss and error of all steps so far."""
    before = total[_LARGEST]
    total[:REPORT] = report
    total[_LARGEST] = np.maximum(before, report[_LARGEST])


def finite_rows(array: Floats) -> NDArray[np.bool_]:
    """Which rows (along the first axis) are finite throughout."""
    return np.asarray(np.isfinite(array).reshape(len(array), -1).all(axis=1))


def refuse(reports: Floats, count: int, *arrays: Floats) -> int:
    """The first of `count` steps with a row that is not finite, and NOT_FINITE as its status; `count` without one.

    A sum is looked at first, which takes a tenth of the time; small ones by `dot`, which has less to set up.
    """
    if all(isfinite(flat.dot(flat) if flat.size < _SMALL else flat.sum()) for flat in [a.ravel() for a in arrays]):
        return count
    good = np.logical_and.reduce([finite_rows(a) for a in arrays])
    if good.all():
        return count
    first = int(good.argmin())
    reports[first, StepReport.STATUS] = Status.NOT_FINITE
    return first


def interrupted(reports: Floats, knot: int) -> Floats:
    """The reports (T, 9), with that of the step `knot`, if there is one, saying that it was not tried."""
    reports[knot : knot + 1, :REPORT] = 0.0
    reports[knot : knot + 1, StepReport.STATUS], reports[knot : knot + 1, StepReport.WORST] = Status.INTERRUPTED, -1.0
    return reports


def knot_inputs(us: Floats, wrenches: Cube, t: int, substeps: int) -> tuple[Floats, Cube]:
    """Inputs and external wrenches of the steps of knot t."""
    return np.repeat(us[t : t + 1], substeps, axis=0), np.repeat(wrenches[t : t + 1], substeps, axis=0)


def chained(A: Floats, rolled: Rolled) -> tuple[Floats, Floats]:
    """Derivatives by state and held input of the end of a rollout, whose first state has the derivative A."""
    B = np.zeros((len(A), rolled.B.shape[2]))
    for dx, du in zip(rolled.A, rolled.B, strict=True):
        A, B = dx @ A, dx @ B + du
    return A, B


class Engine(LinkedModel):
    """Steps of order 2 of one packed mechanism, each a call of one kernel; the arrays that cross the border.

    It refuses steps that it cannot solve. `states` has views of its states; the other engines are in engine_choice.py.
    """

    second_order_reason = ""  # why all steps are of order 2, of an engine of a higher one
    in_one_kernel = True  # whether a step is one call of the kernel `step`, so that compiled loops can make it

    def __init__(self, model: Model, settings: Settings) -> None:
        super().__init__(model, settings)
        self.states = MeanStates(self)
        self._settings = settings.array()  # of calls without a deadline, which write nothing into it
        nothing = [
            np.empty((0, *shape))
            for shape in (
                (self.sizes.nbody, 6),
                contact_rows(self.sizes).shape,
                (self.ndx, self.ndx),
                (self.ndx, self.nu),
                (self.sizes.ncontact, CONE),
                (self.sizes.nlimit, BOUND),
            )
        ]
        self.no_wrenches, self._no_contacts = nothing[:2]
        self.no_predictions = tuple(nothing[2:])  # derivatives and cone variables of steps that a policy does not know
        self.no_outputs = self._no_contacts, *self.no_predictions[:2]  # contacts and derivatives of motions without

    def _settings_of(self, steps: int, kappa: float | None, max_iterations: int | None = None) -> Vector:
        """Settings of a call with a given number of steps; those of a single step have no deadline, and are shared."""
        shared = steps <= 1 and kappa is None and max_iterations is None
        return self._settings if shared else of_call(self._settings, kappa, max_iterations)

    def external(self, wrenches: Cube | None) -> Cube:
        """External wrenches as kernels take them, (T, nbody, 6), or (0, nbody, 6) where there are none."""
        return self.no_wrenches if wrenches is None else wrenches

    # -- motions -------------------------------------------------------------------------------------------------------

    def roll(
        self,
        x: Vector,
        us: Floats,
        wrenches: Cube | None = None,
        *,
        kappa: float | None = None,
        derivatives: bool = False,
    ) -> Rolled:
        """Steps from x (nx,) under the inputs us (T, nu) and external wrenches (T, nbody, 6).

        derivatives: those of every step, in one pass, instead of its contacts.
        """
        steps = len(us)
        xs = np.empty((steps + 1, self.nx))
        reports = np.zeros((steps, REPORT))
        xs[0] = x
        A, B = self.no_predictions[:2]
        contacts = self._no_contacts
        if derivatives:
            A, B = np.empty((steps, self.ndx, self.ndx)), np.empty((steps, self.ndx, self.nu))
            model = self.gradient_table()
        else:
            contacts = contact_rows(self.sizes, steps)
            model = self.step_table()
        motion = MotionBuffers(xs, us, self.external(wrenches), reports, contacts, A, B)
        try:
            knot = self.take_steps(model, motion, kappa)
        except Interrupted as stop:
            if derivatives:  # calls that differentiate have no partial result
                raise KeyboardInterrupt from None
            knot = stop.result
            raise Interrupted(Rolled(knot, xs, interrupted(reports, knot), contacts, A, B)) from None
        if knot < steps:
            np.nan_to_num(reports[knot], copy=False, nan=np.inf, posinf=np.inf)
        return Rolled(knot, xs, reports, contacts, A, B)

    def rehearse(self, x: Vector, *, derivatives: bool = False) -> None:
        """Make the calls of a motion through the state x (nx,) once: later ones load no code, and lay out no buffers.

        derivatives: those of motions with derivatives as well.
        """
        us = np.zeros((1, self.nu))
        self.roll(x, us)
        if derivatives:
            self.roll(x, us, derivatives=True)

    def take_steps(
        self,
        model: Table,
        motion: MotionBuffers,
        kappa: float | None,
        following: FeedbackRun | None = None,
        first: int = 0,
        max_iterations: int | None = None,
    ) -> int:
        """Steps from the one `first` until the end or the first unsolved one: the number of solved ones, those before
        included, which Interrupted carries, too.

        max_iterations: of a step; None: that of the settings.
        """
        steps, knot = len(motion.us) * (following.substeps if following else 1), first
        data, settings = self._scratch.table(), self._settings_of(steps, kappa, max_iterations)
        try:
            for _ in pieces(settings, steps):
                knot = int(rollout.roll(model, data, settings, motion, knot, None, following))
                if knot == steps:
                    break
                if motion.reports[min(knot, len(motion.reports) - 1), StepReport.STATUS] != Status.SOLVED:
                    break
        except KeyboardInterrupt:
            raise Interrupted(knot) from None
        return knot

    def divide(
        self, x: Vector, u: Vector, wrench: Cube, kappa: float | None = None, *, derivatives: bool = False
    ) -> DividedStep | None:
        """None: this engine refuses steps that it cannot solve. See dividing_engine.py."""
        return None

    def divisions(self, x: Vector, u: Vector, wrench: Cube, kappa: float | None) -> Iterator[DividedStep]:
        """The step in 2, 4, ... parts, with derivatives, in all ways that keep its momentum: none here."""
        return iter(())

    def nodes_at(self, motion: tuple[Floats, Floats, Floats | None], times: Vector) -> Floats:
        """(n, nx) states at any times of a motion; only engines with an accuracy have them."""
        raise ValueError("Simulator.nodes_at: fixed time steps have states at their ends only; use accuracy=...")

    def forget_parts(self) -> None:
        """Let `last` be that of a step as a whole; only engines that divide steps have parts."""

    def undivided(self) -> Engine:
        """The engine that refuses steps which it cannot solve as a whole."""
        return self

    def conversions(self, x: Vector, divided: DividedStep) -> tuple[Floats, Floats]:
        """Derivatives at both ends of a divided step from x; only engines that divide steps make one."""
        raise NotImplementedError

    def _path(self, knots: int, *, keep: bool, cones: bool = True) -> Path:
        """Buffers of a rollout with a given number of knots; without `cones`, none of contacts and limits."""
        kept = knots if keep else 0
        ncontact, nlimit = (self.sizes.ncontact, self.sizes.nlimit) if cones else (0, 0)
        return Path(
            np.zeros((knots + 1, self.nx)),
            np.zeros((knots, self.nu)),
            np.zeros((kept, ncontact, CONE)),
            np.zeros((kept, nlimit, BOUND)),
            np.zeros(REPORT + 1),
        )

    def roll_feedback(
        self,
        x: Vector,
        policy: FeedbackLaw,
        alpha: float,
        limits: tuple[Floats, Floats],
        substeps: int,
        kappa: float | None,
        *,
        keep: bool = False,
        max_iterations: int | None = None,
    ) -> tuple[int, Path]:
        """(number of solved knots, rollout); with `keep` also the cone variables of its steps."""
        knots = len(policy.us)
        path = self._path(knots, keep=keep)
        path.xs[0], steps = x, knots * substeps
        motion = MotionBuffers(path.xs, path.us, policy.wrenches, path.report[None], *self.no_outputs)
        following = FeedbackRun(policy, float(alpha), *limits, substeps, path.cones, path.bounds)
        try:
            done = self.take_steps(self.step_table(), motion, kappa, following, 0, max_iterations)
        except Interrupted as stop:
            interrupted(path.report[None], 0 if stop.result < steps else 1)
            raise Interrupted((stop.result // substeps, path)) from None
        if done < steps:
            np.nan_to_num(path.report, copy=False, nan=np.inf, posinf=np.inf)
        else:
            path.report[StepReport.ITERATIONS] = path.report[StepReport.EARLIER]
        return done // substeps, path

    def linearize(
        self,
        xs: Floats,
        us: Floats,
        substeps: int,
        kappa: float | None,
        guess: Floats | None = None,
        wrenches: Cube | None = None,
    ) -> tuple[Floats, ...]:
        """(A, B, next states, report of every knot) of all knots; in parallel where that pays.

        guess: (T, nx) next states to start from, by default the states themselves.
        """
        n = len(us)
        A, B = np.empty((n, self.ndx, self.ndx)), np.empty((n, self.ndx, self.nu))
        x_next, reports = np.empty((n, self.nx)), np.zeros((n, REPORT))
        if guess is not None:
            x_next[:] = guess
        else:
            x_next[: len(xs) - 1] = xs[1 : n + 1]
            if len(xs) == n:
                x_next[-1:] = xs[-1:]
        line = rollout.Linearized(xs, us, self.external(wrenches), A, B, x_next, reports)
        model, settings = self.gradient_table(), self._settings_of(n * substeps, kappa)
        if n * substeps * self.ndx < _WORTH_THREADS:
            data, step = self._scratch.table(), 0
            for _ in pieces(settings, n * substeps):
                step = int(rollout.linearize(model, data, settings, (0, step, n), substeps, line))
                if step == n * substeps:
                    break
        else:
            data_tables = self._scratch.chunks(n)
            ends = [c * n // len(data_tables) * substeps for c in range(len(data_tables) + 1)]
            done = np.array(ends[:-1])
            for _ in pieces(settings, n * substeps):
                parallel_loops.linearize_knots(model, data_tables, settings, substeps, line, done)
                if done.tolist() == ends[1:]:
                    break
        if np.count_nonzero(reports[:, StepReport.STATUS]):
            unsolved = reports[:, StepReport.STATUS] != Status.SOLVED
            for array in (A, B, x_next):
                array[unsolved] = 0.0
        return A, B, x_next, reports

    def linearize_plan(
        self, xs: Floats, us: Floats, substeps: int, kappa: float, guess: Floats | None = None
    ) -> tuple[Floats, ...]:
        """As linearize, with derivatives that lead a planner on where those of the steps do not."""
        return self.linearize(xs, us, substeps, kappa, guess)

    def linearize_knot(
        self, x: Vector, given: tuple[Floats, Cube], kappa: float | None
    ) -> tuple[Floats, Floats, Vector, Vector]:
        """(A, B, next state, report) of a knot: products of the derivatives of its steps, in a rollout from x.

        given: inputs and external wrenches of the steps; see `knot_inputs`.
        """
        us, wrenches = given
        rolled = self.roll(x, us, wrenches, kappa=kappa, derivatives=True)
        report = rolled.reports[min(rolled.solved_steps, len(us) - 1)]
        if rolled.solved_steps < len(us):
            return np.zeros((self.ndx, self.ndx)), np.zeros((self.ndx, self.nu)), np.zeros(self.nx), report
        report[StepReport.ACCURACY] = rolled.reports[:, StepReport.ACCURACY].max()
        return *chained(np.eye(self.ndx), rolled), rolled.xs[-1], report

    def linearize_one(
        self, x: Vector, u: Vector, kappa: float | None, wrenches: Cube | None = None
    ) -> tuple[Floats, Floats, Vector, Vector]:
        """(A, B, next state, report) of one step."""
        A, B, x_next, reports = self.linearize(x[None], u[None], 1, kappa, None, wrenches)
        return A[0], B[0], x_next[0], reports[0]

    def roll_batch(self, x0s: Floats, us: Floats) -> tuple[Floats, Floats, Integers]:
        """(states, report and number of solved steps of every rollout), in parallel."""
        n, steps = us.shape[:2]
        xs, reports, knots = np.zeros((n, steps + 1, self.nx)), np.zeros((n, 1, REPORT)), np.zeros(n, dtype=np.int64)
        motions = parallel_loops.BatchBuffers(
            xs, us, reports, knots, self.no_wrenches, self._no_contacts, *self.no_predictions[:2]
        )
        model, data_tables, settings = self.step_table(), self._scratch.chunks(n), self.settings.array()
        status = reports[:, 0, StepReport.STATUS]
        try:
            xs[:, 0] = x0s  # the first touch of much memory takes its time
            for _ in pieces(settings, n * steps):
                parallel_loops.roll_batch(model, data_tables, settings, motions)
                if np.all((knots == steps) | (status != Status.SOLVED)):
                    break
        except KeyboardInterrupt:
            status[(knots < steps) & (status == Status.SOLVED)] = Status.INTERRUPTED
            raise Interrupted((xs, reports.reshape(n, REPORT), knots)) from None
        return xs, reports.reshape(n, REPORT), knots

    def inactive(self) -> NDArray[np.bool_]:
        """Whether each contact was inactive in the last step of this thread, in its derivatives, too, (ncontact,)."""
        out = np.ones(self.sizes.ncontact, dtype=bool)
        data = self.last()
        out[data.active[: data.active_count[0]]] = False
        for first in data.inactive_first[: data.inactive_count[0]]:
            if data.inactive[first, Inactive.STIFF] > 0.0:
                out[first : self.model.cluster_end[first]] = False
        return out

    def last(self) -> Data:
        """Data of the last step of this thread."""
        return data_view(self._scratch.table())

    def strategy_solves(self) -> Integers:
        """Solutions by start strategy (solve/globalization.py) of all steps of this thread so far, (64,)."""
        return data_view(self._scratch.table()).strategy_solves.copy()

    def open_loops(self) -> list[float]:
        """Gaps of loops, then gears, in the last iterate of this thread [m, or sine of an angle]."""
        ends = self.model.coupling_row[len(self.model.coupling_body) - self.sizes.nloop :]
        ends = np.concatenate([ends, ends[-1] + 1 + np.arange(self.sizes.ngear)])
        gap = np.abs(self.last().couple_gap)
        return [float(gap[a:b].max()) for a, b in zip(ends[:-1], ends[1:], strict=True)]
