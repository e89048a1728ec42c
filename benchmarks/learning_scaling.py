"""From one thread to two: steps of a batch with their derivatives, and epochs of `shac`, by the clock on the wall.

    OPENBLAS_NUM_THREADS=1 python benchmarks/learning_scaling.py

Needs an idle machine with two cores. Both numbers of threads take turns, round by round, and the least time of each
counts. A batch is that of benchmarks/learning_costs.py; an epoch has the settings of the task. Simulation and networks
are spread over the threads; observations, rewards, new starts and the sums of an epoch stay on one.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

from command import deliver, parser
from learning_costs import KAPPA, ROWS, STEPS, moving

from dojo_opt.learn.registration import task_of
from dojo_opt.report.result import Cell, Report, Row, Table
from solvers.compiler import threads

TASKS, BEFORE, BAR = ("HalfCheetah", "Ant"), 20, 1.8  # epochs before the measured ones, ratio


def least(call: Callable[[], Any], rounds: int) -> list[float]:
    """Least time on one thread and on two [s]."""
    found = [float("inf")] * 2
    for _ in range(rounds):
        for k in range(2):
            with threads(k + 1):
                began = time.perf_counter()
                call()
                found[k] = min(found[k], time.perf_counter() - began)
    return found


def scaled(name: str, rounds: int) -> list[Cell]:
    """A row of the table: us per row of a step and ms of an epoch, on one thread and on two, with their ratios."""
    h, substeps, _ = STEPS[name]
    task, module = task_of(name), import_module("dojo_opt.learn.shac")
    sim = task.sim.replace(time_step=h)
    x, inputs, _ = moving(task, sim, substeps)
    step = least(lambda: sim.step_batch(x, inputs, substeps, True, KAPPA), rounds)
    learner = module.ShacTraining(task, module.ShacOptions(**task.settings), 0)
    for _ in range(BEFORE):
        learner.train()

    def epochs() -> None:
        for _ in range(5):  # their numbers of steps differ
            learner.train()

    epoch = least(epochs, rounds)
    per_row, per_epoch = [1e6 * s / ROWS for s in step], [200.0 * s for s in epoch]
    return [name, *per_row, step[0] / step[1], *per_epoch, epoch[0] / epoch[1]]


def run(args: argparse.Namespace) -> Report:
    """The table."""
    if int(os.environ.get("NUMBA_NUM_THREADS", os.cpu_count() or 1)) < 2:
        raise SystemExit("learning_scaling.py: expected two cores, and two threads for Numba")
    report = Report("Learning on one thread and on two")
    header = (
        "task",
        "step, one [us]",
        "step, two [us]",
        "ratio",
        "epoch, one [ms]",
        "epoch, two [ms]",
        "epochs, ratio",
    )
    rows = [scaled(name, 2 if args.quick else 20) for name in TASKS]
    report.tables.append(Table("One thread and two", header, rows))
    bar = None if args.quick else BAR  # two rounds on a busy machine judge nothing
    for row in rows:
        report.rows.append(Row(f"{row[0]}, step with A and B", float(row[3]), "times", bar, True))
        report.rows.append(Row(f"{row[0]}, epoch", float(row[6]), "times", bar, True))
    return report


def main() -> int:
    """Run and deliver."""
    return deliver("learning_scaling", run, parser(__doc__))


if __name__ == "__main__":
    sys.exit(main())
