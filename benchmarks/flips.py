"""Backflips of a quadruped from rest and a goal: iterations, and the landing replayed at an accuracy of 1e-5.

    python benchmarks/flips.py           16 flips, two minutes
    python benchmarks/flips.py --quick   one of them

`problems.backflip` plans each from one guess, without a reference gait or a contact schedule; references are poses of
the base alone. A flip is planned if the plan converges and meets its constraints, the pose of the base in the last
tenth of a second. It lands if the plan replayed with `accuracy=1e-5`, under its own gains, ends within 1 cm of the
plan, its trunk upright to a cosine of .99, and no speed above .5 m/s or rad/s. Times are of the processor.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import product
from typing import Any

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.planning.problem import REPLAY_ACCURACY
from dojo_opt.report.result import Cell, Report, Row, Table

DISTANCES, HEIGHTS = (-0.3, -0.2, -0.1, 0.0), (0.3, 0.35, 0.4, 0.45)  # [m]
NEAR, UPRIGHT, SLOW = 0.01, 0.99, 0.5  # at its end: [m] off, least cosine, largest speed [m/s, rad/s]
HEADER = (
    *("far [m]", "high [m]", "planned", "iterations", "processor [s]", "turned [rad]", "rise [m]"),
    *("largest torque [N m]", "replayed", "off [m]", "upright", "speed", "lands"),
)


def flip(distance: float, height: float) -> list[Cell]:
    """A row of the table."""
    problem = dojo.problems.backflip(distance=distance, height=height)
    begin = time.process_time()
    plan = dojo.ilqr(problem)
    seconds = time.process_time() - begin
    angle = np.unwrap(2.0 * np.arctan2(plan.x[:, 5], plan.x[:, 3]))
    rise, torque = float(plan.x[:, 2].max() - plan.x[0, 2]), float(np.abs(plan.u).max())
    shot: Any = plan.replay(accuracy=REPLAY_ACCURACY)
    end = shot.x[-1]
    off = float(np.abs(end[:3] - plan.x[-1, :3]).max())
    cosine = float(1.0 - 2.0 * (end[4] ** 2 + end[5] ** 2))
    speed = float(np.abs(end[problem.sim.nq :]).max())
    lands = bool(plan.success and shot.success and off < NEAR and cosine > UPRIGHT and speed < SLOW)
    cells: list[Cell] = [distance, height, bool(plan.success), plan.nit, seconds, float(angle[-1] - angle[0]), rise]
    return [*cells, torque, "to the end" if shot.success else shot.status.name, off, cosine, speed, lands]


def run(args: argparse.Namespace) -> Report:
    """All flips."""
    report = Report("Backflips of a quadruped", "")
    grid = list(product(DISTANCES, HEIGHTS))
    asked = [(-0.2, 0.4)] if args.quick else grid
    lines = [
        flip(*pair) for pair in progress()([(f"{far} m far, {high} m high", (far, high)) for far, high in asked], "")
    ]
    report.tables.append(Table("Backflips", HEADER, lines))
    landed = [line for line in lines if line[-1]]
    report.rows += [
        number("backflips", len(lines)),
        number("backflips planned", sum(bool(line[2]) for line in lines)),
        Row("backflips planned that land", len(landed), "", sum(bool(line[2]) for line in lines), at_least=True),
        number(
            "backflips that land: off, most", max((float(line[9] or 0.0) for line in landed), default=np.nan), unit="m"
        ),
        number(
            "backflips that land: speed at the end, most",
            max((float(line[11] or 0.0) for line in landed), default=np.nan),
        ),
        number(
            "backflips that land: iterations, median", float(np.median([int(line[3] or 0) for line in landed] or [0]))
        ),
        number(
            "backflips that land: processor time, median",
            float(np.median([float(line[4] or 0.0) for line in landed] or [0.0])),
            unit="s",
        ),
    ]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    return deliver("flips", run, parser(__doc__), argv)


if __name__ == "__main__":
    sys.exit(main())
