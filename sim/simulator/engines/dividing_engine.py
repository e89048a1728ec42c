"""Engine that divides steps: one that cannot be solved, or turns a body too far, becomes 2, 4, ... steps of order 2.

The parts are steps of h/n at kappa/n, so contacts press with the same force kappa/(n h/n gap) at the same gap. The
momentum of the node is conserved at both ends, to rounding (intervals.py): the mean velocity of a state over its
interval becomes that over h/n which has the same momentum, and after n steps the other way round.

A divided step depends on its state and input alone, never on the steps before it, and neither does the next one. Its
derivatives are the products of those of its parts and of both conversions.

Rescues, where none of 2 to LARGEST_DIVISION parts does: more parts for joints that turn fast (FASTEST_DIVISION), and
the nearest state where none has the momentum of the last part (nearest_state.py). Shapes that overlap where the step
begins may be such that joints open them by turns of a radian and more, or by none: then each part leaves a half, nine
tenths, or all of their overlap (_LEFT), and only resists a deeper one.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator

import numpy as np

from sim.integrators.feedback import FeedbackRun
from sim.integrators.rollout import MotionBuffers
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import StepReport
from sim.simulator.engines.division import DIVISIBLE
from sim.simulator.engines.engine import (
    DividedStep,
    Engine,
    Floats,
    Rolled,
    add_report,
    chained,
    contacts_of_parts,
    knot_inputs,
    refuse,
)
from sim.simulator.engines.interval_states import IntervalStates
from sim.simulator.engines.intervals import Intervals
from sim.simulator.engines.nearest_state import nearest_state
from sim.simulator.results import Interrupted
from sim.simulator.settings import Settings
from solvers.compiler import Table
from solvers.status import Status
from solvers.types import Cube, Integers, Vector

__all__ = ["LARGEST_DIVISION", "DividingEngine"]

LARGEST_DIVISION = 1024  # parts of a step
FASTEST_DIVISION = 262144  # of one in which a joint turns by _TURN in each of them

_TURN = 0.02  # [rad]

_LEFT = (0.5, 0.9, 1.0)  # of the overlaps of shapes where a part begins, tried in this order
_PARTS_LEFT = (2, 8, 32)  # divisions with each
_LOSS = 0.1  # largest loss of energy in a whole step where nothing dissipates, of the energies that change
_PART = 1e-3  # largest gain or loss in a part
_PIECE, _LARGEST_PIECE = 16, 1024  # steps at once after a divided one: those after the next divided one are discarded


def _rows(motion: MotionBuffers, first: int, count: int) -> MotionBuffers:
    """Steps `first` to first + count of a motion, as a motion of their own; reports that were not kept stay so."""
    last = first + count
    reports = motion.reports[first:last] if len(motion.reports) == len(motion.us) else motion.reports
    return MotionBuffers(
        motion.xs[first : last + 1],
        motion.us[first:last],
        motion.wrenches[first:last],
        reports,
        motion.contacts[first:last],
        motion.A[first:last],
        motion.B[first:last],
    )


def _divisible(status: Floats | Integers) -> list[int]:
    """The knots whose status is one of those that shorter steps may solve."""
    return [int(i) for i in np.flatnonzero(status) if int(status[i]) in DIVISIBLE] if np.count_nonzero(status) else []


class DividingEngine(Engine):
    """The kernels of one packed mechanism, with steps of order 2 that are divided where that is necessary."""

    def __init__(self, model: Model, settings: Settings) -> None:
        super().__init__(model, settings._replace(loss=_LOSS))
        self.intervals = Intervals(self)
        self.states = IntervalStates(self, self.intervals)
        self._engines: dict[int, Engine] = {}  # by the number of parts of a step
        self._lenient: dict[tuple[int, float], Engine] = {}  # by it and the part of overlaps that they leave
        self._ended = threading.local()  # `parts`: the engine of the last step of this thread, if that was divided

    def undivided(self) -> Engine:
        """As Engine.undivided: the engine that refuses steps that fail as a whole."""
        if 1 not in self._engines:
            self._engines[1] = Engine(self.model, self.settings._replace(loss=math.inf))
        return self._engines[1]

    def refresh(self) -> None:
        """As LinkedModel.refresh, with the engines of the parts."""
        super().refresh()
        for engine in (*self._engines.values(), *self._lenient.values()):
            engine.refresh()

    def part(self, parts: int, left: float = 0.0) -> Engine:
        """The engine of the parts of a step.   left: part of the overlaps where they begin that they leave."""
        s = self.settings
        short = s._replace(time_step=s.time_step / parts, kappa=s.kappa / parts, gain=_PART, loss=_PART, left=left)
        if left > 0.0:
            if (parts, left) not in self._lenient:
                self._lenient[parts, left] = Engine(self.model, short)
            return self._lenient[parts, left]
        if parts not in self._engines:
            self._engines[parts] = Engine(self.model, short)
        return self._engines[parts]

    # -- one step ------------------------------------------------------------------------------------------------------

    def divide(
        self, x: Vector, u: Vector, wrench: Cube, kappa: float | None = None, *, derivatives: bool = False
    ) -> DividedStep | None:
        """The step from x (nx,) under u (nu,) and external wrenches (1 or 0, nbody, 6) in as few parts as possible.

        Where no division ends in a state with the momentum of its last part, the first that ends at all is taken, with
        the state nearest to it. None where no division ends; with derivatives also where the end loses momentum, which
        has none. More parts might keep it, but they would be another step.
        """
        divisions = self._numbers_of_parts(x, derivatives)
        for parts in divisions:
            found = self.in_parts(parts, x, (u, wrench), kappa, derivatives=derivatives)
            if found is not None:
                return None if derivatives and found.share < 1.0 else found
        for parts in [] if derivatives else divisions:
            found = self.in_parts(parts, x, (u, wrench), kappa, nearest=True)
            if found is not None:
                return found
        overlaps = [] if derivatives or len(self.model.pair_kind) == 0 else _LEFT
        for left in overlaps:
            for parts in _PARTS_LEFT:
                found = self.in_parts(parts, x, (u, wrench), kappa, left=left)
                if found is not None:
                    return found
        return None

    def divisions(self, x: Vector, u: Vector, wrench: Cube, kappa: float | None) -> Iterator[DividedStep]:
        """As Engine.divisions."""
        for parts in self._numbers_of_parts(x, derivatives=True):
            found = self.in_parts(parts, x, (u, wrench), kappa, derivatives=True)
            if found is not None and found.share == 1.0:
                yield found

    def _numbers_of_parts(self, x: Vector, derivatives: bool) -> list[int]:
        """Numbers of parts to try for a step from x (nx,): few with derivatives, many for joints that turn fast."""
        parts = [2]
        turn = 0.0 if derivatives else self.intervals.turn(x)
        while 2 * parts[-1] <= LARGEST_DIVISION or (2 * parts[-1] <= FASTEST_DIVISION and turn > 2 * parts[-1] * _TURN):
            parts.append(2 * parts[-1])
        return parts

    def in_parts(
        self,
        parts: int,
        x: Vector,
        given: tuple[Vector, Cube],
        kappa: float | None = None,
        *,
        derivatives: bool = False,
        nearest: bool = False,
        left: float = 0.0,
    ) -> DividedStep | None:
        """The step in the given number of parts; None if one of them is not solved. given: input, external wrenches.

        nearest: where the last part has a momentum that no state has, take the nearest one, nearest_state.py.
        left: part of the overlaps of shapes that each part leaves.
        """
        engine = self.part(parts, left)
        part = engine.settings.time_step
        first = self.intervals.to_part(x, part)
        if first is None:
            return None
        level = None if kappa is None else kappa / parts
        rolled = self._roll_parts(engine, first, parts, given, level, derivatives=derivatives)
        if rolled.solved_steps < parts:
            return None
        last = rolled.xs[-1]
        end = self.intervals.from_part(last, part)
        if end is not None:
            return DividedStep(engine, rolled, end, 1.0)
        slowed = nearest_state(self.intervals, last, part) if nearest else self.intervals.slowed(last, part)
        return None if slowed is None else DividedStep(engine, rolled, *slowed)

    @staticmethod
    def _roll_parts(
        engine: Engine, x: Vector, parts: int, given: tuple[Vector, Cube], kappa: float | None, *, derivatives: bool
    ) -> Rolled:
        """The parts of a step from x (nx,). If there are more than LARGEST_DIVISION, contacts are those of as many."""
        at_once = min(parts, LARGEST_DIVISION)
        us, wrenches = np.repeat(given[0][None], at_once, axis=0), np.repeat(given[1], at_once, axis=0)
        rolled = engine.roll(x, us, wrenches, kappa=kappa, derivatives=derivatives)
        if parts == at_once or rolled.solved_steps < at_once:
            return rolled
        xs, reports, contacts = [rolled.xs], [rolled.reports], [contacts_of_parts(rolled.contacts)]
        for done in range(at_once, parts, at_once):
            rolled = engine.roll(xs[-1][-1], us, wrenches, kappa=kappa)
            if rolled.solved_steps < at_once:
                return rolled._replace(solved_steps=done + rolled.solved_steps)
            xs, reports = [*xs, rolled.xs[1:]], [*reports, rolled.reports]
            contacts.append(contacts_of_parts(rolled.contacts))
        return rolled._replace(
            solved_steps=parts, xs=np.concatenate(xs), reports=np.concatenate(reports), contacts=np.stack(contacts)
        )

    def conversions(self, x: Vector, divided: DividedStep) -> tuple[Floats, Floats]:
        """Derivatives of the conversions at both ends of a divided step from x, (ndx, ndx)."""
        xs, part = divided.rolled.xs, divided.engine.settings.time_step
        return self.intervals.slopes(x, part, xs[0]), self.intervals.slopes_back(xs[-1], part, divided.x)

    def slopes(self, x: Vector, divided: DividedStep) -> tuple[Floats, Floats]:
        """(A, B) of a divided step from x: the product of the derivatives of its parts and of both conversions."""
        ahead, back = self.conversions(x, divided)
        A, B = chained(ahead, divided.rolled)
        return back @ A, back @ B

    def rehearse(self, x: Vector, *, derivatives: bool = False) -> None:
        """As Engine.rehearse, with the calls of divided steps and the engines of their parts."""
        super().rehearse(x, derivatives=derivatives)
        self.intervals.rehearse(x)
        parts = 1
        while 2 * parts <= LARGEST_DIVISION:
            parts *= 2
            self.part(parts).rehearse(x, derivatives=derivatives)

    def forget_parts(self) -> None:
        """As Engine.forget_parts."""
        self._ended.parts = None

    def strategy_solves(self) -> Integers:
        """As Engine.strategy_solves, with the parts of divided steps."""
        engines = (*self._engines.values(), *self._lenient.values())
        return sum((engine.strategy_solves() for engine in engines), super().strategy_solves())

    def last(self) -> Data:
        """Data of the last step of this thread, or of its last part."""
        parts = getattr(self._ended, "parts", None)
        return super().last() if parts is None else parts.last()

    # -- motions -------------------------------------------------------------------------------------------------------

    def take_steps(
        self,
        model: Table,
        motion: MotionBuffers,
        kappa: float | None,
        following: FeedbackRun | None = None,
        first: int = 0,
        max_iterations: int | None = None,
    ) -> int:
        """As Engine.take_steps, with division."""
        self._ended.parts = None
        done = super().take_steps(model, motion, kappa, following, first, max_iterations)
        if following is None:
            return done if done == len(motion.us) else self._continue_after(model, motion, kappa, done)
        steps = len(motion.us) * following.substeps
        try:
            while done < steps and self._divide_feedback_step(motion, kappa, following, done):
                done += 1
                if done < steps:
                    done = super().take_steps(model, motion, kappa, following, done, max_iterations)
        except KeyboardInterrupt as stop:
            raise (stop if isinstance(stop, Interrupted) else Interrupted(done)) from None
        return done

    def _continue_after(self, model: Table, motion: MotionBuffers, kappa: float | None, knot: int) -> int:
        """Go on from the step `knot`, which was not solved."""
        steps, piece = len(motion.us), _PIECE
        try:
            while knot < steps and (
                self._begin_anew(model, motion, knot, kappa) or self._divide_row(motion, knot, kappa)
            ):
                knot, whole = knot + 1, True
                while knot < steps and whole:
                    rest = _rows(motion, knot, min(piece, steps - knot))
                    done = super().take_steps(model, rest, kappa)
                    self._ended.parts = None if done else self._ended.parts
                    knot, whole = knot + done, done == len(rest.us)
                    piece = min(2 * piece, _LARGEST_PIECE) if whole else _PIECE
        except KeyboardInterrupt as stop:
            done = stop.result if isinstance(stop, Interrupted) else 0
            raise Interrupted(knot + (done if isinstance(done, int) else 0)) from None  # not half a divided step
        return knot

    def _begin_anew(self, model: Table, motion: MotionBuffers, knot: int, kappa: float | None) -> bool:
        """Solve the step `knot`, which was not, without the impulses of the one before; False where that fails, too."""
        if knot == 0 or super().take_steps(model, _rows(motion, knot, 1), kappa) == 0:
            return False
        self._ended.parts = None
        return True

    def _divide_row(self, motion: MotionBuffers, knot: int, kappa: float | None) -> bool:
        """Divide the step `knot` of a motion, which was not solved; False where that does not solve it."""
        report = motion.reports[min(knot, len(motion.reports) - 1)]
        if int(report[StepReport.STATUS]) not in DIVISIBLE:
            return False
        derivatives = len(motion.A) > 0
        x, wrench = motion.xs[knot], motion.wrenches[knot : knot + 1]
        divided = self.divide(x, motion.us[knot], wrench, kappa, derivatives=derivatives)
        if divided is None:
            return False
        motion.xs[knot + 1] = divided.x
        self._ended.parts = divided.engine
        add_report(report, divided.report())
        if len(motion.contacts):
            motion.contacts[knot] = divided.contacts()
        if derivatives:
            motion.A[knot], motion.B[knot] = self.slopes(x, divided)
            return refuse(report[None], 1, motion.A[knot : knot + 1], motion.B[knot : knot + 1]) == 1
        return True

    def _divide_feedback_step(
        self, motion: MotionBuffers, kappa: float | None, following: FeedbackRun, done: int
    ) -> bool:
        """Divide the unsolved step after `done` solved ones of a motion that follows a law; False as in _divide_row."""
        law, alpha, report = following.law, following.alpha, motion.reports[0]
        if int(report[StepReport.STATUS]) not in DIVISIBLE:
            return False
        t, s = divmod(done, following.substeps)
        data = super().last()
        x, total = (data.step_x[0].copy() if s else motion.xs[t]), report[StepReport.EARLIER]
        divided = self.divide(x, motion.us[t], motion.wrenches[t : t + 1], kappa)
        if divided is None:
            return False
        motion.xs[t + 1] = divided.x
        add_report(report, divided.report())
        report[StepReport.EARLIER] = total + report[StepReport.ITERATIONS]
        for array in data.carry:  # the next step does not continue the attempt that failed
            array[...] = 0
        if s + 1 == following.substeps:
            parts = divided.engine.last()
            data.cone[...], data.bound[...] = parts.cone, parts.bound
            if len(following.cones):
                following.cones[t], following.bounds[t] = parts.cone, parts.bound
            if alpha < 1.0:
                motion.xs[t + 1] = self.states.integrate(
                    motion.xs[t + 1 : t + 2], (alpha - 1.0) * law.gaps[t + 1 : t + 2]
                )[0]
        return True

    def roll_batch(self, x0s: Floats, us: Floats) -> tuple[Floats, Floats, Integers]:
        """As Engine.roll_batch; rollouts with divided steps end on one core."""
        xs, reports, knots = super().roll_batch(x0s, us)
        model = self.step_table()
        for i in _divisible(reports[:, StepReport.STATUS]):
            report = reports[i : i + 1]
            motion = MotionBuffers(xs[i], us[i], self.no_wrenches, report, self._no_contacts, *self.no_predictions[:2])
            try:
                knots[i] = self._continue_after(model, motion, None, int(knots[i]))
            except Interrupted as stop:
                knots[i], report[0, StepReport.STATUS] = stop.result, Status.INTERRUPTED
                raise Interrupted((xs, reports, knots)) from None
        return xs, reports, knots

    def linearize(
        self,
        xs: Floats,
        us: Floats,
        substeps: int,
        kappa: float | None,
        guess: Floats | None = None,
        wrenches: Cube | None = None,
    ) -> tuple[Floats, ...]:
        """As Engine.linearize, with division."""
        A, B, x_next, reports = super().linearize(xs, us, substeps, kappa, guess, wrenches)
        external = self.external(wrenches)
        for t in _divisible(reports[:, StepReport.STATUS]):
            A[t], B[t], x_next[t], reports[t] = self.linearize_knot(
                xs[t], knot_inputs(us, external, t, substeps), kappa
            )
        return A, B, x_next, reports
