"""Linearizer: derivatives of the steps and motions of one simulator, as results with their status."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.mechanism.mechanism import Mechanism
from sim.model.record_columns import StepReport
from sim.simulator.derivative_results import Gradient, Jacobian, Linearization
from sim.simulator.engines.engine import Engine
from sim.simulator.results import STATUSES, status_message
from sim.simulator.simulator_parameters import SimulatorParameters
from solvers.status import Status
from solvers.types import Floats, Vector


class Linearizer:
    """Derivatives by states, inputs and parameters; the methods take checked arrays.

    Args:
        mechanism: of the simulator.
        engine: of the simulator.
        by_parameters: derivatives by its parameters.
    """

    def __init__(self, mechanism: Mechanism, engine: Engine, by_parameters: SimulatorParameters) -> None:
        self._mechanism, self._engine, self._by_parameters = mechanism, engine, by_parameters

    def _detail(self, where: str, report: Vector) -> str:
        """Why a step was not solved."""
        return status_message(self._mechanism, where, report, self._engine.settings.tolerance)

    def step(
        self, x: Vector, u: Vector, wrt: Sequence[str] | None, kappa: float | None, wrenches: Floats | None
    ) -> Jacobian:
        """As `Simulator.linearize`."""
        call = "Simulator.linearize"
        selected = None if wrt is None else self._by_parameters.select(f"{call}(wrt=...)", wrt)
        if selected is None or not selected[1].names:
            A, B, x_next, report = self._engine.linearize_one(x, u, kappa, wrenches)
            blocks = {"state": A, "input": B}
        else:
            rolled, J = self._by_parameters.roll(x, u[None], selected[1:], kappa, wrenches)
            (A,), (B,), x_next, report = rolled.A, rolled.B, rolled.xs[1], rolled.reports[0]
            blocks = {"state": A, "input": B} | {name: J[0][:, rows] for name, rows in selected[1].rows.items()}
        status, accuracy = STATUSES[int(report[StepReport.STATUS])], float(report[StepReport.ACCURACY])
        detail = "" if status == Status.SOLVED else self._detail(call, report)
        if selected is not None and status == Status.SOLVED:
            blocks = {name: blocks[name] for name in selected[0]}
        return Jacobian(blocks, x_next, status, accuracy, detail)

    def rollout(
        self, x: Vector, us: Floats, wrt: Sequence[str], kappa: float | None, wrenches: Floats | None
    ) -> tuple[Floats, Linearization]:
        """As `Simulator.linearize_rollout`."""
        call = "Simulator.linearize_rollout"
        chosen = self._by_parameters.select(f"{call}(wrt=...)", wrt)[1:]
        if chosen[0].names:
            rolled, J = self._by_parameters.roll(x, us, chosen, kappa, wrenches)
            blocks = {name: J[:, :, rows] for name, rows in chosen[0].rows.items()}
        else:
            rolled, blocks = self._engine.roll(x, us, wrenches, kappa=kappa, derivatives=True), {}
        knot, reports, detail = rolled.solved_steps, rolled.reports, ""
        if knot < len(us):
            detail = self._detail(f"{call}: step {knot}", reports[knot])
            reports[knot:, StepReport.STATUS] = reports[knot, StepReport.STATUS]
            rolled.xs[knot + 1 :] = rolled.xs[knot]
            for array in (rolled.A, rolled.B, *blocks.values()):
                array[knot:] = 0.0
        statuses, accuracy = reports[:, StepReport.STATUS].astype(np.int64), reports[:, StepReport.ACCURACY]
        return rolled.xs, Linearization(rolled.A, rolled.B, rolled.xs[1:], statuses, blocks, accuracy, detail)

    def knots(
        self, xs: Floats, us: Floats, substeps: int, kappa: float | None, wrenches: Floats | None
    ) -> Linearization:
        """As `Simulator.linearize_trajectory`."""
        A, B, x_next, reports = self._engine.linearize(xs, us, substeps, kappa, None, wrenches)
        statuses, detail = reports[:, StepReport.STATUS].astype(np.int64), ""
        if statuses.any():
            t = int(np.flatnonzero(statuses)[0])
            detail = self._detail(f"Simulator.linearize_trajectory: knot {t}", reports[t])
        return Linearization(A, B, x_next, statuses, accuracy=reports[:, StepReport.ACCURACY], detail=detail)

    def gradient(
        self,
        path: tuple[Floats, Floats],
        loss: Floats,
        wrt: Sequence[str],
        kappa: float | None,
        wrenches: Floats | None,
    ) -> Gradient:
        """As `Simulator.vjp`; path: (states, inputs)."""
        call = "Simulator.vjp"
        asked, found, plan = self._by_parameters.select(f"{call}(wrt=...)", wrt)
        knot, line = self._by_parameters.sweep(path, loss, (found, plan), kappa, wrenches)
        blocks = {"state": line.costate[0], "input": line.inputs}
        blocks = {name: blocks[name] if name in blocks else line.parameters[found.rows[name]] for name in asked}
        if knot >= 0:
            status = Status(int(line.report[0, StepReport.STATUS]))
            return Gradient(blocks, status, self._detail(f"{call}: step {knot}", line.report[0]))
        finite = all(np.isfinite(block).all() for block in blocks.values())
        return Gradient(blocks, Status.SOLVED if finite else Status.NOT_FINITE)
