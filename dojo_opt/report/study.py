"""Study: something that measures a toolkit on scenes, or on a user's own mechanism, and says what it found."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Protocol, TextIO, TypeVar

from dojo_opt.report.result import Report, Row
from sim.mechanism.mechanism import Mechanism

Item = TypeVar("Item")

# name -> (what it measures, module, class); in the order of `report all`
STUDIES = {
    "accuracy": ("error against run time of motion without contact", "accuracy", "Accuracy"),
    "contact": ("sliding, sticking, impact and rest against analytic answers", "contact", "Contact"),
    "gradients": ("error and cost of derivatives, of one step and of whole motions", "gradients", "Gradients"),
    "planning": ("cost and violation of plans against run time", "planning", "Planning"),
    "stability": ("stiff and extreme scenes, each with its pass rule", "stability", "Stability"),
    "mechanics": ("joint kinds, pairs of shapes and parameters, each against its bar", "mechanics", "Mechanics"),
    "lean": ("what a scene leaves out, and what that saves", "lean", "Lean"),
    "timing": ("microseconds per step, gradient and planner iteration", "timing", "Timing"),
    "compile": ("seconds from a cold and a warm start to the first plan", "compile_time", "CompileTime"),
}


class Progress:
    """A bar on a terminal, one line per item elsewhere; silent without a stream."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream
        self._start = time.perf_counter()

    def __call__(self, items: Sequence[tuple[str, Item]], label: str) -> Iterator[Item]:
        """The second of every (name, item), the first shown while it is worked on."""
        for k, (name, item) in enumerate(items):
            self._show(label, k, len(items), name)
            yield item
        if self._stream is not None and self._stream.isatty():
            self._stream.write("\r\x1b[K")

    def _show(self, label: str, done: int, count: int, name: str) -> None:
        if self._stream is None:
            return
        seconds = time.perf_counter() - self._start
        if self._stream.isatty():
            filled = 24 * done // count
            self._stream.write(f"\r\x1b[K[{'#' * filled:<24}] {label} {done + 1}/{count} {name} ({seconds:.0f} s)")
        else:
            self._stream.write(f"{seconds:6.1f} s  {label} {done + 1}/{count}: {name}\n")
        self._stream.flush()


class Study(Protocol):
    """What every study can do; a dataclass whose fields are its settings.

    `mechanism` is None for the reference scenes of the study; studies that make sense for one mechanism take it.
    """

    quick: bool  # fewer and shorter scenes: a check that it runs

    def run(self, progress: Progress) -> Report:
        """Measure."""
        ...


def study(name: str, *, quick: bool = False, mechanism: Mechanism | None = None) -> Study:
    """The study of that name.  ValueError: no such study, or it does not take a mechanism."""
    if name not in STUDIES:
        raise ValueError(f"report: no report {name!r}; there are {', '.join(STUDIES)}")
    _, module, kind = STUDIES[name]
    make = getattr(import_module(f"dojo_opt.report.{module}"), kind)
    if mechanism is None:
        return make(quick=quick)
    if "mechanism" not in make.__dataclass_fields__:
        raise ValueError(f"report: {name} has scenes of its own, and takes no mechanism")
    return make(quick=quick, mechanism=mechanism)


def run_report(name: str, *, quick: bool = False, mechanism: Mechanism | None = None, verbose: bool = False) -> Report:
    """Run the study of that name; verbose shows a progress bar on stderr."""
    return study(name, quick=quick, mechanism=mechanism).run(Progress(sys.stderr if verbose else None))


def run_reports(
    names: Sequence[str], *, quick: bool = False, mechanism: Mechanism | None = None, verbose: bool = False
) -> dict[str, Report]:
    """The studies of those names; of several, one that ends with an error is a report that says so.

    Its only bar is missed, and its details have the "error". A single study raises it.
    """
    reports: dict[str, Report] = {}
    for name in names:
        try:
            reports[name] = run_report(name, quick=quick, mechanism=mechanism, verbose=verbose)
        except Exception as error:
            if len(names) == 1:
                raise
            reports[name] = Report(STUDIES[name][0], f"dojo-opt report {name}")
            reason = f"{type(error).__name__}: {error}"
            reports[name].details["error"] = reason
            reports[name].rows = [Row("run to its end", 0.0, "", 1.0, at_least=True, note=reason)]
    return reports
