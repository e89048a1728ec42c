"""Contact-implicit MPC on published task suites: successes, tick times and penetration, beside the published rates.

    NUMBA_NUM_THREADS=1 python benchmarks/mpc_suites.py [TASK ...] [--runs N] [--first SEED] [--plant PLANT]
        [--smoothing]

Tasks are those of IDTO (arXiv 2309.01813): costs, horizons, rates and the delay of one tick are theirs, contact is
ours. `free_gait` is the quadruped of `tasks.free_gait_mpc` at .3 m/s, with the horizon and rate of arXiv 2312.08961;
`free_gait_disturbed` and `free_gait_fast` have it walk at .3 and .6 m/s on slopes up to .1 rad that it does not know,
with payloads up to 1 kg and friction from .4 to .8, and push it by 8 N s.
With --smoothing the tasks of IDTO run with three kinds of smoothing of the derivatives: that of the rollouts, a larger
one at all knots, and one that grows along the horizon to the larger one. The larger one is that of the task, or ten
times that of the rollouts.
Every task runs from its start and from N perturbed ones, on two plants: ours, at 1 ms with kappa 1e-8, and
MuJoCo's with its default contacts, where it is installed. Hills are cylinders in MuJoCo, as in the publication: feet
that sink into a height field touch the sides of its prisms, which brake them. Measured here: everything but the rates.
The publication replans at these on four threads, and gives no rates of success: `help(TASK)` states each criterion.
Ticks are timed by the processor, on one core.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.mpc.settings import OPTIONS
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.plant.tick import milliseconds
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.tasks.idto.mini_cheetah import with_cylinders
from dojo_opt.tasks.suite import SuiteTask

SPEEDS = {"free_gait": 0.3, "free_gait_disturbed": 0.3, "free_gait_fast": 0.6}  # [m/s] of the quadruped
TASKS = (*dojo.tasks.idto.__all__, *SPEEDS)
OFF = 0.1  # [m/s] how far off its mean speed may be over the last half of a run
DISTURBED = tuple(SPEEDS)[1:]
DISTURBANCES: dict[str, Any] = {"push": (8.0, 8.0), "push_time": (3.0, 6.0), "payload": (0.0, 1.0)}
DISTURBANCES |= {"friction": (0.4, 0.8), "slope": (0.0, 0.1)}
OURS, MUJOCO = "ours, 1 ms, kappa 1e-8", "MuJoCo, default contacts"
FIRM = "MuJoCo, elliptic cone, impratio 10"  # its friction yields less than by default
PLANTS = {"ours": OURS, "mujoco": MUJOCO, "firm": FIRM}
HEADER = (
    *("task", "succeed", "of", "replans at [Hz]", "allowed [ms]", "tick [ms]", "99 % [ms]", "fell back", "of ticks"),
    *("penetration [mm]", "measured in the first run", "other ends"),
)
SMOOTHINGS = {"as in rollouts": (False, 1), "larger": (True, 1), "growing": (True, 4)}  # larger or not; blocks of knots
QUICK = 0.2  # [s] of a run that only checks that it runs


def made(name: str, smoothing: str | None = None) -> SuiteTask:
    """A task by its name, as it is or with another smoothing of its derivatives."""
    if name not in SPEEDS:
        build: Callable[..., SuiteTask] = getattr(dojo.tasks.idto, name)
        task = build()
        if smoothing is None:
            return task
        (larger, blocks), own = SMOOTHINGS[smoothing], task.mpc.settings
        kappa = own.kappa_grad or 10.0 * own.kappa
        options = replace(own.options or OPTIONS, kappa_blocks=blocks)
        return build(kappa_grad=kappa if larger else None, options=options)
    mpc = dojo.tasks.free_gait_mpc((SPEEDS[name], 0.0, 0.0))
    spread = np.concatenate([np.full(6, 0.05), np.full(12, 0.1), np.full(18, 0.1)])
    model = mpc.nominal.replace(time_step=1e-3, kappa=1e-8)
    return SuiteTask(name, mpc, model, mpc.start, 10.0, spread, partial(walked, SPEEDS[name]), 40.0, rise=2)


def walked(wanted: float, loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    """Whether a quadruped walks at the speed that it was asked for."""
    half = len(loop.x) // 2
    speed = float(loop.x[-1, 0] - loop.x[half, 0]) / ((len(loop.x) - 1 - half) * loop.simulator.time_step)
    return abs(speed - wanted) < OFF, {"speed [m/s]": speed}


def starts(task: Any, kind: str, perturbed: range) -> list[Any]:
    """The plant of the given start, and of the perturbed ones of these seeds."""
    seeds: list[int | None] = [None, *perturbed]
    if task.name in DISTURBED:
        sampler = dojo.Disturbances(task.model.nv, **DISTURBANCES)
        return [task.plant().perturbed(sampler(np.random.default_rng(seed))) for seed in perturbed]
    if kind == OURS:
        return [task.plant(seed) for seed in seeds]
    from benchmarks.engines.mujoco_plant import MujocoPlant

    options = {"cone": "elliptic", "impratio": "10"} if kind == FIRM else {}
    model = task.model
    if task.name == "idto.mini_cheetah_hills":
        model = model.replace(mechanism=with_cylinders(model.mechanism))
    return [MujocoPlant(model, task.initial_state(seed), **options) for seed in seeds]


def line(task: Any, kind: str, perturbed: range, seconds: float | None) -> tuple[list[Cell], list[Any]]:
    """One line of a table, and the outcomes behind it."""
    loops = [task.run(plant=plant, seconds=seconds) for plant in starts(task, kind, perturbed)]
    outcomes = [task.outcome(loop) for loop in loops]
    cpu = np.concatenate([milliseconds(loop.log, cpu=True) for loop in loops])
    times = [float(np.median(cpu)), float(np.percentile(cpu, 99))] if cpu.size else [np.nan, np.nan]
    fallbacks, ticks = sum(o.fallbacks for o in outcomes), sum(len(loop.log) for loop in loops)
    depth = 1e3 * max(o.penetration for o in outcomes)
    first = ", ".join(f"{name} {value:.3g}" for name, value in outcomes[0].measures.items())
    ends = "; ".join(sorted({loop.message for loop in loops if not loop.survived})[:3])
    succeeded = sum(o.success for o in outcomes)
    cells: list[Cell] = [task.name, succeeded, len(loops), task.rate, 1e3 / task.rate, *times, fallbacks, ticks, depth]
    return [*cells, first, ends], outcomes


def run(args: argparse.Namespace) -> Report:
    """The requested tasks."""
    report = Report("MPC on published suites", "")
    kinds = [PLANTS[args.plant]] if args.plant else [OURS] + ([MUJOCO] if find_spec("mujoco") is not None else [])
    runs, seconds = (1, QUICK) if args.quick else (args.runs, None)
    perturbed = range(args.first, args.first + runs)
    smoothings = SMOOTHINGS if args.smoothing else (None,)
    for kind in kinds:
        names = [name for name in args.tasks if kind == OURS or name not in DISTURBED]  # only our plant is perturbed
        names = [name for name in names if not args.smoothing or name not in SPEEDS]
        for smoothing in smoothings if names else ():
            lines, said = [], f", derivatives {smoothing}" if smoothing else ""
            for name in progress()([(n, n) for n in names], kind + said):
                task = made(name, smoothing)
                cells, outcomes = line(task, kind, perturbed, seconds)
                lines.append(cells)
                report.rows += rows(f"{name}, {kind}{said}", cells, task.rate, bars=not (args.quick or args.smoothing))
                report.details[f"{name}, {kind}{said}"] = [outcome._asdict() for outcome in outcomes]
            report.tables.append(Table(f"plant: {kind}{said}", HEADER, lines))
    report.notes.append("Rates are those of the publication, on four threads; all else was measured here, on one core.")
    return report


def rows(name: str, cells: list[Cell], rate: float, bars: bool) -> list[Row]:
    """The numbers of a line: nine of ten runs have to succeed, and a tick has to fit into its period."""
    _, succeeded, runs, _, _, tick, late, _, _, depth, *_ = cells
    least = int(np.ceil(0.9 * float(runs or 0))) if bars else None
    return [
        Row(f"{name}: succeed", float(succeeded or 0), f"of {runs}", least, at_least=True),
        number(f"{name}: tick, median", float(tick or 0.0), 1e3 / rate if bars else None, unit="ms"),
        number(f"{name}: tick, 99 %", float(late or 0.0), unit="ms"),
        number(f"{name}: penetration", float(depth or 0.0), 0.1 if bars and OURS in name else None, unit="mm"),
    ]


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("tasks", nargs="*", default=list(TASKS), metavar="TASK", help=", ".join(TASKS))
    arguments.add_argument("--runs", type=int, default=10, help="perturbed starts per task")
    arguments.add_argument("--first", type=int, default=0, help="seed of the first perturbed start")
    arguments.add_argument("--plant", choices=PLANTS, help="one plant only (default: ours and mujoco)")
    arguments.add_argument("--smoothing", action="store_true", help="compare three kinds of smoothing of derivatives")
    return deliver("mpc_suites", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
