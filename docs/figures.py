"""Put the measured numbers into the pages: README.md, CHANGELOG.md and those of docs/ quote docs/measured.

    python docs/figures.py               fill in the numbers that docs/quotes.toml lists
    python docs/figures.py --check       change nothing; exit with 1 if a page differs from the measurements
    python docs/figures.py --take DIR    first copy the output of `benchmarks/all.sh DIR` to docs/measured

docs/quotes.toml lists sentences as they stand in a page, with holes where measured numbers go:

    [[quote]]
    page = "README.md"
    text = "of 243 falls not solved to the end | {d falls > not solved to the end, default kappa} |"

A hole is a format and an address. Address: a study of the report or a benchmark, then the name of a row; or the title
of a table, the first cell of a row (the first two, with `; ` between) and the head of a column; or `details`, or
`machine`, and the keys; or `bars`, `bars met`: how many the study has. Format: as Python's (d, .2f, .2g and so on),
without zeros in exponents; s for a version or a share like 3 of 4; with a factor behind it, as `.2f*1e-3`.
Code, formulas, links, titles, and matches of `given` (regular expressions, by page) are not measured. Every other
number of a page that is listed there has to be in a sentence of the list, or in a table:

    [[table]]           between `<!-- NAME -->` and `<!-- end of NAME -->`
    page = "README.md"
    name = "stability"
    source = "stability > passed"
    columns = ["dojo-opt", "PyBullet"]
    rows = [["mass ratio", "up to 1e6 kg on a foot of 1 kg"]]     first cell, and the text behind it

A table with the source `bars not met` lists all of them.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
MEASURED = ROOT / "docs" / "measured"
PAGES = (
    "README.md",
    "CHANGELOG.md",
    *(f"docs/{name}.md" for name in ("accuracy", "examples", "guide", "installation", "limitations", "mpc_suites")),
    "docs/numbers.md",
    *(f"docs/theory/{name}.md" for name in ("step", "energy_balance", "inactive_contacts", "active_features")),
    *(f"docs/theory/{name}.md" for name in ("restitution", "error_control", "dampers")),
)
BULKY = (("planning", "settings"),)  # details that nothing quotes, 0.4 MB: not taken to docs/measured
NOT_MET = "bars not met"
DIGITS = 6  # significant ones that are kept
WIDTH = 120  # of a line of JSON

_HOLE = re.compile(r"\{(\S+?)(?:\*(\S+))? ([^{}]+)\}")
_NUMBER = r"([-+]?\.?\d[\d,]*(?:\.\d+)?(?:e-?\d+)?|\binf\b|\bnan\b)"
_TEXT = r"(\d+(?:\.\d+)*(?: of \d+)?)"  # versions, and shares
_UNMEASURED = (r"```.*?```", r"\$\$.*?\$\$", r"`[^`]*`", r"\]\([^)]*\)", r"^#.*?$")  # code, formulas, links, titles


class Quotes(NamedTuple):
    """docs/quotes.toml."""

    quote: list[dict[str, str]]
    table: list[dict[str, Any]]
    given: dict[str, list[str]]  # by page: regular expressions of numbers that are not measured


def quotes() -> Quotes:
    """The sentences and tables of the pages."""
    return Quotes(**tomllib.loads((ROOT / "docs" / "quotes.toml").read_text(encoding="utf-8")))


def measured(folder: Path = MEASURED) -> dict[str, Any]:
    """Studies of report.json and benchmarks, by their names."""
    found = json.loads((folder / "report.json").read_text(encoding="utf-8"))["studies"]
    for file in sorted(folder.glob("*.json")):
        if file.name != "report.json":
            found[file.stem] = json.loads(file.read_text(encoding="utf-8"))
    return found


def value(studies: dict[str, Any], address: str) -> Any:
    """The number at an address.  KeyError: there is none."""
    try:
        return _found(studies, address)
    except (LookupError, ValueError) as error:
        raise KeyError(f"{address}: not measured: {error}") from None


def _found(studies: dict[str, Any], address: str) -> Any:
    study, *path = (part.strip() for part in address.split(" > "))
    report = studies[study]
    if path in (["bars"], ["bars met"]):
        judged = [row["met"] for row in report["rows"] if row["met"] is not None]
        return len(judged) if path == ["bars"] else sum(judged)
    if len(path) == 1:
        return _only(row["value"] for row in report["rows"] if row["name"] == path[0])
    if path[0] in ("details", "machine"):
        found = report
        for key in path:
            found = found[int(key)] if isinstance(found, list) else found[key]
        return found
    title, label, column = path
    table = _only(table for table in report["tables"] if table["title"] == title)
    cells = label.split("; ")
    row = _only(row for row in table["rows"] if [_label(c) for c in row[: len(cells)]] == cells)
    return row[list(table["header"]).index(column)]


def _label(cell: Any) -> str:
    return f"{cell:g}" if isinstance(cell, float) else str(cell)


def _only(found: Iterator[Any]) -> Any:
    values = list(found)
    if len(values) != 1:
        raise ValueError(f"there are {len(values)} of it")
    return values[0]


def shown(number: Any, style: str, factor: str | None = None) -> str:
    """A measured value as it is written."""
    if style == "s":
        return str(number)
    number = float(number) * float(factor or 1.0)
    text = format(round(number), ",d") if style == "d" else format(number, style)
    return re.sub(r"e([-+])0*(\d)", lambda m: "e" + m[1].replace("+", "") + m[2], text)


def fill(page: str, text: str, listed: Quotes, studies: dict[str, Any]) -> tuple[str, list[tuple[int, int]]]:
    """The page with its quotes and tables as measured, and their places in it.

    ValueError: a quote is not there, or more than once.  KeyError: its number is not in docs/measured.
    """
    for table in (t for t in listed.table if t["page"] == page):
        start, end = (text.find(f"<!-- {mark}{table['name']} -->") for mark in ("", "end of "))
        if not 0 <= start < end:
            raise ValueError(f"{page}: there is no `<!-- {table['name']} -->` with its end")
        start = text.index("\n", start) + 1
        text = text[:start] + _table(table, studies) + text[end:]
    spans: list[tuple[int, int]] = []
    for quote in (q["text"] for q in listed.quote if q["page"] == page):
        text, spans = _filled(page, quote, text, spans, studies)
    for table in (t for t in listed.table if t["page"] == page):
        spans.append((text.index(f"<!-- {table['name']} -->"), text.index(f"<!-- end of {table['name']} -->")))
    return text, spans


def _filled(
    page: str, quote: str, text: str, spans: list[tuple[int, int]], studies: dict[str, Any]
) -> tuple[str, list[tuple[int, int]]]:
    """The page with one quote as measured."""
    holes = list(_HOLE.finditer(quote))
    parts = [re.escape(part) for part in _HOLE.sub("\0", quote).split("\0")]
    parts = [re.sub(r"(?:\\ |\\\n)+", r"\\s+", part) for part in parts]
    pattern = parts[0]
    for hole, part in zip(holes, parts[1:], strict=True):
        pattern += (_TEXT if hole[1] == "s" else _NUMBER) + part
    found = list(re.finditer(pattern, text))
    if len(found) != 1:
        raise ValueError(f"{page}: {len(found)} places for the quote {quote!r}")
    pieces, last = [], found[0].start()
    for k, hole in enumerate(holes, start=1):
        pieces += [text[last : found[0].start(k)], shown(value(studies, hole[3]), hole[1], hole[2])]
        last = found[0].end(k)
    new = "".join(pieces) + text[last : found[0].end()]
    start, grown = found[0].start(), len(new) - len(found[0][0])
    moved = [(a + grown, b + grown) if a > start else (a, b) for a, b in spans]
    return text[:start] + new + text[found[0].end() :], [*moved, (start, start + len(new))]


def _table(table: dict[str, Any], studies: dict[str, Any]) -> str:
    """A table of a page: first cells and the text behind them, then columns of a measured one."""
    if table["source"] == NOT_MET:
        return _not_met(studies)
    lines = ["| " + " | ".join([*table["header"], *table["columns"]]) + " |"]
    lines.append("|---" * (len(table["header"]) + len(table["columns"])) + "|")
    for label, *words in table["rows"]:
        cells = [value(studies, f"{table['source']} > {label} > {column}") for column in table["columns"]]
        lines.append("| " + " | ".join(map(str, [label, *words, *cells])) + " |")
    return "\n".join(lines) + "\n"


def _not_met(studies: dict[str, Any]) -> str:
    """All rows of studies whose bar is not met."""
    lines = ["| study | quantity | measured | bar |", "|---|---|---|---|"]
    for name, report in sorted(studies.items()):
        for row in (row for row in report["rows"] if row["met"] is False):
            bar = ("at least " if row["at_least"] else "at most ") + f"{row['bar']:g} {row['unit']}".strip()
            lines.append(f"| {name} | {row['name']} | {shown(row['value'], '.4g')} | {bar} |")
    return "\n".join(lines) + "\n"


def uncovered(page: str, text: str, spans: list[tuple[int, int]], listed: Quotes) -> list[str]:
    """Numbers of a page that are in no quote and no table, with their lines; none of a page that `given` leaves out."""
    if page not in listed.given:
        return []
    free = [*_UNMEASURED, *listed.given[page]]
    spans = [*spans, *((m.start(), m.end()) for p in free for m in re.finditer(p, text, re.DOTALL | re.MULTILINE))]
    missed = []
    for number in re.finditer(r"(?<![\w.])" + _NUMBER, text):
        if not any(a <= number.start() < b for a, b in spans):
            line = text.count("\n", 0, number.start()) + 1
            missed.append(f"{page}:{line}: {number[0]}: {text.splitlines()[line - 1].strip()}")
    return missed


def take(folder: Path) -> None:
    """Copy measurements to docs/measured, with six digits and without bulky details; and the figures."""
    MEASURED.mkdir(exist_ok=True)
    for file in sorted(folder.glob("*.json")):
        text = file.read_text(encoding="utf-8")
        numbers = json.loads(text, parse_float=lambda digits: float(f"{float(digits):.{DIGITS}g}"))
        if re.search(r'"command": "[^"]*--quick', text):
            raise SystemExit(f"figures: {file} is of a --quick run, whose numbers are not quoted")
        for study, key in BULKY:
            left = numbers.get("studies", {}).get(study, {}).get("details", {})
            if key in left:
                left[key] = "left out here"
        (MEASURED / file.name).write_text(compact(numbers) + "\n", encoding="utf-8")
    for name in ("accuracy.png", "error_control.png", "hopper.png", "learning.png"):
        if (folder / name).is_file():
            shutil.copy(folder / name, ROOT / "docs" / name)


def compact(numbers: Any, indent: str = "") -> str:
    """JSON, each item that fits into a line on one line."""
    line = json.dumps(numbers)
    if len(indent) + len(line) <= WIDTH or not isinstance(numbers, dict | list):
        return line
    inner = indent + " "
    if isinstance(numbers, dict):
        lines = [f"{inner}{json.dumps(key)}: {compact(item, inner)}" for key, item in numbers.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if not any(isinstance(item, dict | list) for item in numbers):
        return line
    return "[\n" + ",\n".join(inner + compact(item, inner) for item in numbers) + f"\n{indent}]"


def main(argv: list[str] | None = None) -> int:
    """Fill in, or check."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="change nothing")
    parser.add_argument("--take", type=Path, metavar="DIR", help="take new numbers from here")
    args = parser.parse_args(argv)
    if args.take:
        take(args.take)
    listed, studies, wrong, filled = quotes(), measured(), [], {}
    for page in PAGES:
        before = (ROOT / page).read_text(encoding="utf-8")
        try:
            filled[page], spans = fill(page, before, listed, studies)
        except (KeyError, ValueError) as error:
            print(f"figures: {error.args[0]}", file=sys.stderr)
            return 2
        wrong += uncovered(page, filled[page], spans, listed)
        if args.check and filled[page] != before:
            wrong.append(f"{page}: differs from docs/measured; run python docs/figures.py")
    for page, text in filled.items() if not args.check else ():
        (ROOT / page).write_text(text, encoding="utf-8")
    print("\n".join(wrong) or "every number of the pages is the measured one")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
