"""Cold starts by feature: processor time and functions that a feature adds to the first step of a scene.

    python benchmarks/cold_starts.py             a quarter of an hour
    python benchmarks/cold_starts.py --quick     one feature

`dojo-opt report lean --cold` adds the same table to the report of a robot; here are the bars.
"""

from __future__ import annotations

import argparse
import sys

from command import deliver, number, parser, progress

from dojo_opt.report.lean.cold_starts import add_cold_starts
from dojo_opt.report.result import Report

BARS = {"pendulum": 8.0, "joint limit": 13.0, "body on the ground": 17.0, "two balls that may touch": 16.0}  # [s]


def run(args: argparse.Namespace) -> Report:
    """The table, the worst first, and the bars."""
    report = Report("Cold starts by feature", "")
    found = add_cold_starts(report, progress(), quick=args.quick)
    bars = {} if args.quick else BARS
    report.rows[:0] = [
        number(f"{name}: processor time", found[name].seconds, bar, unit="s") for name, bar in bars.items()
    ]
    return report


if __name__ == "__main__":
    sys.exit(deliver("cold_starts", run, parser(__doc__)))
