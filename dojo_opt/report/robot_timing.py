"""Microseconds per step and gradient of a robot, by time step, and how they compare with its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dojo_opt.report.accuracy.starting_pose import start
from dojo_opt.report.costs import Cost, CostScene, costs, median_us, raw_cost
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.parallel import threads

TIME_STEPS = (1e-3, 2e-3, 5e-3, 1e-2, 2e-2)  # [s]


@dataclass(frozen=True)
class RobotTiming:
    """Time of steps and gradients of a robot; quick: fewer rounds."""

    mechanism: Mechanism
    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report(f"Time of {self.mechanism.name} on one core")
        report.summary = (
            "Steps from a random start that is always the same, joints without torques, and their derivatives along "
            "the same motion. Times are processor time on one core, medians over interleaved rounds."
        )
        q, v = start(self.mechanism)
        scenes = []
        for h in TIME_STEPS:
            sim = Simulator(self.mechanism, time_step=h)
            scenes.append(CostScene(f"{1e3 * h:g} ms", sim, sim.start(q, v)))
        measured: list[Cost] = []
        with threads(1):
            for batch in progress([(self.mechanism.name, scenes)], "timing"):
                measured = costs(batch, 15 if self.quick else 100)
        _tabulate(report, measured)
        report.figure = _figure(self.mechanism.name, measured)
        return report


def _tabulate(report: Report, measured: Sequence[Cost]) -> None:
    """A row and a line of the table per time step."""
    lines: list[list[Cell]] = []
    for h, cost in zip(TIME_STEPS, measured, strict=True):
        step, gradient = median_us(cost.step), median_us(cost.gradient)
        speed = 1e6 * h / step
        lines.append([cost.name, round(cost.iterations, 2), step, gradient, speed, cost.message])
        report.rows.append(Row(f"step of {cost.name}", step, "us", note=f"{speed:.3g} times real time"))
        report.rows.append(Row(f"gradient of {cost.name}", gradient, "us"))
    header = ("time step", "iterations", "step us", "gradient us", "times real time", "ended early")
    note = "Gradient: all of d(next state)/d(state, input), without its step."
    report.tables.append(Table("Steps and gradients", header, lines, note))
    report.details["costs"] = [raw_cost(cost) for cost in measured]


def _figure(name: str, measured: Sequence[Cost]) -> Any:
    """A matplotlib Figure: time of a step and of a gradient against the time step."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    steps = [1e3 * h for h in TIME_STEPS]
    axes.plot(steps, [median_us(cost.step) for cost in measured], "o-", label="step")
    axes.plot(steps, [median_us(cost.gradient) for cost in measured], "s--", label="gradient")
    axes.set(xscale="log", xlabel="time step [ms]", ylabel="processor time [us]", title=name)
    axes.set_xticks(steps, [f"{h:g}" for h in steps])
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend()
    return figure
