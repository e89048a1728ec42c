"""Results of steps and rollouts, from the arrays that an engine returns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sim.mechanism.mechanism import Mechanism
from sim.model.record_columns import StepReport
from sim.simulator.engines.engine import REPORT, Rolled, parts_of
from sim.simulator.results import STATUSES, StepResult, Trajectory, contacts_of, overlap, reservation
from solvers.status import Status
from solvers.types import Floats, Vector

# NumPy takes three times as long with the members of an enum
_STATUS, _RESIDUAL, _ITERATIONS = int(StepReport.STATUS), int(StepReport.RESIDUAL), int(StepReport.ITERATIONS)
_LOST, _ERROR = int(StepReport.LOST), int(StepReport.ERROR)

Explain = Callable[[str, Vector, Vector], str]  # sentence of (where, report (9,), state (nx,)) of an unsolved step


def step_result(mechanism: Mechanism, time_step: float, rolled: Rolled, explain: Explain) -> StepResult:
    """The result of a rollout of a single step."""
    status, iterations, residual, violation, _, _, _, lost, error = rolled.reports[0].tolist()
    scene, end = (mechanism, time_step, rolled.contacts[0]), rolled.xs[1 if rolled.solved_steps else 0]
    solved, parts = (STATUSES[int(status)], int(iterations), residual, violation), rolled.parts
    detail = "" if rolled.solved_steps else explain("Simulator.step", rolled.reports[0], end)
    if rolled.solved_steps and (lost > 0.0 or error > 1.0):
        detail = reservation(rolled.reports)
    if rolled.solved_steps and not detail:
        detail = overlap(mechanism, parts, rolled.contacts)
    return StepResult(end, *solved, scene, int(parts[0]), 1.0 - lost, error, detail)


def trajectory(sim: Any, wrenches: Floats | None, explain: Explain, inputs: Floats, rolled: Rolled) -> Trajectory:
    """The result of a rollout of a Simulator under the inputs (T, nu) and external wrenches (T, nbody, 6)."""
    knot, xs, reports = rolled.solved_steps, rolled.xs, rolled.reports[: rolled.solved_steps]
    last = rolled.reports[min(knot, len(rolled.reports) - 1)] if len(rolled.reports) else np.zeros(REPORT)
    status, parts = STATUSES[int(last[_STATUS])], parts_of(reports)
    if status == Status.SOLVED:
        detail = reservation(reports)
    else:
        detail = explain(f"Simulator.rollout: step {knot}", last, xs[knot])
    contacts = rolled.contacts[:knot]
    return Trajectory(
        simulator=sim,
        x=xs[: knot + 1],
        u=inputs[:knot],
        time=sim.time_step * np.arange(knot + 1.0),
        status=status,
        solved_steps=knot,
        residual=float(last[_RESIDUAL]),
        iterations=reports[:, _ITERATIONS].astype(np.int64),
        contacts=contacts_of(sim.mechanism, sim.time_step, contacts),
        parts=parts,
        momentum_fractions=1.0 - reports[:, _LOST],
        errors=reports[:, _ERROR],
        detail=detail or overlap(sim.mechanism, parts, contacts),
        wrenches=None if wrenches is None else wrenches[:knot],
    )
