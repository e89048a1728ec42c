"""Kept: runs of a benchmark that are written down as they end, so that a benchmark that was stopped can go on."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.plant.tick import milliseconds
from dojo_opt.tasks.suite import SuiteTask
from sim.io.json_text import json_text
from solvers.compiler import stamp

__all__ = ["Kept", "KeptRun", "add_keep", "tick_times"]


class KeptRun(NamedTuple):
    """How a run of a task ended.

    Attributes:
        outcome: fields of its TaskOutcome.
        ticks_ms: processor times of its ticks but the first [ms].
        ticks: number of its ticks.
        message: its end as a sentence, if it ended before its time without its aim; otherwise empty.
    """

    outcome: dict[str, Any]
    ticks_ms: list[float]
    ticks: int
    message: str


class Kept:
    """Runs by their names, each in a file of its own.

    Args:
        folder: where they are written, and taken from instead of being run again; None for neither.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)

    def run(self, name: str, task: SuiteTask, start: Callable[[], ClosedLoop]) -> KeptRun:
        """A run, from its file if there is one of the same kernels."""
        file = None if self._folder is None else self._folder / f"{name}.json".replace(" ", "_").replace(",", "")
        if file is not None and file.exists():
            kept = json.loads(file.read_text(encoding="utf-8"))
            if kept.pop("kernels", "") == stamp():
                return KeptRun(**kept)
        loop = start()
        times = milliseconds(loop.log, cpu=True).tolist()
        made = KeptRun(task.outcome(loop)._asdict(), times, len(loop.log), "" if loop.survived else loop.message)
        if file is not None:
            file.write_text(json_text({"kernels": stamp(), **made._asdict()}), encoding="utf-8")
        return made


def add_keep(arguments: argparse.ArgumentParser) -> None:
    """Add the option for a folder of runs that have ended."""
    text = "keep runs in DIR as they end, and take those of the same kernels from there: a stopped benchmark goes on"
    arguments.add_argument("--keep", type=Path, metavar="DIR", help=text)


def tick_times(runs: list[KeptRun]) -> tuple[float, float]:
    """Median and 99th percentile of the processor times of the ticks of some runs [ms]."""
    times = np.concatenate([run.ticks_ms for run in runs])
    return (float(np.median(times)), float(np.percentile(times, 99))) if times.size else (np.nan, np.nan)
