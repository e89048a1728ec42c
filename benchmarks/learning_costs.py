"""The cost of learning with gradients: steps of a batch with their derivatives, and the parts of an epoch of `shac`.

    NUMBA_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/learning_costs.py

Tasks of Gymnasium, 64 rows that move under random actions, processor time per row and action: the least of some rounds
taken in turns. Rows start from their states alone, or from the impulses of their last steps. Contacts beyond the cutoff
with which the task is learnt are far, but in one column. An epoch: the means over the later epochs of a run with the
settings of the task. Memory: the most that the process has had; where it compiles
kernels, more than a third of that is the compiler's, so run it twice.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np
from command import deliver, parser

import dojo_opt as dojo
from dojo_opt.learn.policy_rollout import PolicyRollout
from dojo_opt.learn.randomization import RowMotion
from dojo_opt.learn.registration import task_of
from dojo_opt.learn.task import Task
from dojo_opt.report.interleaved_rounds import interleave
from dojo_opt.report.result import Cell, Report, Row, Table
from solvers.types import Floats

ROWS, BEFORE, KAPPA = 64, 60, 1e-3  # actions before the measured one, smoothing [N s m]
STEPS = {
    "HalfCheetah": (0.025, 2, 35.0),
    "Ant": (0.025, 2, 45.0),
    "Hopper": (0.004, 2, None),
    "Walker2d": (0.004, 2, None),
}
PARTS = (
    "simulation", "models", "observations and actions", "rewards", "gradient of the return", "critic", "values", "all",
)  # fmt: skip


def moving(task: Task, sim: dojo.Simulator, substeps: int) -> tuple[Floats, Floats, Any]:
    """States of rows that move under random actions, their next inputs, and the impulses that led there."""
    rng = np.random.default_rng(0)
    x, impulses = task.starts([rng] * ROWS), sim.row_impulses(ROWS)
    for _ in range(BEFORE):
        inputs = task.inputs(np.tanh(rng.standard_normal((ROWS, sim.nu))))
        x = sim.step_batch(x, inputs, substeps, kappa=KAPPA, impulses=impulses).x
    return x, task.inputs(np.tanh(rng.standard_normal((ROWS, sim.nu)))), impulses


def stepped(name: str, rounds: int) -> list[Cell]:
    """A row of the steps: task, time step, substeps, cutoff, us per row and action in three ways, and of the last one
    without a cutoff and those that Python takes; iterations in two.
    """
    h, substeps, _ = STEPS[name]
    task = task_of(name)
    whole, cutoff = task.sim.replace(time_step=h), task.settings.get("cutoff", 0.0)
    near = whole.replace(cutoff=cutoff)
    x, inputs, impulses = moving(task, whole, substeps)
    every = np.arange(ROWS)

    def step(derivatives: bool, known: bool, count: int = substeps, sim: dojo.Simulator = near) -> Any:
        kept = impulses.of_rows(every) if known else None  # a copy: the same start in every round
        return sim.step_batch(x, inputs, count, derivatives, KAPPA, impulses=kept)

    seconds = interleave(
        {
            "step": lambda: step(False, False),
            "derivatives": lambda: step(True, False),
            "known": lambda: step(True, True),
            "whole": lambda: step(True, True, sim=whole),
        },
        rounds,
    )
    costs = [1e6 * float(seconds[kind].min()) / ROWS for kind in ("step", "derivatives", "known", "whole")]
    iterations = [float(step(False, known, 1).iterations.mean()) for known in (False, True)]
    return [name, h, substeps, cutoff, *costs, _outside(lambda: step(True, True), rounds), *iterations]


def _outside(step: Callable[[], Any], rounds: int) -> float:
    """us per row of a step with derivatives that are not in the compiled loop: checks, tables, results; the least."""
    found = []
    for _ in range(rounds):
        spent, began = {"loop": 0.0}, time.process_time()
        with clocked(spent, (import_module("sim.simulator.step_batch"), "linearize_rows", "loop")):
            step()
        found.append(time.process_time() - began - spent["loop"])
    return 1e6 * min(found) / ROWS


@contextmanager
def clocked(spent: dict[str, float], *calls: tuple[Any, str, str]) -> Iterator[None]:
    """Add up the processor time of calls, each an attribute of an object, by the name of a part."""

    def clock(call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def run(*args: Any, **given: Any) -> Any:
            began = time.process_time()
            try:
                return call(*args, **given)
            finally:
                spent[part] += time.process_time() - began

        return run

    own = [(owner, name, getattr(owner, name)) for owner, name, _ in calls]
    for (owner, name, part), (_, _, call) in zip(calls, own, strict=True):
        setattr(owner, name, clock(call, part))
    try:
        yield
    finally:
        for owner, name, call in own:
            setattr(owner, name, call)


def epoch(name: str, epochs: int) -> list[Cell]:
    """A row of the epochs: task, rows, horizon, and ms of the parts."""
    module = import_module("dojo_opt.learn.shac")
    task, spent, marks = task_of(name), dict.fromkeys(PARTS, 0.0), []
    options = module.ShacOptions(**task.settings)
    calls = (
        (RowMotion, "step", "simulation"), (dojo.Simulator, "with_parameters", "models"),
        (PolicyRollout, "act", "observations and actions"), (PolicyRollout, "judge", "rewards"),
        (PolicyRollout, "gradient", "gradient of the return"),
        (module.ShacTraining, "fit_critic", "critic"), (module.ShacTraining, "values", "values"),
    )  # fmt: skip

    def mark(record: dict[str, Any]) -> None:
        marks.append((time.process_time(), dict(spent)))
        if record["epoch"] == epochs:
            raise StopIteration

    with clocked(spent, *calls):
        dojo.learn.shac(task, seed=0, callback=mark, evaluations=1, episodes=1)
    (began, before), (ended, after) = marks[epochs // 2 - 1], marks[-1]
    count = epochs - epochs // 2
    parts = {part: 1e3 * (after[part] - before[part]) / count for part in PARTS}
    parts["all"] = 1e3 * (ended - began) / count
    return [name, options.environments, options.horizon, *(parts[part] for part in PARTS)]


def run(args: argparse.Namespace) -> Report:
    """All tables."""
    rounds, epochs = (2, 4) if args.quick else (20, 80)
    names = args.tasks if not args.quick else args.tasks[:1]
    report = Report("The cost of learning, one core")
    steps = [stepped(name, rounds) for name in names]
    header = (
        "task", "time step [s]", "steps", "cutoff", "step [us]", "with A and B [us]", "from known impulses [us]",
        "without a cutoff [us]", "outside the compiled loop [us]", "iterations of the first step",
        "iterations, known impulses",
    )  # fmt: skip
    report.tables.append(Table(f"An action of {ROWS} rows, per row", header, steps))
    epochs_of = [epoch(name, epochs) for name in names if name in ("HalfCheetah", "Ant")]
    report.tables.append(Table("An epoch of shac [ms]", ("task", "rows", "horizon", *PARTS), epochs_of))
    for row in steps:
        bar = None if args.quick else STEPS[str(row[0])][2]  # two rounds on a busy machine judge nothing
        report.rows.append(Row(f"{row[0]}, step with A and B", min(float(row[5]), float(row[6])), "us", bar))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    report.rows.append(Row("most memory", peak, "MB"))
    return report


def main() -> int:
    """Run and deliver."""
    made = parser(__doc__)
    made.add_argument("--tasks", nargs="+", choices=STEPS, default=list(STEPS))
    return deliver("learning_costs", run, made)


if __name__ == "__main__":
    sys.exit(main())
