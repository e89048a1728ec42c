"""Measure the toolkit and the installed engines on reference scenes, and write the results.

    python benchmarks/compare.py all --out DIR            every study
    python benchmarks/compare.py accuracy ROBOT.urdf      a robot, as `dojo-opt report` does, and in other engines too

`pip install "dojo-opt[bench,drake,bullet]"` adds MuJoCo, Drake and PyBullet; `"dojo-opt[crocoddyl]"` a planner.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # to find its own package when run as a program

from dojo_opt.report.command import add_arguments, report  # noqa: E402
from dojo_opt.report.study import Studies  # noqa: E402

_ROOM = "benchmarks.studies"
# name -> (quantity measured, module, class); in the order of `all`
STUDIES: Studies = {
    "accuracy": ("error against run time of motion without contact", f"{_ROOM}.accuracy", "AccuracyStudy"),
    "contact": ("sliding, sticking, impact and rest against analytic answers", f"{_ROOM}.contact", "ContactStudy"),
    "gradients": (
        "error and cost of derivatives, of one step and of whole motions",
        f"{_ROOM}.gradients",
        "GradientsStudy",
    ),
    "planning": ("cost and violation of plans against run time", f"{_ROOM}.planning", "PlanningStudy"),
    "stability": ("stiff and extreme scenes, each with its pass rule", f"{_ROOM}.stability", "StabilityStudy"),
    "mechanics": (
        "joint kinds, pairs of shapes and parameters, each against its bar",
        f"{_ROOM}.mechanics",
        "MechanicsStudy",
    ),
    "lean": ("omitted terms of a scene, and the time that this saves", f"{_ROOM}.lean", "LeanStudy"),
    "timing": (
        "microseconds per step, gradient and planner iteration",
        f"{_ROOM}.timing.timing_study",
        "TimingStudy",
    ),
    "compile": (
        "seconds from a cold and a warm start to the first plan",
        f"{_ROOM}.timing.compile_time",
        "CompileTimeStudy",
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        "benchmarks/compare.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_arguments(parser, STUDIES)
    args = parser.parse_args(arguments)
    try:
        return report(args, STUDIES, ("python", "benchmarks/compare.py"))
    except (ValueError, TypeError, OSError, ImportError) as error:
        print(f"benchmarks/compare.py: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
