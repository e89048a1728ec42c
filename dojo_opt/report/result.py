"""Report: the results of one study, as rows with their bars, tables, a figure, and every raw number."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from sim.io.json_text import json_text
from solvers.compiler import stamp

Cell = str | float | int | bool | None

_PACKAGES = ("dojo-opt", "numba", "numpy", "scipy", "mujoco", "drake", "pybullet", "crocoddyl", "pin")


@dataclass(frozen=True)
class Row:
    """One measured number, and the bar for it.

    Attributes:
        name: the measured quantity.
        value: the number.
        unit: its unit.
        bar: the bar (default None: the number is reported, not judged).
        at_least: whether the value has to reach the bar instead of staying below it (default False).
        note: a remark (default none).
    """

    name: str
    value: float
    unit: str
    bar: float | None = None
    at_least: bool = False
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the bar is met; None without a bar, False for a value that is not a number."""
        if self.bar is None:
            return None
        return bool(self.value >= self.bar if self.at_least else self.value <= self.bar)

    @property
    def bound(self) -> str:
        """The bar with its direction, as text; empty without a bar."""
        return "" if self.bar is None else f"{'>=' if self.at_least else '<='} {self.bar:.4g}"


@dataclass(frozen=True)
class Table:
    """Numbers side by side: one row per case, one column per engine or setting.

    Attributes:
        title: title of the table.
        header: names of the columns.
        rows: cells, as many per row as there are columns.
        note: a remark (default none).

    Raises:
        ValueError: a row has the wrong number of cells.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise ValueError(f"Table {self.title!r}: {len(self.header)} columns, but a row has {len(row)}: {row}")


@dataclass
class Report:
    """The results of one study, with its machine and command.

    Attributes:
        title: title of the study.
        command: command that reproduces it; `run_report` writes it.
        rows: measured numbers with their bars.
        tables: further numbers.
        details: every raw number.
        notes: remarks.
        machine: processor, cores, load and versions (default: those of this machine).
        summary: the subject, and its reference.
        figure: a matplotlib Figure (default None).
    """

    title: str
    command: str = ""
    rows: list[Row] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    machine: dict[str, Any] = field(default_factory=lambda: machine())
    summary: str = ""
    figure: Any = None

    def met(self) -> bool:
        """Whether no bar was missed.

        Returns:
            True if every row meets its bar or has none.
        """
        return all(row.met is not False for row in self.rows)

    def as_dict(self) -> dict[str, Any]:
        """The report as a dictionary.

        Returns:
            Everything but the figure, raw numbers included.
        """
        rows = [{**asdict(row), "met": row.met} for row in self.rows]
        fields = {name: getattr(self, name) for name in ("title", "command", "summary", "details", "notes", "machine")}
        return {**fields, "rows": rows, "tables": [asdict(table) for table in self.tables], "met": self.met()}

    def as_json(self) -> str:
        """The report as JSON.

        Returns:
            Text of everything but the figure. Infinities and NaN, for which JSON has no numbers, are strings.
        """
        return json_text(self.as_dict(), indent=1)

    def as_text(self) -> str:
        """The report as aligned tables.

        Returns:
            Text of several lines.
        """
        lines = [self.title, "", *([self.summary, ""] if self.summary else [])]
        if self.rows:
            cells = [(r.name, f"{r.value:.4g} {r.unit}", r.bound, verdict(r.met), r.note) for r in self.rows]
            lines += [*aligned(("", "value", "bar", "met", ""), cells), ""]
        for table in self.tables:
            lines += [table.title, *aligned(table.header, [[shown(c) for c in row] for row in table.rows])]
            lines += [table.note, ""] if table.note else [""]
        lines += [*self.notes, ", ".join(f"{k} {v}" for k, v in self.machine.items()), f"command: {self.command}"]
        return "\n".join(lines)


def verdict(met: bool | None) -> str:
    """A word for a bar."""
    return {None: "", True: "yes", False: "NO"}[met]


def shown(cell: Cell) -> str:
    """A cell as people read it."""
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "yes" if cell else "NO"
    return cell if isinstance(cell, str) else f"{cell:.4g}"


def aligned(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table with columns of equal width."""
    widths = [max(len(line[k]) for line in [header, *rows]) for k in range(len(header))]
    return ["  ".join(f"{c:<{w}}" for c, w in zip(line, widths, strict=True)).rstrip() for line in [header, *rows]]


def machine() -> dict[str, Any]:
    """Processor, cores, load, the versions that decide a timing, and a digest of the sources of all kernels."""
    facts: dict[str, Any] = {"processor": _processor(), "cores": os.cpu_count()}
    if hasattr(os, "getloadavg"):
        facts["load"] = round(os.getloadavg()[0], 1)
    facts["python"] = platform.python_version()
    for name in _PACKAGES:
        try:
            facts[name] = version(name)
        except PackageNotFoundError:
            continue
    facts["kernels"] = stamp()
    return facts


def _processor() -> str:
    """Name of the processor; platform.processor() is empty on most Linux systems."""
    if sys.platform.startswith("linux"):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
