"""The source in numbers: lines and files of each package, entries at its top, circular imports, the largest files and
functions, and "what" per 1000 lines, a sign of clauses in place of nouns.

    python benchmarks/source_statistics.py
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from pathlib import Path

from command import deliver, number, parser

from dojo_opt.report.result import Report, Table
from support.modules import ROOT, circles, imports

PLACES = ("solvers", "sim", "dojo_opt", "benchmarks", "tests", "examples")
MOST = {"solvers": 20, "sim": 12, "dojo_opt": 20}  # entries at the top of a package


def functions(file: Path) -> list[tuple[int, str]]:
    """Lines of the body of each function, without its docstring, and its place."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.FunctionDef):
            first = node.body[1 if ast.get_docstring(node) and len(node.body) > 1 else 0]
            found.append((int(node.end_lineno or 0) - first.lineno + 1, f"{file.relative_to(ROOT)} {node.name}"))
    return found


def run(args: argparse.Namespace) -> Report:
    """Everything is counted, also in a quick run."""
    report = Report("The source", "")
    lines, largest = [], []
    for place in PLACES:
        files = sorted((ROOT / place).rglob("*.py"))
        sizes = [(len(file.read_text().splitlines()), str(file.relative_to(ROOT))) for file in files]
        total = sum(size for size, _ in sizes)
        entries = sum(path.name != "__pycache__" for path in (ROOT / place).iterdir())
        what = sum(len(re.findall(r"\bwhat\b", file.read_text(), re.IGNORECASE)) for file in files)
        lines.append([place, len(files), total, entries, round(1000.0 * what / total, 2)])
        longest = max(each for file in files for each in functions(file))
        largest.append([place, *max(sizes)[::-1], *longest[::-1]])
        if place in MOST:
            report.rows.append(number(f"entries at the top of {place}", entries, MOST[place]))
    report.rows.append(number("circular imports", len(circles(imports())), 0))
    report.tables = [
        Table("Packages", ("", "files", "lines", "entries at the top", "what per 1000 lines"), lines),
        Table("Largest", ("", "file", "lines", "function", "lines of its body"), largest),
    ]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    return deliver("source_statistics", run, parser(__doc__), argv)


if __name__ == "__main__":
    sys.exit(main())
