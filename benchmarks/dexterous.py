"""Dexterous manipulation by contact-implicit MPC: the given trials of Jin (arXiv 2408.07855), beside its figures.

    NUMBA_NUM_THREADS=1 python benchmarks/dexterous.py [CASE ...] [--trials N] [--plant ours|mujoco] [--keep DIR]
        [--hulls FILE]

Objects, starts, goals, success and budgets are those of the publication, which has 20 trials per case; on two plants:
ours, at 2 ms with kappa 1e-8, and MuJoCo's, where it is installed, with its default contacts, but for the Allegro hand
an elliptic cone and an impratio of 10, as in the publication. What differs is in
`help(dojo.tasks.jin.TASK)`. A successful run ends when the object has been at its goal for 20 ticks; errors are those
at its end, and their means those over successful runs, as a failed run can end anywhere. Published are 96.5 % of
success, 11 degrees and 7.8 mm as means over all hands and objects, and 50 to 100 Hz on an Apple M2 Pro. Ticks are timed
by the processor, on one core. Where the place does not count, as with the Allegro hand, an object may lie on the palm
below its goal: "sideways" is the distance without the height.
With --hulls, objects of the Allegro hand are the convex hulls of points of their meshes: FILE is JSON, and has under
"allegro/OBJECT" the "hull_points". Without, those that are neither cube, can, foam brick, stick nor torus are boxes and
cylinders of their sizes.
"""

from __future__ import annotations

import argparse
import json
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from command import deliver, number, parser, progress
from kept import Kept, KeptRun, add_keep, tick_times

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.tasks.jin.palm_objects import OBJECTS

CASES = {
    f"fingertips_{item}_{motion}".replace(" ", "_").replace("-", "_"): ("fingertips", (item, motion))
    for item, motion in (
        ("cube", "rotation"),
        ("cube", "flip"),
        ("cube", "in-air"),
        ("foam brick", "rotation"),
        ("foam brick", "flip"),
        ("foam brick", "in-air"),
        ("stick", "flip"),
    )
} | {"trifinger_cube": ("trifinger", ("cube",))}
CASES |= {f"allegro_{item}".replace(" ", "_"): ("allegro", (item,)) for item in OBJECTS}
LUMPS = tuple(item for item in OBJECTS if item not in ("cube", "can", "foam brick", "stick", "torus"))
TRIALS = 20
SUCCESS, ANGLE, DISTANCE, RATE = 96.5, 11.0, 7.8, 50.0  # [%], [deg], [mm], [Hz] of the publication
OURS, MUJOCO = "ours, 2 ms, kappa 1e-8", "MuJoCo, default contacts"
FIRM = "MuJoCo, elliptic cone, impratio 10"  # as in the files of the Allegro hand
HEADER = (
    *("case", "succeed", "of", "angle off [deg]", "off [mm]", "time [s]", "tick [ms]", "99 % [ms]", "fell back"),
    *("of ticks", "penetration [mm]", "other ends", "sideways [mm]"),
)
QUICK = 0.2  # [s] of a run that only checks that it runs


def plant_of(task: Any, kind: str) -> Any:
    """The plant of a task."""
    if kind == OURS:
        return task.plant()
    from benchmarks.engines.mujoco_plant import MujocoPlant

    options = {"cone": "elliptic", "impratio": "10"} if kind == FIRM else {}
    return MujocoPlant(task.model, task.initial_state(), **options)


def plants(case: str) -> tuple[str, str]:
    """The plants of a case: ours, and that of MuJoCo with the options of the publication."""
    return OURS, FIRM if CASES[case][0] == "allegro" else MUJOCO


def hulls(file: Path | None) -> dict[str, Any]:
    """Corners of convex hulls by case."""
    if file is None:
        return {}
    rows = json.loads(file.read_text(encoding="utf-8"))
    own = {f"allegro_{item}".replace(" ", "_"): rows.get(f"allegro/{item}".replace(" ", "_")) for item in LUMPS}
    return {case: row["hull_points"] for case, row in own.items() if row is not None}


def line(
    case: str, kind: str, trials: int, seconds: float | None, kept: Kept, hull: Any = None
) -> tuple[list[Cell], list[KeptRun]]:
    """One line of a table, and the runs behind it."""
    family, arguments = CASES[case]
    given = {} if hull is None else {"hull": hull}
    runs = []
    for trial in range(trials):
        task = getattr(dojo.tasks.jin, family)(*arguments, trial=trial, **given)
        runs.append(
            kept.run(f"{case} {kind} {trial}", task, lambda t=task: t.run(plant=plant_of(t, kind), seconds=seconds))
        )
    outcomes = [run.outcome for run in runs]
    good = [outcome["measures"] for outcome in outcomes if outcome["success"]]
    angle, off, sideways = (
        float(np.mean([m[key] for m in good])) if good else np.nan
        for key in ("angle off [deg]", "off [mm]", "sideways [mm]")
    )
    time = float(np.median([m["time [s]"] for m in good])) if good else np.nan
    depth = 1e3 * max(outcome["penetration"] for outcome in outcomes)
    ends = "; ".join(sorted({run.message for run in runs if run.message})[:3])
    counts = sum(outcome["fallbacks"] for outcome in outcomes), sum(run.ticks for run in runs)
    cells: list[Cell] = [case, len(good), trials, angle, off, time, *tick_times(runs), *counts, depth]
    return [*cells, ends, sideways], runs


def run(args: argparse.Namespace) -> Report:
    """The requested cases."""
    report = Report("Dexterous manipulation", "")
    kinds = [OURS] + ([MUJOCO, FIRM] if find_spec("mujoco") is not None else [])
    kinds = {"ours": kinds[:1], "mujoco": kinds[1:]}.get(args.plant, kinds)
    trials, seconds = (1, QUICK) if args.quick else (args.trials, None)
    kept, corners = Kept(None if args.quick else args.keep), hulls(args.hulls)
    for kind in kinds:
        lines, names = [], [case for case in args.cases or CASES if kind in plants(case)]
        for case in progress()([(case, case) for case in names], kind) if names else ():
            cells, runs = line(case, kind, trials, seconds, kept, corners.get(case))
            lines.append(cells)
            report.rows += rows(f"{case}, {kind}", cells, bars=not args.quick)
            report.details[f"{case}, {kind}"] = [run.outcome for run in runs]
        if lines:
            report.tables.append(Table(f"plant: {kind}", HEADER, lines))
    return report


def rows(name: str, cells: list[Cell], bars: bool) -> list[Row]:
    """The numbers of a line, beside the means of the publication."""
    _, succeeded, trials, angle, off, _, tick, late, *_ = cells
    share = 100.0 * float(succeeded or 0) / float(trials or 1)
    return [
        Row(f"{name}: succeed", share, "%", SUCCESS if bars else None, at_least=True),
        number(f"{name}: angle off, mean", float(angle or 0.0), ANGLE if bars else None, unit="deg"),
        number(f"{name}: off, mean", float(off or 0.0), DISTANCE if bars else None, unit="mm"),
        number(f"{name}: tick, median", float(tick or 0.0), 1e3 / RATE if bars else None, unit="ms"),
        number(f"{name}: tick, 99 %", float(late or 0.0), unit="ms"),
    ]


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("cases", nargs="*", metavar="CASE", help="; ".join(CASES))
    arguments.add_argument("--trials", type=int, default=TRIALS, help="the first of them per case")
    arguments.add_argument("--plant", choices=("ours", "mujoco"), help="one of the plants (default: both)")
    arguments.add_argument("--hulls", type=Path, metavar="FILE", help="corners of the convex hulls of objects")
    add_keep(arguments)
    return deliver("dexterous", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
