"""The terms that a step of a robot omits, and the cost of each of its features."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dojo_opt.report.interleaved_rounds import ratio
from dojo_opt.report.lean.cold_starts import add_cold_starts
from dojo_opt.report.lean.cost_figure import cost_figure
from dojo_opt.report.lean.feature_variants import robot_scene, without
from dojo_opt.report.result import Report, Row, Table
from dojo_opt.report.step_cost import COST_HEADER, Cost, CostScene, cost_row, costs, median_us, raw_cost
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from solvers.compiler import threads

_OTHERWISE = 1.5  # times the iterations of the robot as it is: the motion is another one


@dataclass(frozen=True)
class OmittedTerms:
    """A robot with all features, and without each of them; quick: fewer rounds; cold: cold starts by feature, too."""

    mechanism: Mechanism
    quick: bool = False
    time_step: float = 0.01  # [s]
    cold: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report(f"Cost of each feature of {self.mechanism.name}")
        with threads(1):
            _robot(report, self.mechanism, self.time_step, 15 if self.quick else 100, progress)
        if self.cold:
            add_cold_starts(report, progress, quick=self.quick)
        return report


def _robot(report: Report, mechanism: Mechanism, time_step: float, rounds: int, progress: Progress) -> None:
    """A robot with all of its features, and without each of them."""
    report.summary = (
        f"{mechanism.name}, moving freely from its neutral state with {1e3 * time_step:g} ms steps; then without each "
        "of its features. A row has the change of the time without a feature: processor time on one core, medians over "
        "interleaved rounds. Without limits or springs a robot may collapse, and then moves otherwise."
    )
    scenes = [robot_scene(name, variant, time_step) for name, variant in without(mechanism)]
    measured: list[Cost] = []
    for batch in progress([(mechanism.name, scenes)], "lean"):
        measured = costs(batch, rounds)
    report.tables.append(
        Table("The robot without its features", COST_HEADER, [cost_row(cost) for cost in measured], _messages(measured))
    )
    whole = measured[0]
    for cost in measured[1:]:
        change = ratio(cost.total, whole.total) - 1.0
        note = f"{median_us(cost.total):.3g} for {median_us(whole.total):.3g} us"
        if cost.iterations > _OTHERWISE * whole.iterations:
            note += f"; another motion, with {cost.iterations:.3g} iterations per step for {whole.iterations:.3g}"
        report.rows.append(Row(f"{cost.name}: change of step and gradient", 100.0 * change, "%", note=note))
    report.details["robot"] = [raw_cost(cost) for cost in measured]
    report.notes += [line.strip() for line in scenes[0].simulator.describe().partition("a step\n")[2].splitlines()]
    report.notes += _far_notes(scenes[0], whole)
    report.figure = cost_figure(mechanism.name, report.details["robot"])


def _far_notes(scene: CostScene, cost: Cost) -> list[str]:
    """The inactive contacts of the neutral state."""
    if not np.isfinite(cost.iterations):
        return ["the first step from the neutral state is not solved: " + cost.message]
    far = scene.simulator.inactive_contacts(scene.state)
    return [f"far in the neutral state: {', '.join(far) or 'nothing'}"]


def _messages(measured: list[Cost]) -> str:
    """Why motions ended early."""
    return " ".join(f"{cost.name}: {cost.message}" for cost in measured if cost.message)
