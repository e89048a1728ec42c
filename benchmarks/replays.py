"""Replay plans under their own gains with every knot simulated to an accuracy of 1e-5.

    python benchmarks/replays.py         hop, block, trot, jump, leap, and the leap of Atlas
    python benchmarks/replays.py --quick the first two

Each problem is planned twice: as it stands, with its own `refinement`, and with `refined_accuracy=0.03`, which divides
the time steps further until no coordinate of plan and replay is further apart than that at any knot. Columns of both
plans: parts of a time step, iterations of all solves, distance of the bases at the end [m], largest difference of a
coordinate at any knot [m, rad], whether it is within the asked one. The last column is the processor time of a replay.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.planning.problem import REPLAY_ACCURACY
from dojo_opt.planning.refinement import coordinate_error
from dojo_opt.report.result import Cell, Report, Row, Table

ASKED = 0.03  # [m, rad]
PROBLEMS = ("hop", "block", "trot", "jump", "leap", "humanoid_leap")


def compared(problem: dojo.Problem) -> tuple[list[Cell], bool]:
    """(cells of the plan of a problem, whether its replay comes to the end)."""
    plan = dojo.ilqr(problem)
    begin = time.process_time()
    replay = plan.replay(accuracy=REPLAY_ACCURACY)
    seconds = time.process_time() - begin
    ended = replay.status == dojo.Status.SOLVED
    off = float(np.abs(replay.x[-1, :3] - plan.x[-1, :3]).max()) if ended else None
    parts = plan.substeps // problem.substeps
    return [parts, plan.nit, plan.success, off, coordinate_error(plan, replay), 1e3 * seconds], ended


def run(args: argparse.Namespace) -> Report:
    """Every problem, as it stands and with a refinement by accuracy."""
    report = Report("Plans replayed with an accuracy of 1e-5", "")
    lines: list[list[Cell]] = []
    ends, reached = 0, 0
    names = [name for name in PROBLEMS if args.match in name]
    for name in progress()([(name, (name,)) for name in (names[:2] if args.quick else names)], "replays"):
        make = getattr(dojo.problems, name[0])
        before, ended = compared(make())
        asked = make()
        asked.refined_accuracy = ASKED
        after, again = compared(asked)
        ends, reached = ends + ended + again, reached + bool(after[2])
        lines.append([name[0], *before[:2], *before[3:5], *after[:-1], before[-1]])
    report.rows = [
        Row("replayed to the end", ends, f"of {2 * len(lines)}", 2 * len(lines), at_least=True),
        Row("planned to the asked accuracy", reached, f"of {len(lines)}", len(lines), at_least=True),
        number("asked", ASKED, unit="m, rad"),
    ]
    own = ("parts", "iterations", "base off", "coordinates off")
    finer = ("parts then", "iterations then", "within the asked one", "base off then", "coordinates off then")
    report.tables = [Table("Replays", ("", *own, *finer, "replay [ms]"), lines)]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--match", default="", help="only problems with this in their name")
    return deliver("replays", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
