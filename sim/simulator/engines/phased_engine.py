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
from sim.integrators import legendre
from sim.integrators.hamilton_gradient import empty_slopes
from sim.integrators.phased_rollout import Phases, roll_phases
from sim.integrators.rollout import MotionBuffers
from sim.model.interruptible_loops import pieces
from sim.model.model import Model
from sim.model.record_columns import StepReport
from sim.simulator.engines.dividing_engine import DividingEngine
from sim.simulator.engines.division import DIVISIBLE
from sim.simulator.engines.engine import REPORT, Engine, Floats, Rolled, contact_rows, interrupted
from sim.simulator.engines.linear_systems import solved
from sim.simulator.engines.python_loop_engine import PythonLoopEngine
from sim.simulator.link_kernels import link_flight, link_momentum
from sim.simulator.results import Interrupted
from sim.simulator.settings import Settings
from solvers.compiler import Table
from solvers.status import Status
from solvers.types import Cube, Vector


class March(NamedTuple):
    """Steps from one state on; rows after the last solved step are undefined."""

    solved_steps: int
    xs: Floats  # (T + 1, nx)
    reports: Floats  # (T, 9) of StepReport
    contacts: Floats  # (T, ncontact, 11)
    means: Floats  # (T + 1, nx) the states of order 2 where its steps begin
    near: NDArray[np.bool_]  # (T,) which those are


class PhasedEngine(PythonLoopEngine):
    """The kernels of one packed mechanism with contacts or limits, or with joints that are too stiff.

    second_order_reason: why all steps are of order 2; "" if they are so near contacts and limits alone.
    """

    def __init__(self, model: Model, settings: Settings, second_order_reason: str = "") -> None:
        super().__init__(model, settings)
        self.second_order_reason = second_order_reason
        self._second = (DividingEngine if settings.divide else Engine)(model, settings._replace(order=2))
        self._kept = threading.local()  # tables, and whether the last step was `near`

    def rehearse(self, x: Vector, *, derivatives: bool = False) -> None:
        """As Engine.rehearse, with the steps of order 2."""
        super().rehearse(x, derivatives=derivatives)
        self._second.rehearse(x, derivatives=derivatives)

    def march(self, x: Vector, us: Floats, wrenches: Cube | None = None, kappa: float | None = None) -> March:
        """Steps from x under us (T, nu) and external wrenches (T, nbody, 6)."""
        steps, t = len(us), 0
        xs, means, near = np.zeros((steps + 1, self.nx)), np.zeros((steps + 1, self.nx)), np.zeros(steps, np.int64)
        reports, contacts = np.zeros((steps, REPORT)), contact_rows(self.sizes, steps)
        motion = MotionBuffers(means, us, self.external(wrenches), reports, contacts, *self.no_predictions[:2])
        path = Phases(xs, motion, near, not self.second_order_reason, self.settings.divide)
        xs[0], settings, (models, data_tables) = x, self._second.settings.array(kappa), self._lines()
        self._second.forget_parts()
        try:
            for _ in pieces(settings, steps):
                t = int(roll_phases(models, data_tables, settings, path, t))
                while t < steps and near[t] and self._divide(path, t, kappa):
                    t += 1
                    if t < steps:
                        t = int(roll_phases(models, data_tables, settings, path, t))
                if t == steps or reports[t, StepReport.STATUS] != Status.SOLVED:
                    break
        except KeyboardInterrupt:
            raise Interrupted((t, xs, interrupted(reports, t), contacts)) from None
        self._kept.near = bool(t and near[t - 1])
        if t < steps:
            np.nan_to_num(reports[t], copy=False, nan=np.inf, posinf=np.inf)
        return March(t, xs, reports, contacts, means, near > 0)

    def _lines(self) -> tuple[Table, Table]:
        """Tables of the models of both orders, and of this thread's Data of both."""
        own, other = self.table(), self._second.table()
        if getattr(self._kept, "data_tables", (None, None))[0] is not own:
            self._kept.data_tables = own, np.stack([own, other])
            self._kept.models = np.stack([self.linked(link_flight), self._second.step_table(link_momentum)])
        return self._kept.models, self._kept.data_tables[1]

    def _divide(self, path: Phases, t: int, kappa: float | None) -> bool:
        """Take the unsolved step t of order 2 in parts; False where that does not solve it."""
        motion, row = path.motion, slice(t, t + 1)
        if int(motion.reports[t, StepReport.STATUS]) not in DIVISIBLE:
            return False
        one = MotionBuffers(
            motion.xs[t : t + 2],
            motion.us[row],
            motion.wrenches[row],
            motion.reports[row],
            motion.contacts[row],
            *self.no_predictions[:2],
        )
        if self._second.take_steps(self._second.step_table(), one, kappa) == 0:
            return False
        path.xs[t + 1] = motion.xs[t + 1]
        path.xs[t + 1, self.sizes.nq :] = self._second.states.node_velocities(motion.xs[t + 1 : t + 2])[0]
        return True

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
        A, B = self.no_predictions[:2]
        try:
            m = self.march(x, us, wrenches, kappa)
        except Interrupted as stop:
            knot, xs, reports, contacts = stop.result
            raise Interrupted(Rolled(knot, xs, reports, contacts, A, B)) from None
        if not derivatives:
            return Rolled(m.solved_steps, m.xs, m.reports, m.contacts, A, B)
        A, B, _, found = self.linearize(m.xs[:-1], us, 1, kappa, None, wrenches)
        refused = np.flatnonzero(found[: m.solved_steps, StepReport.STATUS] != Status.SOLVED)
        end = int(refused[0]) if len(refused) else m.solved_steps
        m.reports[:end, StepReport.ACCURACY] = found[:end, StepReport.ACCURACY]
        if len(refused):  # the motion ends where a step has no derivatives
            m.reports[end] = found[end]
        return Rolled(end, m.xs, m.reports, m.contacts, A, B)

    def inactive(self) -> NDArray[np.bool_]:
        """As Engine.inactive; all of them where the step was of higher order."""
        return self._second.inactive() if self._kept.near else np.ones(self.sizes.ncontact, dtype=bool)

    def linearize_knot(
        self, x: Vector, given: tuple[Floats, Cube], kappa: float | None
    ) -> tuple[Floats, Floats, Vector, Vector]:
        """As Engine.linearize_knot: products of the derivatives of the steps, each by its own order."""
        us, external = given
        m = self.march(x, us, external, kappa)
        A, B, report = np.eye(self.ndx), np.zeros((self.ndx, self.nu)), m.reports[min(m.solved_steps, len(us) - 1)]
        accuracy = 0.0
        for s in range(len(us) if m.solved_steps == len(us) else 0):
            dx, du, found = self._step_slopes(m, s, (us[s], external[s : s + 1]), kappa)
            A, B, accuracy = dx @ A, dx @ B + du, max(accuracy, found[StepReport.ACCURACY])
            if found[StepReport.STATUS] != Status.SOLVED:
                report = found
        if report[StepReport.STATUS] != Status.SOLVED:
            return np.zeros_like(A), np.zeros_like(B), np.zeros(self.nx), report
        report[StepReport.ACCURACY] = accuracy
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
        return after @ A[0] @ solved(self._node_slopes(m.means[s]), np.eye(A.shape[1])), after @ B[0], report[0]

    def _node_slopes(self, mean: Vector) -> Floats:
        """d(q, v of the node)/d(q, mean velocity) of a state of order 2:  (p_v + C) dv = dp - p_q dq,  (ndx, ndx)."""
        nv = self.sizes.nv
        slopes = empty_slopes(nv, self.nu)
        by_q, by_mean = np.zeros((nv, nv)), np.zeros((nv, nv))
        out, model = np.eye(self.ndx), self._second.gradient_table()
        h, damping = self._second.states.interval(mean), np.zeros(nv)
        legendre.legendre_slopes(model, self._scratch.table(), h, mean, slopes, by_q, by_mean)
        node_dampings(model, h, damping)
        out[nv:] = solved(slopes.p_v + np.diag(damping), np.hstack([by_q - slopes.p_q, by_mean]))
        return out
