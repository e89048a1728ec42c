"""Calls: where Python enters the compiled steps, rollouts and derivatives, with all buffers that cross the border.

settings   (5,) time step [s], kappa [N s m], tolerance, largest number of iterations, deadline [s]
report     (6,) Status, iterations, residual, violation, contact with the largest violation (-1: none), and the
           accuracy of derivatives, 0 where there are none
contacts   (ncontact, 11) impulse in world axes (3), point where it acts (3), gap, slip speed, normal (3)

Calls that may take long are made in pieces (pace.py); those that Ctrl-C ends between two of them raise Interrupted
with what they would have returned, as far as they came.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from sim.integrators import linear_rollout, rollout
from sim.integrators.policy import Path, Policy, closed_loop
from sim.model.data import Work
from sim.model.layout import work_view
from sim.model.model import Integers, Model, Vector
from sim.model.pace import pieces
from sim.simulator.link import link_gradient, link_step
from sim.simulator.results import Interrupted
from sim.simulator.settings import Settings
from sim.simulator.state_calls import StateCalls
from solvers.status import Status

Floats = NDArray[np.float64]

REPORT, CONTACT, CONE, BOUND = 6, 11, 12, 2  # numbers of a step, or of one of its contacts or limits
_SMALL = 4096  # numbers; `dot` of more may wake up threads
_WORTH_THREADS = 1000  # knots times tangent dimension: below, one core is done before the others wake up


def finite_rows(array: Floats) -> NDArray[np.bool_]:
    """Which rows (along the first axis) are finite throughout."""
    return np.asarray(np.isfinite(array).reshape(len(array), -1).all(axis=1))


def refuse(reports: Floats, count: int, *arrays: Floats) -> int:
    """The first of `count` steps with a row that is not finite, whose status says so then; `count` where there is none.

    A sum is looked at first, which takes a tenth of the time; small ones by `dot`, which has less to set up.
    """
    if all(isfinite(flat.dot(flat) if flat.size < _SMALL else flat.sum()) for flat in [a.ravel() for a in arrays]):
        return count
    good = np.logical_and.reduce([finite_rows(a) for a in arrays])
    if good.all():
        return count
    first = int(good.argmin())
    reports[first, 0] = Status.NOT_FINITE
    return first


def interrupted(reports: Floats, knot: int) -> Floats:
    """The reports (T, 5), with that of the step `knot`, if there is one, saying that it was not tried."""
    reports[knot : knot + 1, :REPORT] = Status.INTERRUPTED, 0.0, 0.0, 0.0, -1.0, 0.0
    return reports


def follow(go_on: Callable[[int], int], settings: Vector, path: Path, substeps: int) -> int:
    """The number of solved knots of a rollout under a policy, which `go_on` continues after so many steps."""
    done, steps = 0, len(path.us) * substeps
    try:
        for _ in pieces(settings, steps):
            done = go_on(done)
            if done == steps or path.report[0] != Status.SOLVED:
                break
    except KeyboardInterrupt:
        interrupted(path.report[None], 0 if done < steps else 1)
        raise Interrupted((done // substeps, path)) from None
    return done // substeps


class Calls(StateCalls):
    """The kernels of one packed mechanism, as functions of checked arrays."""

    def __init__(self, model: Model, settings: Settings) -> None:
        super().__init__(model, settings)
        # what a policy need not know: derivatives and cone variables of its steps
        self.unknown = tuple(
            np.empty((0, *shape))
            for shape in (
                (self.ndx, self.ndx),
                (self.ndx, self.nu),
                (self.sizes.ncontact, CONE),
                (self.sizes.nlimit, BOUND),
            )
        )

    def __getstate__(self) -> tuple[Model, Settings]:
        """Tables and kernels are addresses in this process: another one makes its own."""
        return self.model._replace(optional=np.zeros_like(self.model.optional)), self.settings

    def __setstate__(self, state: tuple[Model, Settings]) -> None:
        self.__init__(*state)  # type: ignore[misc]

    def tables(self, *needs: Callable[[Model], None]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Tables of the Model, bound for derivatives and what else a call needs, and of this thread's first Work."""
        return self._table(link_step, link_gradient, *needs), self._scratch.table()

    def roll(self, x: Vector, us: Floats) -> tuple[int, Floats, Floats, Floats]:
        """(number of solved steps, states, report of every step, contacts of every step)."""
        steps = len(us)
        xs = np.zeros((steps + 1, self.nx))
        reports = np.zeros((steps, REPORT))
        contacts = np.zeros((steps, self.sizes.ncontact, CONTACT))
        xs[0] = x
        model, work, settings = self._table(link_step), self._scratch.table(), self.settings.array()
        knot = 0
        try:
            for _ in pieces(settings, steps):
                knot = int(rollout.roll(model, work, settings, us, xs, reports, contacts, knot))
                if knot == steps or reports[knot, 0] != Status.SOLVED:
                    break
        except KeyboardInterrupt:
            raise Interrupted((knot, xs, interrupted(reports, knot), contacts)) from None
        knot = refuse(reports, knot, contacts[:knot])
        if knot < steps:
            np.nan_to_num(reports[knot], copy=False, nan=np.inf, posinf=np.inf)
        return knot, xs, reports, contacts

    def _path(self, knots: int, *, keep: bool, cones: bool = True) -> Path:
        """What a rollout of so many knots fills in; without `cones`, there is nothing of contacts and limits in it."""
        kept = knots if keep else 0
        ncontact, nlimit = (self.sizes.ncontact, self.sizes.nlimit) if cones else (0, 0)
        return Path(
            np.zeros((knots + 1, self.nx)),
            np.zeros((knots, self.nu)),
            np.zeros((kept, ncontact, CONE)),
            np.zeros((kept, nlimit, BOUND)),
            np.zeros(REPORT + 1),
        )

    def closed_loop(
        self,
        x: Vector,
        policy: Policy,
        alpha: float,
        limits: tuple[Floats, Floats],
        substeps: int,
        kappa: float | None,
        *,
        keep: bool = False,
    ) -> tuple[int, Path]:
        """(number of solved knots, rollout); with `keep` also the cone variables of its steps."""
        path = self._path(len(policy.us), keep=keep)
        path.xs[0] = x
        model, work, settings = self._table(link_step), self._scratch.table(), self.settings.array(kappa)

        def go_on(first: int) -> int:
            return int(closed_loop(model, work, settings, policy, alpha, limits, substeps, path, first))

        knot = follow(go_on, settings, path, substeps)
        if knot < len(policy.us):
            np.nan_to_num(path.report, copy=False, nan=np.inf, posinf=np.inf)
        return knot, path

    def linearize(
        self, xs: Floats, us: Floats, substeps: int, kappa: float | None, guess: Floats | None = None
    ) -> tuple[Floats, ...]:
        """(A, B, next states, report of every knot) of all knots; in parallel where that pays.

        guess: (T, nx) next states to start from, the states themselves when left out.
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
        line = rollout.Linearized(xs, us, A, B, x_next, reports)
        model, settings = self._table(link_step, link_gradient), self.settings.array(kappa)
        if n * substeps * self.ndx < _WORTH_THREADS:
            work, step = self._scratch.table(), 0
            for _ in pieces(settings, n * substeps):
                step = int(rollout.linearize(model, work, settings, (0, step, n), substeps, line))
                if step == n * substeps:
                    break
        else:
            works = self._scratch.chunks(n)
            ends = np.arange(len(works) + 1) * n // len(works) * substeps
            done = ends[:-1].copy()
            for _ in pieces(settings, n * substeps):
                rollout.linearize_knots(model, works, settings, substeps, line, done)
                if np.array_equal(done, ends[1:]):
                    break
        if reports[:, 0].any() or refuse(reports, n, A, B) < n:
            reports[~(finite_rows(A) & finite_rows(B)) & (reports[:, 0] == Status.SOLVED), 0] = Status.NOT_FINITE
            unsolved = reports[:, 0] != Status.SOLVED
            for array in (A, B, x_next):
                array[unsolved] = 0.0
        return A, B, x_next, reports

    def roll_linear(self, x: Vector, us: Floats, kappa: float | None) -> tuple[int, Floats, Floats, Floats, Floats]:
        """(number of solved steps, states, A, B, report of every step) of a rollout."""
        n = len(us)
        xs, reports = np.zeros((n + 1, self.nx)), np.zeros((n, REPORT))
        A, B = np.empty((n, self.ndx, self.ndx)), np.empty((n, self.ndx, self.nu))
        xs[0] = x
        line = rollout.Linearized(xs, us, A, B, xs, reports)
        model, work, settings = *self.tables(), self.settings.array(kappa)
        knot = 0
        for _ in pieces(settings, n):
            knot = int(linear_rollout.roll_linear(model, work, settings, line, knot))
            if knot == n or reports[knot, 0] != Status.SOLVED:
                break
        knot = refuse(reports, knot, A[:knot], B[:knot])
        if knot < n:
            np.nan_to_num(reports[knot], copy=False, nan=np.inf, posinf=np.inf)
        return knot, xs, A, B, reports

    def linearize_one(self, x: Vector, u: Vector, kappa: float | None) -> tuple[Floats, Floats, Vector, Vector]:
        """(A, B, next state, report) of one step."""
        A, B, x_next, reports = self.linearize(x[None], u[None], 1, kappa)
        return A[0], B[0], x_next[0], reports[0]

    def roll_batch(self, x0s: Floats, us: Floats) -> tuple[Floats, Integers, Integers]:
        """(states, status and number of solved steps of every rollout), in parallel."""
        n, steps = us.shape[:2]
        xs = np.zeros((n, steps + 1, self.nx))
        xs[:, 0] = x0s
        status, knots = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        model, works, settings = self._table(link_step), self._scratch.chunks(n), self.settings.array()
        try:
            for _ in pieces(settings, n * steps):
                rollout.roll_batch(model, works, settings, us, xs, status, knots)
                if np.all((knots == steps) | (status != Status.SOLVED)):
                    break
        except KeyboardInterrupt:
            status[(knots < steps) & (status == Status.SOLVED)] = Status.INTERRUPTED
            raise Interrupted((xs, status, knots)) from None
        return xs, status, knots

    def far(self) -> NDArray[np.bool_]:
        """Which contacts were far in the last step of this thread, (ncontact,)."""
        out = np.ones(self.sizes.ncontact, dtype=bool)
        work = work_view(self._scratch.table())
        out[work.active[: work.active_count[0]]] = False
        return out

    def last(self) -> Work:
        """What the last step of this thread has left."""
        return work_view(self._scratch.table())

    def open_loops(self) -> list[float]:
        """How far loops, then gears, were open in the last iterate of this thread [m, or sine of an angle]."""
        ends = self.model.coupling_row[len(self.model.coupling_body) - self.sizes.nloop :]
        ends = np.concatenate([ends, ends[-1] + 1 + np.arange(self.sizes.ngear)])
        gap = np.abs(self.last().couple_gap)
        return [float(gap[a:b].max()) for a, b in zip(ends[:-1], ends[1:], strict=True)]
