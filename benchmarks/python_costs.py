"""Time that Python takes per step beside the compiled code: of a loop of `Simulator.step`, of `Environment.step` of a
planning problem, and of `closed_loop`.

    NUMBA_NUM_THREADS=1 python benchmarks/python_costs.py

Processor time per step, medians of rounds in which all cases take turns, less that of one rollout of the same motion:
of a pendulum, and of a free body, whose height and tilt are asked for at every step. Steps in contact would not do: the
solver begins them differently in a rollout. The controller of the closed loop returns a constant, every tenth step.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from command import deliver, number, parser

import dojo_opt as dojo
from dojo_opt.report.interleaved_rounds import interleave
from dojo_opt.report.result import Cell, Report, Table
from solvers.types import Floats

STEPS, TIME_STEP, ROUNDS = 200, 0.01, 60
MOST = {"Simulator.step": 12.0, "Environment.step": 12.0, "closed_loop": 12.0}  # [us]


def scenes() -> dict[str, tuple[dojo.Simulator, Floats]]:
    """Simulators with their first states."""
    body, joint = dojo.Body("body", 1.0, (0.1, 0.2, 0.3)), dojo.Joint("floating", None, "body")
    push = dojo.Input(body="body", force=(1.0, 0.0, 0.0))
    free = dojo.Mechanism([body], [joint], inputs=[push], gravity=(0.0, 0.0, 0.0))
    found = {}
    for name, model in (("pendulum", dojo.models.pendulum()), ("free body", free)):
        sim = dojo.Simulator(model, time_step=TIME_STEP)
        x = sim.neutral()
        if sim.nq > 1:
            x[2] = 1.0
        found[name] = sim, x
    return found


def cases(sim: dojo.Simulator, x: Floats) -> dict[str, Callable[[], Any]]:
    """Ways to take the steps of the same motion."""
    u, us = np.zeros(sim.nu), np.zeros((STEPS, sim.nu))
    cost = [dojo.cost.Tracking(x, 1.0), dojo.cost.Effort(0.1)]
    env = dojo.Environment(dojo.Problem(sim, x, STEPS + 1, cost=cost))
    plant = dojo.Plant(sim, start=x)

    def steps() -> None:
        y = x
        for _ in range(STEPS):
            y = sim.step(y, u).x

    def actions() -> None:
        env.reset()
        for _ in range(STEPS):
            env.step(u)

    def loop() -> None:
        dojo.closed_loop(lambda t, x: u, plant, STEPS * TIME_STEP, control_step=10 * TIME_STEP)

    return {
        "rollout": lambda: sim.rollout(x, us),
        "Simulator.step": steps,
        "Environment.step": actions,
        "closed_loop": loop,
    }


def run(args: argparse.Namespace) -> Report:
    """The time of each way in each scene."""
    report = Report("Python beside the compiled steps", "")
    lines: list[list[Cell]] = []
    for name, (sim, x) in scenes().items():
        seconds = interleave(cases(sim, x), 5 if args.quick else ROUNDS)
        each = {case: 1e6 * float(np.median(spent)) / STEPS for case, spent in seconds.items()}
        compiled = each.pop("rollout")
        lines.append([name, compiled, *(total - compiled for total in each.values())])
        for case, total in each.items():
            bar = None if args.quick else MOST[case]
            report.rows.append(number(f"{case}, {name} [us of Python]", total - compiled, bar))
    header = ("", "rollout", *MOST)
    report.tables = [Table("us per step; of the last three, Python alone", header, lines)]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    return deliver("python_costs", run, parser(__doc__), argv)


if __name__ == "__main__":
    sys.exit(main())
