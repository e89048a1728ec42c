"""Engine whose steps are divided as their accuracy requires; states have the velocity of the node, as at order 8.

A step depends on its state and input alone: its sub-steps begin anew with the longest.

With contacts or limits an accuracy below 1e-6 is refused: sub-steps with an impact would be so short that velocities
are rounded. Joints are not released from their limits as exactly as contacts are.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.derivatives.momentum_gradient import momentum_jacobian
from sim.dynamics.joints.damper import node_dampings
from sim.integrators.adaptive import attempt, go_on
from sim.integrators.adaptive_rollout import SubstepMotion, roll_substeps
from sim.integrators.extrapolated_step import PARTS, combined_at
from sim.integrators.hamilton_gradient import Slopes, empty_slopes
from sim.integrators.node_slopes import node_slopes
from sim.integrators.node_step import begin_work, mean_of_node, node_at
from sim.integrators.rollout import Linearized, MotionBuffers, linearize, roll
from sim.integrators.substeps import Clock, Embedded, SubstepState, end_report
from sim.integrators.tableau import embedded
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.servos import limited_servos
from sim.model.interruptible_loops import pieces
from sim.model.model import Model
from sim.model.record_columns import ContactRow, StepReport, StepSetting
from sim.simulator.central_differences import central_differences
from sim.simulator.engines.engine import REPORT, Engine, Floats, Rolled, contact_rows, interrupted, refuse
from sim.simulator.engines.linear_systems import solved
from sim.simulator.engines.node_states import ClosingStates
from sim.simulator.engines.python_loop_engine import PythonLoopEngine
from sim.simulator.link_kernels import link_flight, link_momentum
from sim.simulator.results import Interrupted
from sim.simulator.settings import Settings, least_kappa
from solvers.compiler import Table, link
from solvers.status import Status
from solvers.types import Cube, Integers, Vector

SHORTEST = 1e-7  # [s]
_IMPACT = 1e-6  # [kg s] mass times the shortest step with an impact: kappa is smallest there, its effect below rounding
# (h w)^2 of the shortest step h, where w^2 = m g^2 h/kappa is the stiffness over m of a contact that carries m g
_SETTLED = 10.0
# g h/accuracy of the shortest step h at least, and its largest length [s]
_BRIEF, _LONGEST = 0.055, 3e-5
_LEAST_PRESSING = 1e-6  # [m/s, rad/s] accuracy: shorter impacts would round velocities
_CONVERGED = 1e-6  # tolerance of steps with loops or gears, in accuracies
_ROWS = 256  # sub-steps between two pauses
_MOST = 1_000_000  # sub-steps of a step: an input is not held for ever

_DIVISIONS = {4: (1, 2), 6: tuple(range(1, PARTS + 1))}  # of extrapolated steps, by their order
_EVEN, _HALVINGS = 5e-3, 6  # [s] longest step of the derivatives for planners; lengths that are tried
_NUDGE = 1e-3  # of states and inputs, in differences

Held = tuple[Vector, Cube]  # input (nu,) and external wrenches (1 or 0, nbody, 6) of a step
# between a node and the mean state of a step of a length: (Status, state)
Conversion = Callable[[Vector, Held, float], tuple[int, Vector]]


class Substeps(NamedTuple):
    """A step and its sub-steps."""

    status: int
    x: Vector  # (nx,) its end, or the last node before the sub-step that failed
    report: Vector  # (9,)
    contacts: Floats  # (ncontact, 11)
    starts: Floats  # (n, nx) nodes where the sub-steps begin
    lengths: Vector  # (n,) [s]
    orders: Integers  # (n,)


def link_substeps(model: Model) -> None:
    """Link the kernels of sub-steps of order 8, and one attempt at a sub-step of either order."""
    link(model.optional, attempt)
    link_flight(model)


class AdaptiveEngine(PythonLoopEngine):
    """The kernels of one packed mechanism, with steps of the accuracy of its settings."""

    def __init__(self, model: Model, settings: Settings) -> None:
        if len(model.loop_ntrans) + len(model.gear_dof):  # the residuals of many sub-steps add up
            settings = settings._replace(tolerance=min(settings.tolerance, _CONVERGED * settings.accuracy))
        super().__init__(model, settings)
        self._second = Engine(model, settings._replace(order=2))
        self.states = ClosingStates(self, self._second.states)
        self._is_tree = len(model.loop_ntrans) + len(model.gear_dof) == 0
        g = float(np.linalg.norm(model.gravity)) or 9.81
        self._lightest = _lightest(model)
        self._settling = (_SETTLED / self._lightest) ** 0.5 / g
        self._briefest = min(_BRIEF * settings.accuracy / g, _LONGEST)
        self._least_kappa = least_kappa(float(model.body_mass.sum()), len(model.pair_kind) > 0)
        self._kept = threading.local()  # scratch, and `contacts` (ncontact, 11) of the last step

    def _line(self) -> tuple[Table, Embedded, SubstepState]:
        """Scratch of this thread."""
        if not hasattr(self._kept, "line"):
            nx, nv, ncontact = self.nx, self.sizes.nv, self.sizes.ncontact
            errors = Embedded(*embedded(), np.zeros(nv), np.zeros(nv))
            x, trial, mean, whole, half, node, ahead = (np.zeros(nx) for _ in range(7))
            line = SubstepState(
                np.zeros(self.nu),
                self.no_wrenches,
                x,
                trial,
                mean,
                whole,
                half,
                node,
                ahead,
                np.zeros((2, nx)),
                np.zeros(len(Clock)),
                np.zeros(REPORT),
                contact_rows(self.sizes, 3),
                np.zeros(ncontact),
                contact_rows(self.sizes),
                np.zeros((_ROWS, nx)),
                np.zeros(_ROWS),
                np.zeros(_ROWS, dtype=np.int64),
                np.zeros(1, dtype=np.int64),
            )
            models = np.stack([self.linked(link_substeps), self._second.step_table(link_momentum)])
            self._kept.line = models, errors, line
        found: tuple[Table, Embedded, SubstepState] = self._kept.line
        return found

    def take(self, x: Vector, u: Vector, wrench: Cube, kappa: float | None = None) -> Substeps:
        """The step from x (nx,) under u (nu,) and external wrenches (1 or 0, nbody, 6)."""
        (models, errors, line), settings = self._line(), self.settings.array(kappa)
        goal, end = self._goal(settings), self.settings.time_step
        line = line._replace(u=u, wrench=wrench)
        line.x[:], line.clock[Clock.BEGUN] = x, 0.0
        data_tables, rows, status = self._scratch.tables(2), [], int(Status.SOLVED)
        for _ in pieces(settings, 2):
            status = int(go_on(models, data_tables, settings, goal, errors, line))
            n = int(line.taken[0])
            rows.append((line.starts[:n].copy(), line.lengths[:n].copy(), line.orders[:n].copy()))
            if status != Status.SOLVED or line.clock[Clock.TIME] >= end:
                break
            if line.report[StepReport.PARTS] > _MOST:
                status, line.report[StepReport.STATUS] = int(Status.MAX_ITERATIONS), Status.SOLVED
                break
        end_report(line, status)
        line.report[StepReport.ERROR] = line.clock[Clock.ERROR] / end if status == Status.SOLVED else 0.0
        contacts = self._kept.contacts = line.contacts.copy()
        parts = rows[0] if len(rows) == 1 else [np.concatenate(column) for column in zip(*rows, strict=True)]
        starts, lengths, orders = parts
        return Substeps(status, line.x.copy(), line.report.copy(), contacts, starts, lengths, orders)

    def _goal(self, settings: Vector) -> Vector:
        """(8,) what sub-steps have to reach, see sim/integrators/adaptive.py."""
        s = self.settings
        pressing = settings[StepSetting.KAPPA] / s.time_step  # [N m]
        least = (self._settling**2 * self._least_kappa) ** (1.0 / 3.0)
        settled = max(self._settling * pressing**0.5, least, self._briefest, SHORTEST)
        impact = min(max(SHORTEST, _IMPACT / self._lightest), settled)
        lengths, tree = (s.time_step, s.time_step, settled), float(self._is_tree)
        return np.array([s.accuracy, *lengths, self._least_kappa, tree, impact, _MOST])

    # -- sub-steps one by one ------------------------------------------------------------------------------------------

    def _part_settings(self, h: float, kappa: float | None, parts: int = 1) -> Vector:
        """Settings of a step of order 2 of length h, as in `part_of` of node_step.py."""
        settings = self._second.settings.array(kappa)
        settings[StepSetting.TIME_STEP] = h
        settings[StepSetting.KAPPA] = max(
            settings[StepSetting.KAPPA] * h / self.settings.time_step, parts * self._least_kappa
        )
        return settings

    def part(self, x: Vector, held: Held, h: float, order: int, kappa: float | None = None) -> Vector:
        """The node one sub-step of a length and order after x (nx,); NaN where it is not solved."""
        if order == 8:
            return self._long(x, held, h, False)[0]
        if order != 2:
            return self._combined(np.stack([self._equal(x, held, h, n, kappa) for n in _DIVISIONS[order]]))
        return self._equal(x, held, h, 2, kappa)

    def _equal(self, x: Vector, held: Held, h: float, parts: int, kappa: float | None) -> Vector:
        """The node a length h after x (nx,), in parts of order 2."""
        for _ in range(parts):
            x = self._short(x, held, h / parts, kappa, 2 if parts == 1 else 1)
        return x

    def _combined(self, ends: Floats) -> Vector:
        """The extrapolated node of those after one, two and three parts, (3, nx)."""
        out, scratch = np.zeros(self.nx), np.zeros((2, self.sizes.nv))
        combined_at(self._second.step_table(), self._scratch.table(), ends, out, scratch)
        return out

    def _short(self, x: Vector, held: Held, h: float, kappa: float | None, parts: int) -> Vector:
        """The node one step of order 2 after x (nx,).   parts: as in `part_of` of node_step.py."""
        (u, wrench), xs = held, np.zeros((2, self.nx))
        xs[0] = self._mean(x, held, h)[1]
        contacts = contact_rows(self.sizes, 1)
        line = MotionBuffers(xs, u[None], wrench, np.zeros((1, REPORT)), contacts, *self.no_predictions[:2])
        model, data = self._second.step_table(), self._scratch.table()
        if roll(model, data, self._part_settings(h, kappa, parts), line, 0, None, None) < 1:
            return np.full(self.nx, np.nan)
        return self._node(xs[1], held, h)[1]

    def part_slopes(
        self, x: Vector, held: Held, h: float, order: int, kappa: float | None = None
    ) -> tuple[Vector, Floats, Floats, Vector]:
        """(node after a sub-step, its derivatives by x and by the input, report).

        The report is that of the part with the largest error, or of the first that is not solved; then do not use the
        others.
        """
        if order == 8:
            return self._long(x, held, h, True)
        if order == 2:
            return self._equal_slopes(x, held, h, 2, kappa)
        found = [self._equal_slopes(x, held, h, n, kappa) for n in _DIVISIONS[order]]
        worst = max((report for *_, report in found), key=_least_exact)
        if worst[StepReport.STATUS] != Status.SOLVED:
            return *found[0][:3], worst
        ends = np.stack([end for end, *_ in found])
        shares = np.split(self._combined_slopes(ends), len(ends), axis=1)
        by_x = sum((C @ A for C, (_, A, _, _) in zip(shares, found, strict=True)), np.zeros((self.ndx, self.ndx)))
        by_u = sum((C @ B for C, (_, _, B, _) in zip(shares, found, strict=True)), np.zeros((self.ndx, self.nu)))
        return self._combined(ends), by_x, by_u, worst

    def _combined_slopes(self, ends: Floats) -> Floats:
        """Derivatives (ndx, 3 ndx) of the extrapolated node by those it is combined of, by differences."""
        end = self._combined(ends)

        def moved(change: Floats) -> Floats:
            starts = self.states.integrate(ends, change.reshape(len(ends), self.ndx))
            return np.asarray(self.states.difference(end[None], self._combined(starts)[None])[0])

        return central_differences(moved, len(ends) * self.ndx, _NUDGE)

    def _equal_slopes(
        self, x: Vector, held: Held, h: float, parts: int, kappa: float | None
    ) -> tuple[Vector, Floats, Floats, Vector]:
        """As part_slopes, of equal parts of order 2."""
        u, wrench = held
        by_x, by_u = np.eye(self.ndx), np.zeros((self.ndx, self.nu))
        model, data = self._second.gradient_table(), self._scratch.table()
        A, B = np.zeros((1, self.ndx, self.ndx)), np.zeros((1, self.ndx, self.nu))
        h, reports = h / parts, np.zeros((1, REPORT))
        settings, worst = self._part_settings(h, kappa, 2 if parts == 1 else 1), np.zeros(REPORT)
        for _ in range(parts):
            status, mean = self._mean(x, held, h)
            if status != Status.SOLVED:
                return x, by_x, by_u, _refused(status)
            x_next = np.zeros((1, self.nx))
            line = Linearized(mean[None], u[None], wrench, A, B, x_next, reports)
            linearize(model, data, settings, (0, 0, 1), 1, line)
            worst = max(worst, reports[0].copy(), key=_least_exact)
            if worst[StepReport.STATUS] != Status.SOLVED:
                return x, by_x, by_u, worst
            C, D = self._mean_slopes(x, held, h, mean)
            status, x = self._node(x_next[0], held, h)
            if status != Status.SOLVED:
                return x, by_x, by_u, _refused(status)
            E, F = self._end_slopes(x_next[0], held, h, x)
            by_u = E @ (A[0] @ (C @ by_u + D) + B[0]) + F
            by_x = E @ A[0] @ C @ by_x
        return x, by_x, by_u, worst

    def _long(self, x: Vector, held: Held, h: float, derivatives: bool) -> tuple[Vector, Floats, Floats, Vector]:
        """As part_slopes, of order 8; without derivatives these are empty."""
        (u, wrench), settings = held, self.settings.array()
        settings[StepSetting.TIME_STEP] = h
        data, reports, (contacts, A, B) = self._scratch.table(), np.zeros((1, REPORT)), self.no_outputs
        if derivatives:
            A, B, ends = np.zeros((1, self.ndx, self.ndx)), np.zeros((1, self.ndx, self.nu)), np.zeros((1, self.nx))
            line = Linearized(x[None], u[None], wrench, A, B, ends, reports)
            linearize(self.gradient_table(), data, settings, (0, 0, 1), 1, line)
            return ends[0], A[0], B[0], reports[0]
        xs = np.stack([x, np.full(self.nx, np.nan)])
        motion = MotionBuffers(xs, u[None], wrench, reports, contacts, A, B)
        if roll(self.step_table(), data, settings, motion, 0, None, None) == 0:
            xs[1] = np.nan
        return xs[1], A, B, reports[0]

    def _mean(self, x: Vector, held: Held, h: float) -> tuple[int, Vector]:
        """(Status, mean state of the node x before a step of length h); NaN where there is none."""
        (u, wrench), mean, data = held, np.zeros(self.nx), self._scratch.table()
        begin_work(data, wrench)
        status = int(mean_of_node(self._second.step_table(link_momentum), data, h, u, x, mean))
        return status, mean if status == Status.SOLVED else np.full(self.nx, np.nan)

    def _node(self, mean: Vector, held: Held, h: float) -> tuple[int, Vector]:
        """(Status, node at the end of a step of length h to the mean state); NaN where there is none."""
        (u, wrench), x, data = held, np.zeros(self.nx), self._scratch.table()
        begin_work(data, wrench)
        status = int(node_at(self._second.step_table(), data, h, u, mean, x))
        return status, x if status == Status.SOLVED else np.full(self.nx, np.nan)

    def _node_terms(self, x: Vector, held: Held) -> tuple[Slopes, Floats]:
        """Derivatives of M(q) v and of the forces of inputs and wrenches, at the node x."""
        nv, (u, wrench) = self.sizes.nv, held
        slopes, by_q = empty_slopes(nv, self.nu), np.zeros((nv, nv))
        node_slopes(self._second.gradient_table(), self._scratch.table(), u, wrench, x, slopes, by_q)
        return slopes, by_q

    def _momentum_slopes(self, h: float, mean: Vector) -> tuple[Floats, Floats]:
        """dp/dq, dp/dv of a mean state over h."""
        nv = self.sizes.nv
        by_q, by_v = np.zeros((nv, nv)), np.zeros((nv, nv))
        momentum_jacobian(self._second.gradient_table(), self._scratch.table(), h, mean, by_q, by_v)
        return by_q, by_v

    def _damping(self, h: float) -> Floats:
        """C of the dampers for a step of length h, (nv, nv)."""
        out = np.zeros(self.sizes.nv)
        node_dampings(self._second.step_table(), h, out)
        return np.diag(out)

    def _mean_slopes(self, x: Vector, held: Held, h: float, mean: Vector) -> tuple[Floats, Floats]:
        """d(mean)/d(x, u):  p_v dv' = (M + C) dv + ((M v)_q - h/2 f_q - p_q) dq - h/2 f_u du."""
        if not self._is_tree:
            return self._closed_slopes(self._mean, x, held, h)
        nv, (slopes, force) = self.sizes.nv, self._node_terms(x, held)
        by_q, by_v = self._momentum_slopes(h, mean)
        A, B = np.eye(self.ndx), np.zeros((self.ndx, self.nu))
        damped = slopes.p_v + self._damping(h)
        A[nv:] = solved(by_v, np.hstack([slopes.p_q - 0.5 * h * force - by_q, damped]))
        B[nv:] = solved(by_v, -0.5 * h * slopes.f_u)
        return A, B

    def _end_slopes(self, mean: Vector, held: Held, h: float, x: Vector) -> tuple[Floats, Floats]:
        """d(x)/d(mean, u):  (M + C) dv = p_v dv' + (p_q + h/2 f_q - (M v)_q) dq + h/2 f_u du."""
        if not self._is_tree:
            return self._closed_slopes(self._node, mean, held, h)
        nv, (slopes, force) = self.sizes.nv, self._node_terms(x, held)
        by_q, by_v = self._momentum_slopes(h, mean)
        A, B = np.eye(self.ndx), np.zeros((self.ndx, self.nu))
        damped = slopes.p_v + self._damping(h)
        A[nv:] = solved(damped, np.hstack([by_q + 0.5 * h * force - slopes.p_q, by_v]))
        B[nv:] = solved(damped, 0.5 * h * slopes.f_u)
        return A, B

    def _closed_slopes(self, convert: Conversion, x: Vector, held: Held, h: float) -> tuple[Floats, Floats]:
        """Derivatives of a conversion by the state x (nx,) and the input, by differences.

        Loops and gears are closed by projections, whose derivatives have second derivatives of the closures.
        """
        (u, wrench), end = held, convert(x, held, h)[1]

        def moved(change: Floats) -> Floats:
            start = self.states.integrate(x[None], change[None, : self.ndx])[0]
            _, to = convert(start, (u + change[self.ndx :], wrench), h)
            return np.asarray(self.states.difference(end[None], to[None])[0])

        both = central_differences(moved, self.ndx + self.nu, _NUDGE)
        return both[:, : self.ndx], both[:, self.ndx :]

    def slopes(self, path: Substeps, held: Held, kappa: float | None = None) -> tuple[Floats, Floats, Vector]:
        """(A, B, report) of a step: the products of those of its sub-steps, whose lengths are held.

        The report (9,) is that of the sub-step with the largest error, or of the first without derivatives.
        """
        A, B, worst = np.eye(self.ndx), np.zeros((self.ndx, self.nu)), np.zeros(REPORT)
        for x, h, order in zip(path.starts, path.lengths, path.orders, strict=True):
            _, dx, du, report = self.part_slopes(x, held, h, int(order), kappa)
            worst = max(worst, report, key=_least_exact)
            if worst[StepReport.STATUS] != Status.SOLVED:
                return np.full_like(A, np.nan), np.full_like(B, np.nan), worst
            A, B = dx @ A, dx @ B + du
        return A, B, worst

    def linearize_plan(
        self, xs: Floats, us: Floats, substeps: int, kappa: float, guess: Floats | None = None
    ) -> tuple[Floats, ...]:
        """As Engine.linearize_plan: where something may touch, next states have the accuracy, and derivatives are those
        of equal time steps of order 2.

        Derivatives that hold the sub-steps hold the time of an impact, too. In sub-steps of a microsecond, a contact
        whose gap changes by a micrometre is another one: they are right, and of no use further away.
        """
        if self.sizes.ncontact + len(self.model.limit_dof) == 0:
            return self.linearize(xs, us, substeps, kappa)
        n = len(us)
        A, B = np.zeros((n, self.ndx, self.ndx)), np.zeros((n, self.ndx, self.nu))
        x_next, reports = np.zeros((n, self.nx)), np.zeros((n, REPORT))
        for t in range(n):
            rolled = self.roll(xs[t], np.repeat(us[t : t + 1], substeps, axis=0), kappa=kappa)
            reports[t] = rolled.summary()
            if rolled.solved_steps == substeps:
                A[t], B[t], reports[t] = self._even_slopes(rolled, us[t], kappa)
                x_next[t] = rolled.xs[-1]
        return A, B, x_next, reports

    def _even_slopes(self, rolled: Rolled, u: Vector, kappa: float) -> tuple[Floats, Floats, Vector]:
        """(A, B, report) of a knot: products of the derivatives of its steps, each in equal parts of order 2."""
        A, B = np.eye(self.ndx), np.zeros((self.ndx, self.nu))
        held, step = (u, self.external(None)), self.settings.time_step
        for x in rolled.xs[:-1]:
            for parts in _even_parts(step):
                dx, du, report = self._slopes_of_parts(x, held, step / parts, parts, kappa)
                if report[StepReport.STATUS] == Status.SOLVED:
                    break
            else:
                return A, B, report
            A, B = dx @ A, dx @ B + du
        return A, B, report

    def _slopes_of_parts(
        self, x: Vector, held: Held, h: float, parts: int, kappa: float
    ) -> tuple[Floats, Floats, Vector]:
        """(A, B, report) of steps of order 2 of length h from the node x to a node."""
        (u, wrench), reports, settings = held, np.zeros((1, REPORT)), self._part_settings(h, kappa)
        A, B = np.zeros((1, self.ndx, self.ndx)), np.zeros((1, self.ndx, self.nu))
        status, mean = self._mean(x, held, h)
        if status != Status.SOLVED:
            return A[0], B[0], _refused(status)
        last, model, data, step = mean.copy(), self._second.gradient_table(), self._scratch.table(), 0
        line = Linearized(mean[None], u[None], wrench, A, B, last[None], reports)
        for _ in pieces(settings, parts):
            step = int(linearize(model, data, settings, (0, step, 1), parts, line))
            if step == parts:
                break
        if reports[0, StepReport.STATUS] != Status.SOLVED:
            return A[0], B[0], reports[0]
        status, end = self._node(last, held, h)
        if status != Status.SOLVED:
            return A[0], B[0], _refused(status)
        C, D = self._mean_slopes(x, held, h, mean)
        E, F = self._end_slopes(last, held, h, end)
        return E @ A[0] @ C, E @ (A[0] @ D + B[0]) + F, reports[0]

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
        """As Engine.roll."""
        if derivatives:
            return self._roll_slopes(x, us, wrenches, kappa)
        steps, external = len(us), self.external(wrenches)
        (models, errors, line), settings, data_tables = (
            self._line(),
            self.settings.array(kappa),
            self._scratch.tables(2),
        )
        goal, (A, B) = self._goal(settings), self.no_predictions[:2]
        xs, reports = np.zeros((steps + 1, self.nx)), np.zeros((steps, REPORT))
        contacts = contact_rows(self.sizes, steps)
        xs[0], line.clock[Clock.BEGUN], knot = x, 0.0, 0
        line = line._replace(wrench=np.zeros_like(external[:1]))
        path = SubstepMotion(us, external, xs, reports, contacts)
        try:
            for _ in pieces(settings, steps + 1):
                knot = int(roll_substeps(models, data_tables, settings, goal, errors, line, path, knot))
                if knot == steps or reports[knot, StepReport.STATUS] != Status.SOLVED:
                    break
        except KeyboardInterrupt:
            raise Interrupted(Rolled(knot, xs, interrupted(reports, knot), contacts, A, B)) from None
        self._kept.contacts = line.contacts.copy()
        return Rolled(knot, xs, reports, contacts, A, B)

    def _roll_slopes(self, x: Vector, us: Floats, wrenches: Cube | None, kappa: float | None) -> Rolled:
        """`roll` with the derivatives of its steps."""
        steps = len(us)
        xs, reports = np.zeros((steps + 1, self.nx)), np.zeros((steps, REPORT))
        contacts = contact_rows(self.sizes, steps)
        A, B = np.zeros((steps, self.ndx, self.ndx)), np.zeros((steps, self.ndx, self.nu))
        external = self.external(wrenches)
        xs[0], knot = x, 0
        for t in range(steps):
            held = us[t], external[t : t + 1]
            path = self.take(xs[t], *held, kappa)
            reports[t] = path.report
            if path.status == Status.SOLVED:
                A[t], B[t], found = self.slopes(path, held, kappa)
                reports[t, StepReport.ACCURACY] = found[StepReport.ACCURACY]
                if found[StepReport.STATUS] == Status.SOLVED:
                    refuse(reports[t : t + 1], 1, A[t : t + 1], B[t : t + 1])
                else:
                    reports[t], reports[t, StepReport.PARTS] = found, len(path.lengths)
            if reports[t, StepReport.STATUS] != Status.SOLVED:
                break
            xs[t + 1], contacts[t], knot = path.x, path.contacts, t + 1
        return Rolled(knot, xs, reports, contacts, A, B)

    def nodes_at(self, motion: tuple[Floats, Floats, Floats | None], times: Vector) -> Floats:
        """(n, nx) nodes of a motion (states, inputs, external wrenches) at times since its beginning, in any order [s].

        The sub-step in which a time lies is taken again as far as there, so a node has the accuracy of the motion.
        """
        xs, us, external = motion
        if len(us) == 0:
            return np.tile(xs[0], (len(times), 1))
        wrenches = self.external(external)
        h, out, known = self.settings.time_step, np.empty((len(times), self.nx)), -1
        for i, time in enumerate(times):
            t = min(int(time / h), len(us) - 1)
            held = us[t], wrenches[t : t + 1]
            if t != known:
                path, known = self.take(xs[t], *held), t
            rest = time - t * h
            ends = np.cumsum(path.lengths)
            k = int(np.searchsorted(ends, rest * (1.0 + 1e-12), side="right"))
            begin = ends[k - 1] if k else 0.0
            if k == len(ends):
                out[i] = path.x
            elif rest - begin <= 1e-12 * h:
                out[i] = path.starts[k]
            else:
                out[i] = self.part(path.starts[k], held, rest - begin, int(path.orders[k]))
        return out

    def inactive(self) -> NDArray[np.bool_]:
        """As Engine.inactive: contacts that carried nothing in the last step of this thread."""
        carried: Floats = self._kept.contacts
        impulses = carried[:, ContactRow.IMPULSE : ContactRow.POINT]
        return np.asarray(np.linalg.norm(impulses, axis=1) <= self.settings.tolerance)


def _even_parts(step: float) -> list[int]:
    """Numbers of equal parts of a step, from few on."""
    few = max(1, int(np.ceil(step / _EVEN - 1e-9)))
    return [few << k for k in range(_HALVINGS)]


def _least_exact(report: Vector) -> tuple[bool, float]:
    """Order of reports of derivatives: those with a larger error later, unsolved ones last, alike."""
    unsolved = bool(report[StepReport.STATUS] != Status.SOLVED)
    return unsolved, 0.0 if unsolved else float(report[StepReport.ACCURACY])


def _refused(status: int) -> Vector:
    """(9,) report of a conversion between a node and a mean state that failed."""
    report = np.zeros(REPORT)
    report[StepReport.STATUS], report[StepReport.WORST] = status, -1.0
    return report


def _lightest(model: Model) -> float:
    """Mass of the lightest tree of joints [kg]."""
    mass = model.body_mass.copy()
    for i in range(len(mass) - 1, -1, -1):
        if model.body_parent[i] >= 0:
            mass[model.body_parent[i]] += mass[i]
    return float(mass[model.body_parent < 0].min())


def check_adaptive(mechanism: Mechanism, accuracy: float) -> None:
    """Refuse dry friction and limits of servos, whose kinks are not found, and accuracies that contacts do not have."""
    stops = any(np.isfinite(pair).any() for joint in mechanism.joints for pair in joint.limits or ())
    stops = stops or any(joint.cone is not None for joint in mechanism.joints)
    held = stops or mechanism.contacts or mechanism.collisions or mechanism.loops or mechanism.gears
    if accuracy < _LEAST_PRESSING and held:
        raise ValueError(
            f"Simulator(accuracy=...): expected at least {_LEAST_PRESSING:g} with contacts, collisions, limits of "
            f"joints, closed loops or gears, whose errors cannot be estimated below that, got {accuracy:g}"
        )
    names = [("dry friction of", j.name) for j in mechanism.joints if np.any(j.friction)]
    names += [("limited servo", part.name) for _, part in limited_servos(mechanism.inputs or ())]
    if names:
        feature, name = names[0]
        raise ValueError(
            f"Simulator(accuracy=...): {mechanism.name!r} has the {feature} {name!r}; steps of a given accuracy are "
            "for mechanisms without dry friction and limits of servos: use a time step"
        )
