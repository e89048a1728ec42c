"""Calls of a simulator of higher order with contacts or limits: order 2 near them, the higher one otherwise.

Collisions of bodies are contacts here. With a joint that is too stiff for an explicit method all steps are of order 2.

Both have the same states, x = [q; v] with v = M(q)^-1 p of the node. For order 2, p is the momentum that the discrete
Legendre transform gives the node; that is one to one with the mean velocity of the interval before it, so going over
from one order to the other changes neither q nor p: momentum and energy are the same on both sides. Which order a step
has depends on its state and input alone (phases.py).

Between steps of order 2 nothing is converted: their states, with mean velocities, carry over.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.dynamics.joints.damper import node_dampings
from sim.integrators import legendre, phases, rollout
from sim.integrators.hamilton_gradient import Slopes
from sim.model.columns import StepReport
from sim.model.model import Model
from sim.model.pace import pieces
from sim.simulator.dividing_engine import DividingEngine
from sim.simulator.engine import CONTACT, REPORT, Division, Engine, Floats, Rolled, interrupted
from sim.simulator.knot_engine import KnotEngine
from sim.simulator.link import link_flight
from sim.simulator.results import Interrupted
from sim.simulator.settings import Settings
from solvers.compiler import Table
from solvers.status import Status
from solvers.types import Cube, Vector

_PIECE, _LARGEST = 16, 1024  # steps of order 2 at once; those after all is inactive again are discarded


class March(NamedTuple):
    """Steps from one state on; rows after the last solved step are undefined."""

    knot: int  # number of solved steps
    xs: Floats  # (T + 1, nx)
    reports: Floats  # (T, 6)
    contacts: Floats  # (T, ncontact, 11)
    means: Floats  # (T, nx) the states of order 2 where the steps of order 2 begin
    near: NDArray[np.bool_]  # (T,) which those are


class PhasedEngine(KnotEngine):
    """The kernels of one packed mechanism with contacts or limits, or with joints that are too stiff.

    second_order: why all steps are of order 2; "" if they are so near contacts and limits alone.
    """

    def __init__(self, model: Model, settings: Settings, second_order: str = "") -> None:
        super().__init__(model, settings)
        self.second_order = second_order
        self._second = (DividingEngine if settings.divide else Engine)(model, settings._replace(order=2))
        self._last = threading.local()

    def march(self, x: Vector, us: Floats, wrenches: Cube | None = None, kappa: float | None = None) -> March:
        """Steps from x under us (T, nu) and external wrenches (T, nbody, 6)."""
        steps, ncontact = len(us), self.sizes.ncontact
        external = self.external(wrenches)
        out = March(
            0,
            np.zeros((steps + 1, self.nx)),
            np.zeros((steps, REPORT)),
            np.zeros((steps, ncontact, CONTACT)),
            np.zeros((steps, self.nx)),
            np.zeros(steps, dtype=bool),
        )
        out.xs[0] = x
        t, mean = 0, None
        try:
            while t < steps:
                taken, why = self._fly(
                    phases.Flight(us[t:], external[t:], out.xs[t:], out.reports[t:], out.contacts[t:]), kappa
                )
                t += taken
                if why != phases.NEAR:
                    break
                if taken or mean is None:
                    status, mean = self._second.start(out.xs[t, : self.sizes.nq], out.xs[t, self.sizes.nq :])
                    if status != Status.SOLVED:
                        out.reports[t] = status, 0.0, np.inf, 0.0, -1.0
                        break
                taken, mean = self._stay(out, t, (us, external), mean, kappa)
                t += taken
                if mean is None:
                    break
        except KeyboardInterrupt as stop:
            t += stop.result if isinstance(stop, Interrupted) else int(out.near[t:].sum())
            raise Interrupted((t, out.xs, interrupted(out.reports, t), out.contacts)) from None
        self._last.near = bool(t and out.near[t - 1])
        if t < steps:
            np.nan_to_num(out.reports[t], copy=False, nan=np.inf, posinf=np.inf)
        return out._replace(knot=t)

    def _flight_table(self) -> Table:
        """Table of the Model for steps of higher order beside contacts."""
        return self.linked(link_flight)

    def _fly(self, flight: phases.Flight, kappa: float | None) -> tuple[int, int]:
        """Steps of higher order while all is inactive: their number, and the reason for the end; see `roll_far`."""
        if self.second_order:
            return 0, phases.NEAR
        model, data, settings = self._flight_table(), self._scratch.table(), self.settings.array(kappa)
        taken, why = 0, int(Status.SOLVED)
        try:
            for _ in pieces(settings, len(flight.us)):
                taken, why = phases.roll_far(model, data, settings, flight, taken)
                if taken == len(flight.us) or why != Status.SOLVED:
                    break
        except KeyboardInterrupt:
            raise Interrupted(taken) from None
        return int(taken), int(why)

    def _stay(
        self, out: March, first: int, given: tuple[Floats, Floats], mean: Vector, kappa: float | None
    ) -> tuple[int, Vector | None]:
        """Steps of order 2 from the state `mean` at step `first` until all is inactive: their number, the last state.

        None in its place where a step is not solved. given: inputs, and external wrenches.
        """
        model, settings = self._second.step_table(), self.settings.array(kappa)
        us, external = given
        t, piece, nq = first, _PIECE, self.sizes.nq
        while t < len(us):
            count = min(piece, len(us) - t)
            means = np.zeros((count + 1, self.nx))
            means[0] = mean
            rows = slice(t, t + count)
            line = rollout.MotionBuffers(
                means, us[rows], external[rows], out.reports[rows], out.contacts[rows], *self.unknown[:2]
            )
            try:
                solved = self._second.take_steps(model, line, kappa, Division.none(count))
            except Interrupted:
                raise KeyboardInterrupt from None
            nodes = means[1 : solved + 1].copy()
            nodes[:, nq:] = self._second.node_velocities(nodes)
            far = self._first_far(nodes, settings)
            taken = min(far + 1, solved)
            out.xs[t + 1 : t + 1 + taken] = nodes[:taken]
            out.means[t : t + taken], out.near[t : t + taken] = means[:taken], True
            t, mean, piece = t + taken, means[taken], min(2 * piece, _LARGEST)
            if far < solved:
                break
            if solved < count:
                return t - first, None
        return t - first, mean

    def _first_far(self, nodes: Floats, settings: Vector) -> int:
        """The first of some nodes (n, nx) from which the steps are of higher order; n if there is none."""
        if self.second_order:
            return len(nodes)
        return int(phases.first_far(self._flight_table(), self._scratch.table(), settings, nodes))

    def roll(
        self,
        x: Vector,
        us: Floats,
        wrenches: Cube | None = None,
        *,
        kappa: float | None = None,
        derivatives: bool = False,
    ) -> Rolled:
        """As Engine.roll; derivatives take a second pass."""
        try:
            m = self.march(x, us, wrenches, kappa)
        except Interrupted as stop:
            knot, xs, reports, contacts = stop.result
            none, whole = self.unknown[:2], Division.none(len(us))
            raise Interrupted(Rolled(knot, xs, reports, contacts, none[0], none[1], whole)) from None
        A, B = self.unknown[:2]
        if derivatives:
            A, B, *_ = self.linearize(m.xs[:-1], us, 1, kappa, None, wrenches)
        return Rolled(m.knot, m.xs, m.reports, m.contacts, A, B, Division.none(len(us)))

    def inactive(self) -> NDArray[np.bool_]:
        """As Engine.inactive; all of them where the step was of higher order."""
        return self._second.inactive() if self._last.near else np.ones(self.sizes.ncontact, dtype=bool)

    def linearize_knot(
        self, x: Vector, given: tuple[Floats, Cube], kappa: float | None
    ) -> tuple[Floats, Floats, Vector, Vector]:
        """As Engine.linearize_knot: products of the derivatives of the steps, each by its own order."""
        us, external = given
        m = self.march(x, us, external, kappa)
        A, B, report = np.eye(self.ndx), np.zeros((self.ndx, self.nu)), m.reports[min(m.knot, len(us) - 1)]
        for s in range(len(us) if m.knot == len(us) else 0):
            dx, du, found = self._step_slopes(m, s, (us[s], external[s : s + 1]), kappa)
            A, B = dx @ A, dx @ B + du
            if found[StepReport.STATUS] != Status.SOLVED:
                report = found
        if report[StepReport.STATUS] != Status.SOLVED:
            return np.zeros_like(A), np.zeros_like(B), np.zeros(self.nx), report
        return A, B, m.xs[-1], report

    def _step_slopes(
        self, m: March, s: int, given: tuple[Vector, Cube], kappa: float | None
    ) -> tuple[Floats, Floats, Vector]:
        """(d(next state)/d(state), by the input, report) of step s; given: input, external wrenches (1, nbody, 6)."""
        u, external = given
        if not m.near[s]:
            A, B, _, report = Engine.linearize(self, m.xs[s : s + 1], u[None], 1, kappa, None, external)
            return A[0], B[0], report[0]
        A, B, x_next, report = self._second.linearize(m.means[s : s + 1], u[None], 1, kappa, None, external)
        after = self._node_slopes(x_next[0])
        return after @ A[0] @ np.linalg.inv(self._node_slopes(m.means[s])), after @ B[0], report[0]

    def _node_slopes(self, mean: Vector) -> Floats:
        """d(q, v of the node)/d(q, mean velocity) of a state of order 2:  (p_v + C) dv = dp - p_q dq,  (ndx, ndx)."""
        nv = self.sizes.nv
        slopes = Slopes(*(np.zeros((nv, k)) for k in (nv, nv, nv, nv, self.nu, 42)))
        by_q, by_mean = np.zeros((nv, nv)), np.zeros((nv, nv))
        out, model = np.eye(self.ndx), self._second.gradient_table()
        h, damping = self._second.interval(mean), np.zeros(nv)
        legendre.legendre_slopes(model, self._scratch.table(), h, mean, slopes, by_q, by_mean)
        node_dampings(model, h, damping)
        out[nv:] = np.linalg.solve(slopes.p_v + np.diag(damping), np.hstack([by_q - slopes.p_q, by_mean]))
        return out
