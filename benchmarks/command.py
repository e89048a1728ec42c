"""Common code of the benchmarks: the command line, and the output of the Report that each of them makes.

python benchmarks/NAME.py                print it, progress on stderr
python benchmarks/NAME.py --out DIR      write DIR/NAME.json, in the format of `benchmarks/compare.py` for one study
python benchmarks/NAME.py --json         print that instead
python benchmarks/NAME.py --quick        a check that it runs
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from dojo_opt.report.result import Report, Row
from dojo_opt.report.study import Progress

# the package of the other engines, and scenes that tests and benchmarks share; appended last, so that an installed
# dojo_opt is the one measured
sys.path.append(str(Path(__file__).resolve().parents[1]))
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))

__all__ = ["deliver", "number", "parser", "progress"]


def parser(description: str | None) -> argparse.ArgumentParser:
    """A parser with the arguments of every benchmark, and the text of its file as help."""
    made = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--quick", action="store_true", help="fewer and shorter cases: a check that it runs")
    made.add_argument("--json", action="store_true", help="print every number as JSON instead of the tables")
    made.add_argument("--out", type=Path, metavar="DIR", help="write every number to DIR, as JSON")
    return made


def progress() -> Progress:
    """Progress of the run, on stderr."""
    return Progress(sys.stderr)


def deliver(
    name: str,
    run: Callable[[argparse.Namespace], Report],
    parser: argparse.ArgumentParser,
    argv: Sequence[str] | None = None,
) -> int:
    """Run a benchmark, print or write its report; the exit status, 1 if a bar was missed."""
    given = list(sys.argv[1:] if argv is None else argv)
    args = parser.parse_args(given)
    if args.out:
        args.out.mkdir(parents=True, exist_ok=True)  # fails now, not after the work
    report = run(args)
    report.command = " ".join([*_threads(), f"python benchmarks/{name}.py", *_settings(given)])
    print(report.as_json() if args.json else report.as_text())
    if args.out:
        (args.out / f"{name}.json").write_text(report.as_json() + "\n", encoding="utf-8")
    return 0 if report.met() else 1


def number(name: str, value: float, bar: float | None = None, *, unit: str = "", note: str = "") -> Row:
    """A row; its bar, if any, is the largest value that passes."""
    return Row(name, value, unit, bar, note=note)


def _threads() -> list[str]:
    count = os.environ.get("NUMBA_NUM_THREADS")
    return [f"NUMBA_NUM_THREADS={count}"] if count else []


def _settings(given: Sequence[str]) -> list[str]:
    """The arguments of the measurement, without those of the output."""
    kept: list[str] = []
    words = iter(given)
    for word in words:
        if word in ("--out", "--keep"):
            next(words)
        elif word != "--json" and not word.startswith(("--out=", "--keep=")):
            kept.append(word)
    return kept
