"""Studies: measurements of a robot, or of scenes, whose results are reports."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING
from importlib import import_module
from typing import Protocol, TextIO, TypeVar

from dojo_opt.report.result import Report, Row
from sim.mechanism.mechanism import Mechanism

Item = TypeVar("Item")

Studies = Mapping[str, tuple[str, str, str]]  # name -> (subject, module, class)

# the studies of one robot, in the order of `report all`
STUDIES: Studies = {
    "accuracy": (
        "error against run time, and the time step and kappa that the robot needs",
        "dojo_opt.report.accuracy",
        "RobotAccuracy",
    ),
    "stability": ("the time steps at which it is stable", "dojo_opt.report.stability", "RobotStability"),
    "gradients": ("error and cost of its derivatives", "dojo_opt.report.gradients", "RobotGradients"),
    "lean": ("omitted terms, and the cost of each feature", "dojo_opt.report.lean", "OmittedTerms"),
    "timing": ("microseconds per step and gradient, by time step", "dojo_opt.report.robot_timing", "RobotTiming"),
}


class Progress:
    """A bar on a terminal, one line per item elsewhere.

    Args:
        stream: text stream to write to (default None: silent).
    """

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


class ReportStudy(Protocol):
    """A study is a dataclass whose fields are its settings: `quick`, for most of them `mechanism`, and others.

    Attributes:
        quick: whether scenes are fewer and shorter, as a check that the study runs.
    """

    quick: bool

    def run(self, progress: Progress) -> Report:
        """Measure.

        Args:
            progress: display of the progress.

        Returns:
            The report.
        """
        ...


def study(
    name: str,
    *,
    quick: bool = False,
    mechanism: Mechanism | None = None,
    cold: bool = False,
    studies: Studies = STUDIES,
) -> ReportStudy:
    """Make a study.

    Args:
        name: key of `studies`.
        quick: whether scenes are fewer and shorter.
        mechanism: robot to measure (default None: the scenes of the study, or, in a study of one robot, the quadruped).
        cold: whether a study that measures cold starts on request does so.
        studies: known studies (default: those of one robot).

    Returns:
        The study; its `run` measures.

    Raises:
        ValueError: the study does not exist, or does not take a mechanism.
    """
    if name not in studies:
        raise ValueError(f"report: no report {name!r}; there are {', '.join(studies)}")
    _, module, kind = studies[name]
    make = getattr(import_module(module), kind)
    field = make.__dataclass_fields__.get("mechanism")
    settings = {"cold": True} if cold and "cold" in make.__dataclass_fields__ else {}
    if field is None:
        if mechanism is not None:
            raise ValueError(f"report: {name} has its own scenes and takes no mechanism")
        return make(quick=quick, **settings)
    if mechanism is None and field.default is MISSING:
        mechanism = import_module("dojo_opt.models").quadruped()
    return make(quick=quick, mechanism=mechanism, **settings)


def run_report(
    name: str,
    *,
    quick: bool = False,
    mechanism: Mechanism | None = None,
    cold: bool = False,
    verbose: bool = False,
    studies: Studies = STUDIES,
) -> Report:
    """Run one study.

    Args:
        name: key of `studies`.
        quick: whether scenes are fewer and shorter.
        mechanism: robot to measure (default None: as in `study`).
        cold: whether to measure cold starts, as in `study`.
        verbose: whether to show a progress bar on stderr.
        studies: known studies (default: those of one robot).

    Returns:
        The report.

    Raises:
        ValueError: the study does not exist, or does not take a mechanism.
    """
    made = study(name, quick=quick, mechanism=mechanism, cold=cold, studies=studies)
    report = made.run(Progress(sys.stderr if verbose else None))
    report.command = f"dojo-opt report {name}{' --cold' * cold}{' --quick' * quick}"  # the command line replaces it
    return report


def run_reports(
    names: Sequence[str],
    *,
    quick: bool = False,
    mechanism: Mechanism | None = None,
    cold: bool = False,
    verbose: bool = False,
    studies: Studies = STUDIES,
) -> dict[str, Report]:
    """Run several studies.

    Args:
        names: keys of `studies`.
        quick: whether scenes are fewer and shorter.
        mechanism: robot to measure (default None: as in `study`).
        cold: whether to measure cold starts, as in `study`.
        verbose: whether to show a progress bar on stderr.
        studies: known studies (default: those of one robot).

    Returns:
        The reports by name. If one of several studies fails, its report has the error: its only bar is missed, and its
        details have the "error".

    Raises:
        Exception: whatever a single study raises.
    """
    reports: dict[str, Report] = {}
    for name in names:
        try:
            reports[name] = run_report(
                name, quick=quick, mechanism=mechanism, cold=cold, verbose=verbose, studies=studies
            )
        except Exception as error:
            if len(names) == 1:
                raise
            reports[name] = Report(studies[name][0])
            reason = f"{type(error).__name__}: {error}"
            reports[name].details["error"] = reason
            reports[name].rows = [Row("run to its end", 0.0, "", 1.0, at_least=True, note=reason)]
    return reports
