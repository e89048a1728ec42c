"""KnotStepper: one state stepped again and again, without the checks and arrays of a general call."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sim.integrators.rollout import REFUSED, MotionBuffers
from sim.mechanism.mechanism import Mechanism
from sim.model.record_columns import StepReport
from sim.simulator.engines.engine import REPORT, Engine
from sim.simulator.results import STATUSES, Contacts, StepResult, contacts_of, overlap, reservation, status_message
from sim.simulator.step_batch import StepBatch
from solvers.status import Status
from solvers.types import Floats

_SOLVED = Status.SOLVED


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
        self._time_step = engine.settings.time_step
        xs, us, reports = np.empty((steps + 1, engine.nx)), np.empty((steps, engine.nu)), np.zeros((steps, REPORT))
        rows = np.zeros((steps if contacts else 0, *engine.no_outputs[0].shape[1:]))
        self._motion = MotionBuffers(xs, us, engine.external(None), reports, rows, *engine.no_outputs[1:])
        self._none = np.zeros((0, engine.ndx, engine.ndx)), np.zeros((0, engine.ndx, engine.nu))
        self._start, self.end, self._knot = xs[0], xs[-1], 0
        # views, which take as long to make as to copy
        self._inputs, self._report = us[0] if steps == 1 else us, reports[-1]
        self._contacts = rows[-1] if contacts else rows

    def advance(self, x: Floats, u: Floats) -> bool:
        """Take the steps of a knot; `end` (nx,) is the state after them until the next call.

        Args:
            x: (nx,) finite state.
            u: (nu,) finite input [N, N m].

        Returns:
            Whether all steps were solved; `result` says why not.
        """
        motion = self._motion
        self._start[:], self._inputs[:] = x, u
        if self._steps > 1 or motion.reports[0, StepReport.PARTS] > 0.0:  # of the knot before
            motion.reports[:, StepReport.PARTS :] = 0.0
        motion.contacts.fill(0.0)  # the report leaves out collisions beyond their reach
        self._knot = self._engine.take_steps(self._engine.step_table(), motion, None)
        return self._knot == self._steps

    def last_step(self) -> StepResult:
        """The last step of a knot that was solved, with the contacts that are kept."""
        _, iterations, residual, violation, _, _, parts, lost, error = self._report.tolist()
        scene = self._mechanism, self._time_step, self._contacts.copy()
        solved = self.end.copy(), _SOLVED, int(iterations), residual, violation, scene
        if parts == 0.0:
            return StepResult(*solved)
        detail = reservation(self._report[None])
        if not detail and self._contacts.ndim == 2:
            detail = overlap(self._mechanism, np.array([int(parts)]), self._contacts[None])
        return StepResult(*solved, int(parts), 1.0 - lost, error, detail)

    @property
    def solved_steps(self) -> int:
        """Number of solved steps of the last knot."""
        return self._knot

    @property
    def states(self) -> Floats:
        """(steps + 1, nx) states of the last knot, of which those up to the last solved step are defined, until the
        next call.
        """
        return self._motion.xs

    @property
    def began(self) -> bool:
        """Whether the last call of `advance` was given a state, and inputs, that steps can begin with."""
        return bool(self._motion.reports[0, StepReport.STATUS] != REFUSED)

    def unsolved_step(self, explain: Callable[[Floats, Floats], str]) -> StepResult:
        """The step of a knot that was not solved, with the state before it; explain: sentence of a report and state."""
        x, report = self._motion.xs[self._knot].copy(), self._motion.reports[self._knot]
        np.nan_to_num(report, copy=False, nan=np.inf, posinf=np.inf)
        status, iterations, residual, violation = report[:4].tolist()
        scene = self._mechanism, self._time_step, self._contacts.copy()
        detail = explain(report, x)
        return StepResult(x, STATUSES[int(status)], int(iterations), residual, violation, scene, detail=detail)

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
            detail = reservation(self._motion.reports)
            return StepBatch(self.end[None].copy(), status, iterations, *self._none, detail, self.contacts)
        detail = status_message(self._mechanism, "Simulator.step_batch: row 0", last, self._engine.settings.tolerance)
        return StepBatch(states, status, iterations, *self._none, detail, self.contacts)

    @property
    def contacts(self) -> Contacts | None:
        """Contacts (1, ncontact) of the last step, where they are kept."""
        rows = self.last_contacts
        return contacts_of(self._mechanism, self._time_step, rows.copy()) if len(rows) else None

    @property
    def last_contacts(self) -> Floats:
        """The same as rows (1, ncontact, 11) of `ContactRow`, until the next call; (0, ncontact, 11) without."""
        return self._motion.contacts[-1:]
