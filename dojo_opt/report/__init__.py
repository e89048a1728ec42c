"""Reports: commands that measure something and print a table, `python -m dojo_opt report NAME`."""

from __future__ import annotations

from importlib import import_module

from dojo_opt.report.result import Report

__all__ = ["REPORTS", "run_report"]

REPORTS = {
    "timing": "microseconds per step and gradient, beside MuJoCo when it is installed",
    "compile": "seconds from a cold and a warm start to the first plan",
}

_MODULES = {"timing": "timing", "compile": "compile_time"}


def run_report(name: str, *, quick: bool = False) -> Report:
    """Measure report `name`; quick takes few and short rounds."""
    if name not in REPORTS:
        raise ValueError(f"report: no report {name!r}; there are {', '.join(sorted(REPORTS))}")
    module = import_module(f"dojo_opt.report.{_MODULES[name]}")
    return module.measure(quick=quick)
