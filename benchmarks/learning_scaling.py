"""From one thread to two: steps of a batch with their derivatives, and epochs of `shac`, by the clock on the wall.

    OPENBLAS_NUM_THREADS=1 python benchmarks/learning_scaling.py

Needs an idle machine with two cores, for a minute or two. Both numbers of threads take turns, round by round, and the
least time of each counts. A batch is that of benchmarks/learning_costs.py, with the cutoff with which the task is
learnt; an epoch has the settings of the task. All that rows do is spread over the threads; the calls from Python, new
starts, random numbers and the sums of an epoch stay on one.

Work is the least processor time of all threads: on two threads it is that on one, and a little more for threads that
wait. The machine is not idle where the ratio of the work is large, or where the time on one thread exceeds its work.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from command import deliver, parser
from learning_costs import KAPPA, ROWS, STEPS, moving

from dojo_opt.learn.registration import task_of
from dojo_opt.report.result import Cell, Report, Row, Table
from solvers.compiler import threads
from solvers.types import Floats

TASKS, BAR = ("HalfCheetah", "Ant"), 1.8
BEFORE, EPOCHS = 20, 5  # epochs before the measured ones, and of a round
COLUMNS = ("one", "two", "ratio", "work, two / one", "work / time, one")


def least(call: Callable[[], Any], rounds: int) -> Floats:
    """(2, 2): on one thread and on two, the least time on the wall and the least processor time [s]."""
    found = np.full((2, 2), np.inf)
    for _ in range(rounds):
        for k in range(2):
            with threads(k + 1):
                began = np.array([time.perf_counter(), time.process_time()])
                call()
                spent = [time.perf_counter(), time.process_time()] - began
                found[k] = np.minimum(found[k], spent)
    return found


def scaled(name: str, rounds: int) -> list[Cell]:
    """A row of the table: us per row of a step and ms of an epoch, on one thread and on two, with their ratios and
    those of their work, two to one, and that of work and time on one.
    """
    h, substeps, _ = STEPS[name]
    task, module = task_of(name), import_module("dojo_opt.learn.shac")
    sim = task.sim.replace(time_step=h, cutoff=task.settings.get("cutoff", 0.0))
    x, inputs, _ = moving(task, sim, substeps)
    step = least(lambda: sim.step_batch(x, inputs, substeps, True, KAPPA), rounds)
    learner = module.ShacTraining(task, module.ShacOptions(**task.settings), 0)
    for _ in range(BEFORE):
        learner.train()

    def epochs() -> None:
        for _ in range(EPOCHS):  # their numbers of steps differ
            learner.train()

    epoch = least(epochs, rounds)
    out: list[Cell] = [name]
    for found, scale in ((step, 1e6 / ROWS), (epoch, 1e3 / EPOCHS)):
        wall, work = found.T
        out += [*map(float, scale * wall), float(wall[0] / wall[1]), float(work[1] / work[0]), float(work[0] / wall[0])]
    return out


def run(args: argparse.Namespace) -> Report:
    """The table."""
    if int(os.environ.get("NUMBA_NUM_THREADS", os.cpu_count() or 1)) < 2:
        raise SystemExit("learning_scaling.py: expected two cores, and two threads for Numba")
    report = Report("Learning on one thread and on two")
    header = ("task", *(f"{what}, {c}" for what in ("step [us]", "epoch [ms]") for c in COLUMNS))
    rows = [scaled(name, 2 if args.quick else 20) for name in TASKS]
    report.tables.append(Table("One thread and two", header, rows))
    bar = None if args.quick else BAR  # two rounds on a busy machine judge nothing
    for row in rows:
        for what, column in (("step with A and B", "step [us], ratio"), ("epoch", "epoch [ms], ratio")):
            report.rows.append(Row(f"{row[0]}, {what}", float(row[header.index(column)]), "times", bar, True))
    return report


def main() -> int:
    """Run and deliver."""
    return deliver("learning_scaling", run, parser(__doc__))


if __name__ == "__main__":
    sys.exit(main())
