"""Ctrl-C at random moments, killed processes, damaged caches, forks: count crashes, hangs and late answers.

    python benchmarks/chaos.py                      200 interrupts, 7 kinds of damage, 20 killed processes, forks
    python benchmarks/chaos.py --only signals --interrupts 1000

Interrupts go to one process after another, each of which plans, controls, rolls out, or runs a batch for ever, compiled
before. It has to answer within 0.2 s with a KeyboardInterrupt that carries the finished part, and afterwards to compute
the same as before.
Caches: all files of compiled code are damaged, in seven ways; the next process has to compute the same.
Killed: processes that compile into one cache are killed at random moments, and the next one has to compute the same.
"""

from __future__ import annotations

import argparse
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from chaos_processes import FORKS, LONG, SMALL, Heard, Victim, answer, environment
from command import deliver, number, parser, progress

from dojo_opt.report.result import Report, Table

ANSWER = 0.2  # [s]
COMPILED = {"DOJO_OPT_SHIPPED": "0"}  # code of an installation is no cache
PARTS = ("signals", "caches", "killed", "forks")


def signals(count: int, rng: np.random.Generator) -> list[Heard]:
    """Send `count` interrupts, spread over the calls."""
    found = []
    for k, name in enumerate(progress()([(name, name) for name in LONG], "chaos, signals")):
        victim = Victim(name)
        for _ in range(-(-(count - k) // len(LONG))):
            found.append(victim.interrupt(0.02 + 0.5 * rng.random()))
            if found[-1].outcome in ("crashed", "hung"):
                victim.end()
                victim = Victim(name)
        victim.end()
    return found


def flip(file: Path, rng: np.random.Generator) -> None:
    """Change twenty bytes."""
    data = bytearray(file.read_bytes())
    for place in rng.integers(len(data), size=20):
        data[place] ^= 1 + int(rng.integers(255))
    file.write_bytes(data)


def replace_by_folder(file: Path) -> None:
    """A folder with the name of the file."""
    file.unlink()
    file.mkdir()


UNREADABLE = "unreadable"  # but for root, who reads everything
DAMAGE: dict[str, Callable[[Path, np.random.Generator], object]] = {
    "truncated": lambda file, rng: os.truncate(file, file.stat().st_size // 2),
    "empty": lambda file, rng: os.truncate(file, 0),
    "garbage": lambda file, rng: file.write_bytes(rng.bytes(file.stat().st_size)),
    "bytes flipped": flip,
    "a folder in its place": lambda file, rng: replace_by_folder(file),
    UNREADABLE: lambda file, rng: file.chmod(0),
    "another pickle": lambda file, rng: file.write_bytes(pickle.dumps({"not": "expected"})),
}


def caches(rng: np.random.Generator, kinds: list[str], filled: Filled) -> list[tuple[str, int, str]]:
    """(damage, damaged files, outcome) with every file of compiled code damaged."""
    found = []
    for kind in progress()([(kind, kind) for kind in kinds], "chaos, caches"):
        copy = filled.folder.with_name("copy")
        shutil.copytree(filled.folder, copy)
        files = sorted(copy.rglob("*.nbc"))
        assert files, "nothing was compiled: there is nothing to damage"
        for file in files:
            DAMAGE[kind](file, rng)
        found.append((kind, len(files), filled.compare(copy)))
        subprocess.run(["chmod", "-R", "u+rw", str(copy)], check=False)
        shutil.rmtree(copy)
    return found


def killed(count: int, rng: np.random.Generator, filled: Filled) -> list[str]:
    """The results of processes whose forerunners with the same cache were killed."""
    found = []
    for _ in progress()([(f"kill {k}", k) for k in range(count)], "chaos, killed"):
        cache = filled.folder.with_name("shared")
        pair = [
            subprocess.Popen(
                [sys.executable, "-c", SMALL],
                env=environment(NUMBA_CACHE_DIR=str(cache), **filled.own),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            for _ in range(2)
        ]
        time.sleep(1.0 + 6.0 * rng.random())
        for process in pair:
            process.kill()
            process.wait()
        found.append(filled.compare(cache))
        shutil.rmtree(cache, ignore_errors=True)
    return found


class Filled:
    """A cache that a process has filled, and its results."""

    def __init__(self, folder: Path, quick: bool) -> None:
        """quick: whether code is compiled without optimisation, which takes half the time."""
        self.folder, self.own = folder, COMPILED | ({"NUMBA_OPT": "0"} if quick else {})
        self.expected = answer(SMALL, folder, **self.own)

    def compare(self, cache: Path) -> str:
        """Whether a process with another cache computes the same."""
        said = answer(SMALL, cache, **self.own)
        return "same" if said == self.expected else said or "nothing printed"


def run(args: argparse.Namespace) -> Report:
    """The parts that are asked for."""
    report = Report("Interrupts, killed processes, damaged caches, forks", "")
    rng = np.random.default_rng(args.seed)
    parts = args.only or PARTS
    if "signals" in parts:
        _add_signals(report, signals(12 if args.quick else args.interrupts, rng))
    if {"caches", "killed"} & set(parts):
        with tempfile.TemporaryDirectory() as folder:
            _add_caches(report, parts, args, rng, Filled(Path(folder) / "filled", args.quick))
    if "forks" in parts:
        layers = ("omp", "workqueue")
        outcomes = {layer: _forked(layer) for layer in layers}
        report.rows += [
            number("forked pools, other than the same result", sum(o != "same" for o in outcomes.values()), 0)
        ]
        report.details["forks"] = outcomes
    return report


def _add_caches(
    report: Report, parts: Sequence[str], args: argparse.Namespace, rng: np.random.Generator, filled: Filled
) -> None:
    """The outcome of damaged caches and of processes that were killed while they filled one."""
    if "caches" in parts:
        kinds = [kind for kind in DAMAGE if kind != UNREADABLE or os.geteuid() != 0]
        found = caches(rng, ["truncated"] if args.quick else kinds, filled)
        report.rows += [
            number("damaged caches", len(found)),
            number("damaged caches, other than the same result", sum(said != "same" for *_, said in found), 0),
        ]
        header = ("damage", "damaged files", "the next process")
        report.tables.append(Table("Damaged caches", header, [list(line) for line in found]))
    if "killed" in parts:
        ends = killed(1 if args.quick else args.kills, rng, filled)
        report.rows += [
            number("killed pairs of processes", len(ends)),
            number("killed, other than the same result next", sum(said != "same" for said in ends), 0),
        ]
        report.details["killed"] = ends


def _forked(layer: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_THREADING_LAYER"] = layer
        try:
            return answer(FORKS, Path(folder))
        finally:
            del os.environ["NUMBA_THREADING_LAYER"]


def _add_signals(report: Report, found: list[Heard]) -> None:
    """Counts, and a line per call."""
    lines: list[list[str | int | float]] = []
    for call in LONG:
        mine = [h for h in found if h.call == call]
        times = [h.seconds for h in mine if np.isfinite(h.seconds)] or [np.nan]
        bad = [sum(h.outcome == outcome for h in mine) for outcome in ("crashed", "hung", "different")]
        lines.append(
            [call, len(mine), *bad, float(np.median(times)), max(times), ", ".join(sorted({h.kept for h in mine}))]
        )
    times = [h.seconds for h in found if np.isfinite(h.seconds)] or [np.inf]
    report.rows += [
        number("interrupts", len(found)),
        number("crashed", sum(h.outcome == "crashed" for h in found), 0),
        number("never heard", sum(h.outcome == "hung" for h in found), 0),
        number("other results afterwards", sum(h.outcome == "different" for h in found), 0),
        number("heard, median", float(np.median(times)), unit="s"),
        number("heard, latest", max(times), ANSWER, unit="s"),
    ]
    header = ("call", "interrupts", "crashed", "never heard", "other results", "heard [s]", "latest [s]", "kept")
    report.tables.append(Table("Interrupts", header, lines))


def main(argv: list[str] | None = None) -> int:
    """Print or write the report; exit status 1 if anything crashed, hung, answered late or lied."""
    arguments = parser(__doc__)
    arguments.add_argument("--interrupts", type=int, default=200)
    arguments.add_argument("--kills", type=int, default=20)
    arguments.add_argument("--only", choices=PARTS, action="append", help="only this part (may be repeated)")
    arguments.add_argument("--seed", type=int, default=0)
    return deliver("chaos", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
