"""Report: rows of measured numbers with their bars, as an aligned table or as JSON."""

from __future__ import annotations

import json
import os
import platform
import sys
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Row:
    """One measured number, and the bar it is held against."""

    name: str
    value: float
    unit: str
    bar: float | None = None  # None: reported, not judged
    at_least: bool = False  # the value has to reach the bar instead of staying below it
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the bar is met; None without a bar."""
        if self.bar is None:
            return None
        return bool(self.value >= self.bar if self.at_least else self.value <= self.bar)


@dataclass
class Report:
    """What one report measured, on which machine, by which command."""

    title: str
    command: str
    rows: list[Row] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)  # every raw number
    notes: list[str] = field(default_factory=list)
    machine: dict[str, Any] = field(default_factory=lambda: machine())

    def met(self) -> bool:
        """Whether no bar was missed."""
        return all(row.met is not False for row in self.rows)

    def as_json(self) -> str:
        """Everything, raw numbers included."""
        rows = [{**asdict(row), "met": row.met} for row in self.rows]
        return json.dumps({**asdict(self), "rows": rows, "met": self.met()}, indent=1, default=float)

    def as_text(self) -> str:
        """The aligned table."""
        cells = [("", "value", "unit", "bar", "met", "")]
        for row in self.rows:
            bar = "" if row.bar is None else f"{'>=' if row.at_least else '<='} {row.bar:.4g}"
            met = {None: "", True: "yes", False: "NO"}[row.met]
            cells.append((row.name, f"{row.value:.4g}", row.unit, bar, met, row.note))
        widths = [max(len(line[k]) for line in cells) for k in range(6)]
        lines = [self.title, ""]
        for name, value, unit, bar, met, note in cells:
            left = f"{name:<{widths[0]}}  {value:>{widths[1]}} {unit:<{widths[2]}}"
            lines.append(f"{left}  {bar:<{widths[3]}}  {met:<{widths[4]}}  {note}".rstrip())
        lines += ["", *self.notes, ", ".join(f"{k} {v}" for k, v in self.machine.items()), f"command: {self.command}"]
        return "\n".join(lines)


def machine() -> dict[str, Any]:
    """Processor, cores, load, and the versions that decide a timing."""
    facts: dict[str, Any] = {"processor": _processor(), "cores": os.cpu_count()}
    if hasattr(os, "getloadavg"):
        facts["load"] = round(os.getloadavg()[0], 1)
    facts["python"] = platform.python_version()
    for name in ("dojo-opt", "numba", "numpy", "mujoco", "crocoddyl", "pin"):
        try:
            facts[name] = version(name)
        except PackageNotFoundError:
            continue
    return facts


def _processor() -> str:
    """Name of the processor; platform.processor() is empty on most Linux systems."""
    if sys.platform.startswith("linux"):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
