"""Planar tasks of CRISP (arXiv 2502.01055) as true dynamics: planned from zero inputs, and from random ones.

    NUMBA_NUM_THREADS=1 python benchmarks/crisp.py [--guesses N]

Starts, goals, horizons and weights are those of the publication; `help(dojo.tasks.crisp.TASK)` states what differs in
the model, and the criterion of success. Times are of the processor, the least of five plans from zero inputs. Random
guesses are inputs with a standard deviation of 1 N, or of 1 N m; where inputs only push, their magnitudes. Near guesses
have a ten-thousandth of that: a task that does not succeed from all of them hangs on the last digit.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Row, Table

BAR = 0.5  # [s] of processor time
REPEATS = 5
NEAR = 1e-4  # size of near guesses, over that of random ones
HEADER = (
    "task",
    "knots",
    "success",
    "cost",
    "iterations",
    "time [s]",
    "from near guesses",
    "from random guesses",
    "of",
    "measured at the end",
)


def line(name: str, guesses: int) -> list[Cell]:
    """One line of the table."""
    task = getattr(dojo.tasks.crisp, name)()
    plan, seconds = task.run(), []
    for _ in range(REPEATS):
        begin = time.process_time()
        plan = task.run()
        seconds.append(time.process_time() - begin)
    outcome = task.outcome(plan)
    near, solved = (
        sum(task.outcome(task.run(size * guess(task, seed))).success for seed in range(guesses)) for size in (NEAR, 1.0)
    )
    end = ", ".join(f"{measure} {value:.3g}" for measure, value in outcome.measures.items())
    cells: list[Cell] = [task.name, task.problem.horizon, int(outcome.success), outcome.cost, outcome.iterations]
    return [*cells, min(seconds), near, solved, guesses, end]


def guess(task: Any, seed: int) -> Any:
    """Random inputs, within their limits."""
    inputs = np.random.default_rng(seed).standard_normal((task.problem.horizon, task.problem.sim.nu))
    pushes = [i.limits[0] == 0.0 for i in task.problem.sim.mechanism.inputs]
    return np.where(pushes, np.abs(inputs), inputs)


def run(args: argparse.Namespace) -> Report:
    """All tasks."""
    report = Report("CRISP's planar tasks", "")
    names = dojo.tasks.crisp.__all__
    lines = [line(name, 1 if args.quick else args.guesses) for name in progress()([(n, n) for n in names], "tasks")]
    for cells in lines:
        name, _, success, _, _, seconds, *_ = cells
        report.rows += [
            Row(
                f"{name}: succeeds from zero inputs",
                float(success or 0),
                "",
                None if args.quick else 1.0,
                at_least=True,
            ),
            number(f"{name}: time", float(seconds or 0.0), None if args.quick else BAR, unit="s"),
        ]
    report.tables.append(Table("from zero inputs, one core", HEADER, lines))
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--guesses", type=int, default=10, help="random guesses per task")
    return deliver("crisp", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
