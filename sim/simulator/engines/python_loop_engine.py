"""Engines whose steps call several kernels, with loops in Python."""

from __future__ import annotations

import numpy as np

from sim.integrators.feedback import FeedbackLaw, Path
from sim.model.record_columns import StepReport
from sim.simulator.engines.engine import REPORT, Floats, add_report, interrupted, knot_inputs
from sim.simulator.engines.high_order_engine import HighOrderEngine
from sim.simulator.results import Interrupted
from solvers.types import Cube, Integers, Vector


class PythonLoopEngine(HighOrderEngine):
    """A HighOrderEngine with a `roll` and a `linearize_knot` of its own, from which everything else follows."""

    in_one_kernel = False

    def roll_batch(self, x0s: Floats, us: Floats) -> tuple[Floats, Floats, Integers]:
        """As Engine.roll_batch, on one core."""
        n, steps = us.shape[:2]
        xs = np.zeros((n, steps + 1, self.nx))
        reports, knots = np.zeros((n, REPORT)), np.zeros(n, dtype=np.int64)
        xs[:, 0] = x0s
        i = 0
        try:
            for i in range(n):
                rolled = self.roll(x0s[i], us[i])
                knots[i], xs[i] = rolled.solved_steps, rolled.xs
                reports[i] = rolled.summary()
        except KeyboardInterrupt as stop:
            interrupted(reports[i:], 0)
            reports[i:] = reports[i]
            if isinstance(stop, Interrupted):
                knots[i], xs[i] = stop.result.solved_steps, stop.result.xs
            raise Interrupted((xs, reports, knots)) from None
        return xs, reports, knots

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
        """As Engine.roll_feedback; warm starts of the policy and another limit of iterations are not used."""
        knots = len(policy.us)
        path = self._path(knots, keep=keep, cones=False)
        path.xs[0], total, t = x, 0.0, 0
        try:
            for t in range(knots):
                dx = self.states.difference(policy.xs[t : t + 1], path.xs[t : t + 1])[0]
                path.us[t] = np.clip(policy.us[t] + alpha * policy.ks[t] + policy.Ks[t] @ dx, *limits)
                rolled = self.roll(path.xs[t], *knot_inputs(path.us, policy.wrenches, t, substeps), kappa=kappa)
                add_report(path.report, rolled.summary())
                if rolled.solved_steps < substeps:
                    return t, path
                total += rolled.reports[:, StepReport.ITERATIONS].sum()
                path.xs[t + 1] = rolled.xs[-1]
                if alpha < 1.0:
                    gap = policy.gaps[t + 1 : t + 2]
                    path.xs[t + 1] = self.states.integrate(rolled.xs[-1:], (alpha - 1.0) * gap)[0]
        except KeyboardInterrupt:
            interrupted(path.report[None], 0)
            raise Interrupted((t, path)) from None
        path.report[StepReport.ITERATIONS] = total
        return knots, path

    def linearize(
        self,
        xs: Floats,
        us: Floats,
        substeps: int,
        kappa: float | None,
        guess: Floats | None = None,
        wrenches: Cube | None = None,
    ) -> tuple[Floats, ...]:
        """As Engine.linearize, on one core; without guess."""
        self.gradient_table()  # which refuses joints without derivatives
        n, external = len(us), self.external(wrenches)
        A, B = np.zeros((n, self.ndx, self.ndx)), np.zeros((n, self.ndx, self.nu))
        x_next, reports = np.zeros((n, self.nx)), np.zeros((n, REPORT))
        for t in range(n):
            A[t], B[t], x_next[t], reports[t] = self.linearize_knot(
                xs[t], knot_inputs(us, external, t, substeps), kappa
            )
        return A, B, x_next, reports
