"""Calls: the one place where Python enters compiled code, with all buffers that cross the border.

    settings   (4,) time step [s], kappa [N s m], tolerance, largest number of iterations
    report     (5,) Status, iterations, residual, violation, contact with the largest violation (-1: none)
    contacts   (ncontact, 11) impulse in world axes (3), point where it acts (3), gap, slip speed, normal (3)

Scratch belongs to a thread, so that one Simulator may be used from several.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim import coordinates, coordinates_jacobian, energy, linear_rollout, rollout, start, state, velocity
from sim.bind import bind_gradient, bind_poses, bind_step
from sim.layout import allocate_work, sizes_of, table, work_view
from sim.model import Integers, Model, Vector, Work
from sim.policy import Path, Policy, closed_loop
from solvers.status import Status

Floats = NDArray[np.float64]

REPORT, CONTACT, CONE, BOUND = 5, 11, 12, 2  # numbers of a step, or of one of its contacts or limits
_WORTH_THREADS = 1000  # knots times tangent dimension: below, one core is done before the others wake up
_CHUNKS = 4  # per core: evens out knots that take longer


class Settings(NamedTuple):
    """Settings of a time step."""

    time_step: float  # [s]
    kappa: float  # central-path parameter [N s m]
    tolerance: float
    max_iterations: int
    order: int = 2  # of a step

    def array(self, kappa: float | None = None) -> Vector:
        """As kernels read it, at another kappa when given; without the order, which chooses the kernels."""
        return np.array((self if kappa is None else self._replace(kappa=kappa))[:4], dtype=np.float64)


class Calls:
    """The kernels of one packed mechanism, as functions of checked arrays."""

    def __init__(self, model: Model, settings: Settings) -> None:
        self.model, self.settings = model, settings
        self.sizes = sizes_of(model)
        self.nx, self.ndx, self.nu = self.sizes.nq + self.sizes.nv, 2 * self.sizes.nv, self.sizes.nu
        bind_poses(model)
        self._model = table(model)
        self._bound: set[Callable[[Model], None]] = set()
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
        self._scratch = threading.local()

    def __getstate__(self) -> tuple[Model, Settings]:
        """Tables and kernels are addresses in this process: another one makes its own."""
        return self.model._replace(late=np.zeros_like(self.model.late)), self.settings

    def __setstate__(self, state: tuple[Model, Settings]) -> None:
        self.__init__(*state)  # type: ignore[misc]

    def _table(self, *needs: Callable[[Model], None]) -> NDArray[np.int64]:
        """Table of the Model, with the kernels bound that a call needs."""
        for bind in needs:
            if bind not in self._bound:
                bind(self.model)
                self._bound.add(bind)
        return self._model

    def _works(self, count: int) -> NDArray[np.int64]:
        """Tables of `count` Works of this thread, (count, ...)."""
        kept = self._scratch.__dict__.setdefault("works", [])
        while len(kept) < count:
            kept.append(allocate_work(self.sizes))
            kept[-1].contact_frame[:] = self.model.contact_frame
        if len(self._scratch.__dict__.get("tables", ())) < count:
            self._scratch.tables = np.array([table(work) for work in kept])
        return self._scratch.tables[:count]

    def _work(self) -> NDArray[np.int64]:
        """Table of the first Work of this thread."""
        return self._works(1)[0]

    def tables(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Tables of the Model, bound for derivatives, and of the first Work of this thread."""
        return self._table(bind_step, bind_gradient), self._work()

    def _chunks(self, count: int) -> NDArray[np.int64]:
        """Tables for a parallel call over `count` items, one per chunk."""
        return self._works(max(1, min(count, _CHUNKS * (os.cpu_count() or 1))))

    def roll(self, x: Vector, us: Floats) -> tuple[int, Floats, Floats, Floats]:
        """(number of solved steps, states, report of every step, contacts of every step)."""
        steps = len(us)
        xs = np.zeros((steps + 1, self.nx))
        reports = np.zeros((steps, REPORT))
        contacts = np.zeros((steps, self.sizes.ncontact, CONTACT))
        settings = self.settings.array()
        knot = rollout.roll(self._table(bind_step), self._work(), settings, x, us, xs, reports, contacts)
        if knot < steps:
            np.nan_to_num(reports[knot], copy=False, nan=np.inf, posinf=np.inf)
        return int(knot), xs, reports, contacts

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
        knots = len(policy.us)
        kept = knots if keep else 0
        path = Path(
            np.empty((knots + 1, self.nx)),
            np.empty((knots, self.nu)),
            np.empty((kept, self.sizes.ncontact, CONE)),
            np.empty((kept, self.sizes.nlimit, BOUND)),
            np.zeros(REPORT),
        )
        model, settings = self._table(bind_step), self.settings.array(kappa)
        knot = closed_loop(model, self._work(), settings, x, policy, alpha, limits, substeps, path)
        if knot < knots:
            np.nan_to_num(path.report, copy=False, nan=np.inf, posinf=np.inf)
        return int(knot), path

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
        model, settings = self._table(bind_step, bind_gradient), self.settings.array(kappa)
        if n * substeps * self.ndx < _WORTH_THREADS:
            rollout.linearize(model, self._work(), settings, (0, n), substeps, line)
        else:
            rollout.linearize_knots(model, self._chunks(n), settings, substeps, line)
        if reports[:, 0].any():
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
        model, settings = self._table(bind_step, bind_gradient), self.settings.array(kappa)
        knot = linear_rollout.roll_linear(model, self._work(), settings, line)
        if knot < n:
            np.nan_to_num(reports[knot], copy=False, nan=np.inf, posinf=np.inf)
        return int(knot), xs, A, B, reports

    def linearize_one(self, x: Vector, u: Vector, kappa: float | None) -> tuple[Floats, Floats, Vector, Vector]:
        """(A, B, next state, report) of one step."""
        A, B, x_next, reports = self.linearize(x[None], u[None], 1, kappa)
        return A[0], B[0], x_next[0], reports[0]

    def roll_batch(self, x0s: Floats, us: Floats) -> tuple[Floats, Integers, Integers]:
        """(states, status and number of solved steps of every rollout), in parallel."""
        n, steps = us.shape[:2]
        xs = np.zeros((n, steps + 1, self.nx))
        status, knots = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        settings, works = self.settings.array(), self._chunks(n)
        rollout.roll_batch(self._table(bind_step), works, settings, x0s, us, xs, status, knots)
        return xs, status, knots

    def far(self) -> NDArray[np.bool_]:
        """Which contacts were far in the last step of this thread, (ncontact,)."""
        out = np.ones(self.sizes.ncontact, dtype=bool)
        work = work_view(self._work())
        for first, last in work.near[: work.counts[2]]:
            out[first:last] = False
        return out

    def last(self) -> Work:
        """What the last step of this thread has left."""
        return work_view(self._work())

    def open_loops(self) -> list[float]:
        """How far loops, then gears, were open in the last iterate of this thread [m, or sine of an angle]."""
        ends = self.model.coupling_row[len(self.model.coupling_body) - self.sizes.nloop :]
        ends = np.concatenate([ends, ends[-1] + 1 + np.arange(self.sizes.ngear)])
        gap = np.abs(self.last().couple_gap)
        return [float(gap[a:b].max()) for a, b in zip(ends[:-1], ends[1:], strict=True)]

    def start(self, q: Vector, v: Vector) -> tuple[int, Vector]:
        """(status, state) with the velocity v at the node q."""
        x = np.concatenate([q, v])
        status = start.start_at(self._model, self._work(), self.settings.time_step, v, x)
        return int(status), x

    def node_velocities(self, xs: Floats) -> Floats:
        """Joint velocities at the node of every row, (n, nv)."""
        out = np.zeros((len(xs), self.sizes.nv))
        velocity.node_velocities(self._model, self._work(), self.settings.time_step, xs, out)
        return out

    def bodies(self, xs: Floats) -> Floats:
        """Poses and velocities of the bodies at [q; joint velocities] of every row, (n, nbody, 13)."""
        nbody = self.sizes.nbody
        out = np.zeros((len(xs) * nbody, 13))
        velocity.body_states(self._model, self._work(), xs, out)
        return out.reshape(len(xs), nbody, 13)

    def integrate(self, xs: Floats, dxs: Floats) -> Floats:
        """x (+) dx of every row."""
        out = np.zeros_like(xs)
        state.integrate_states(self._model, xs, dxs, out)
        return out

    def difference(self, x0s: Floats, x1s: Floats) -> Floats:
        """x1 (-) x0 of every row."""
        out = np.zeros((len(x0s), self.ndx))
        state.state_differences(self._model, x0s, x1s, out)
        return out

    def normalise(self, xs: Floats, tolerance: float) -> int:
        """Normalise quaternions in place; see `normalise_quaternions`."""
        return int(state.normalise_quaternions(self._model, xs, tolerance))

    def maximal(self, xs: Floats, nbody: int) -> Floats:
        """z of every row, (n, nbody, 13)."""
        out = np.zeros((len(xs) * nbody, 13))
        coordinates.maximal_states(self._model, self._work(), self.settings.time_step, xs, out)
        return out.reshape(len(xs), nbody, 13)

    def minimal(self, zs: Floats) -> Floats:
        """x of every z, (n, nbody, 13)."""
        out = np.zeros((len(zs), self.nx))
        flat = zs.reshape(-1, 13)
        coordinates.minimal_states(self._model, self._work(), self.settings.time_step, flat, out)
        return out

    def maximal_jacobian(self, x: Vector, nbody: int) -> Floats:
        """dz/dx."""
        out = np.zeros((12 * nbody, self.ndx))
        h = self.settings.time_step
        coordinates_jacobian.maximal_jacobian_at(self._model, self._work(), h, x, out)
        return out

    def minimal_jacobian(self, z: Floats) -> Floats:
        """dx/dz."""
        out = np.zeros((self.ndx, 12 * len(z)))
        h = self.settings.time_step
        coordinates_jacobian.minimal_jacobian_at(self._model, self._work(), h, z, out)
        return out

    def energies(self, xs: Floats) -> Floats:
        """(kinetic, potential) energy of every row."""
        out = np.zeros((len(xs), 2))
        energy.energies(self._model, self._work(), self.settings.time_step, xs, out)
        return out

    def momenta(self, xs: Floats) -> Floats:
        """(linear, angular) momentum of every row."""
        out = np.zeros((len(xs), 6))
        energy.momenta(self._model, self._work(), self.settings.time_step, xs, out)
        return out
