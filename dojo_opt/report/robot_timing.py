"""Microseconds per step and gradient of a robot, by time step, and in multiples of real time.

The time of a gradient is the extra time of `Simulator.linearize_rollout` over `rollout`: it differentiates every step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dojo_opt.report.accuracy.starting_pose import start
from dojo_opt.report.interleaved_rounds import interleave
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.step_cost import median_us
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.compiler import threads

TIME_STEPS = (1e-3, 2e-3, 5e-3, 1e-2, 2e-2)  # [s]
STEPS = 50  # per call


@dataclass(frozen=True)
class RobotTiming:
    """Time of steps and gradients of a robot; quick: fewer rounds."""

    mechanism: Mechanism
    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report(f"Time of {self.mechanism.name} on one core")
        report.summary = (
            f"{STEPS} steps from a random start that is always the same, joints without torques, and their derivatives "
            "along the same motion. Times are processor time on one core, medians over interleaved rounds."
        )
        with threads(1):
            for mechanism in progress([(self.mechanism.name, self.mechanism)], "timing"):
                times = _times(mechanism, 15 if self.quick else 100)
        _tabulate(report, times)
        report.figure = _figure(self.mechanism.name, times)
        return report


class StepTime(NamedTuple):
    """The time of a step and of its derivatives at one time step."""

    time_step: float  # [s]
    iterations: float  # of Newton, mean
    step: NDArray[np.float64]  # (rounds,) [s]
    gradient: NDArray[np.float64]  # (rounds,) [s]
    message: str  # why the motion ended early, or nothing


def _times(mechanism: Mechanism, rounds: int) -> list[StepTime]:
    """All time steps, in interleaved rounds; NaN where not even the first step is solved."""
    q, v = start(mechanism)
    cases: dict[str, Callable[[], Any]] = {}
    paths = []
    for h in TIME_STEPS:
        sim = Simulator(mechanism, time_step=h)
        x = sim.state_from_velocity(q, v)
        path = sim.rollout(x, np.zeros((STEPS, sim.nu)))
        paths.append(path)
        if path.solved_steps:
            us = np.zeros((path.solved_steps, sim.nu))
            cases[f"step {h}"] = lambda sim=sim, x=x, us=us: sim.rollout(x, us)  # type: ignore[misc]
            cases[f"both {h}"] = lambda sim=sim, x=x, us=us: sim.linearize_rollout(x, us)  # type: ignore[misc]
    seconds = interleave(cases, rounds)
    nothing = np.full(rounds, np.nan)
    out = []
    for h, path in zip(TIME_STEPS, paths, strict=True):
        step, both = (seconds.get(f"{part} {h}", nothing) / max(path.solved_steps, 1) for part in ("step", "both"))
        iterations = float(np.mean(path.iterations)) if path.solved_steps else float("nan")
        out.append(StepTime(h, iterations, step, both - step, "" if path.success else path.message))
    return out


def _tabulate(report: Report, times: Sequence[StepTime]) -> None:
    """Two rows and a line of the table per time step."""
    lines: list[list[Cell]] = []
    for h, iterations, step_seconds, gradient_seconds, message in times:
        step, gradient, name = median_us(step_seconds), median_us(gradient_seconds), f"{1e3 * h:g} ms"
        speed = 1e6 * h / step
        lines.append([name, round(iterations, 2), step, gradient, speed, message])
        report.rows.append(Row(f"step of {name}", step, "us", note=f"{speed:.3g} times real time"))
        report.rows.append(Row(f"gradient of {name}", gradient, "us"))
    header = ("time step", "iterations", "step us", "gradient us", "times real time", "ended early")
    note = "Gradient: all of d(next state)/d(state, input), without its step."
    report.tables.append(Table("Steps and gradients", header, lines, note))
    report.details["times"] = [time._asdict() for time in times]


def _figure(name: str, times: Sequence[StepTime]) -> Any:
    """A matplotlib Figure: time of a step and of a gradient against the time step."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    steps = [1e3 * h for h in TIME_STEPS]
    axes.plot(steps, [median_us(time.step) for time in times], "o-", label="step")
    axes.plot(steps, [median_us(time.gradient) for time in times], "s--", label="gradient")
    axes.set(xscale="log", xlabel="time step [ms]", ylabel="processor time [us]", title=name)
    axes.set_xticks(steps, [f"{h:g}" for h in steps])
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend()
    return figure
