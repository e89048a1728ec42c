"""The page of one or several reports: HTML in one file, Markdown, one PNG per study, JSON with every number."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Mapping
from html import escape
from pathlib import Path

from dojo_opt.report.result import Cell, Report, Table, shown, verdict
from dojo_opt.viewer.whole_file import whole_file
from sim.io.json_text import json_text

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }
table { display: block; overflow-x: auto; }
th, td { border-bottom: 1px solid #ddd; padding: .2em .8em; text-align: left; vertical-align: top; }
th { border-bottom: 2px solid #888; }
.num { white-space: nowrap; }
details { margin: 1em 0; } summary { cursor: pointer; font-weight: bold; }
.yes { color: #17632b; } .no { color: #a01313; font-weight: bold; }
img { max-width: 100%; } .small { color: #666; font-size: 13px; white-space: pre-line; }
code { background: #f3f3f3; padding: 0 .3em; }
"""


_LONG = 20  # rows beyond which a table is folded
_SHORT = 20  # characters of a number with its unit or bound: not broken into lines


def write_page(reports: Mapping[str, Report], folder: Path, command: str) -> list[Path]:
    """Write reports as one page: report.html, report.md, report.json, and NAME.png for every report with a figure.

    Args:
        reports: the reports by the names of their studies, at least one.
        folder: folder of the files, made if it is missing.
        command: command that reproduces the page.

    Returns:
        Paths of the files.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {name: _png(report) for name, report in reports.items() if report.figure is not None}
    files = []
    for name, picture in pictures.items():
        files.append(folder / f"{name}.png")
        with whole_file(files[-1]) as file:
            file.write_bytes(picture)
    machine = next(iter(reports.values())).machine
    numbers = {"command": command, "machine": machine, "studies": {k: r.as_dict() for k, r in reports.items()}}
    texts = {
        "report.html": _html(reports, pictures, command),
        "report.md": _markdown(reports, command),
        "report.json": json_text(numbers, indent=1) + "\n",
    }
    for name, text in texts.items():
        files.append(folder / name)
        with whole_file(files[-1]) as file:
            file.write_text(text, encoding="utf-8")
    return files


def _png(report: Report) -> bytes:
    buffer = io.BytesIO()
    report.figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


def _tables(report: Report) -> list[Table]:
    """The rows as a table, then the others."""
    rows: list[list[Cell]] = [[r.name, r.value, r.unit, r.bound, verdict(r.met), r.note] for r in report.rows]
    return [*([Table("", ("", "value", "", "bar", "met", ""), rows)] if rows else []), *report.tables]


def _facts(report: Report) -> str:
    return ", ".join(f"{name} {value}" for name, value in report.machine.items())


def _overview(reports: Mapping[str, Report]) -> Table:
    """One line per study: how many bars, how many met, and which were missed."""
    rows: list[list[Cell]] = []
    for name, report in reports.items():
        judged = [row for row in report.rows if row.met is not None]
        missed = [row.name for row in judged if not row.met]
        rows.append([name, report.title, f"{len(judged) - len(missed)} of {len(judged)}", "; ".join(missed)])
    return Table("", ("study", "", "criteria met", "missed"), rows)


def _markdown(reports: Mapping[str, Report], command: str) -> str:
    lines = ["# dojo-opt: measurements", "", _code(command), "", *_markdown_table(_overview(reports))]
    for name, report in reports.items():
        lines += ["", f"## {_plain(report.title)}", "", *([_plain(report.summary), ""] if report.summary else [])]
        if report.figure is not None:
            lines += [f"![{_plain(report.title)}]({name}.png)", ""]
        for table in _tables(report):
            lines += [*([f"### {_plain(table.title)}", ""] if table.title else []), *_markdown_table(table), ""]
            lines += [_plain(table.note), ""] if table.note else []
        facts = f"{_code(report.command)}; {_plain(_facts(report))}"
        lines += [*(f"- {_plain(note)}" for note in report.notes), "", facts]
    return "\n".join(lines) + "\n"


def _plain(text: str) -> str:
    """Text of Markdown, on one line, in which names of a user are neither HTML nor links."""
    return escape(" ".join(text.split()), quote=False).replace("](", "]\\(")


def _code(text: str) -> str:
    """A span of code, whose fence is longer than any inside."""
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    pad = " " if len(fence) > 1 else ""
    return f"{fence}{pad}{' '.join(text.split())}{pad}{fence}"


def _markdown_table(table: Table) -> list[str]:
    def line(cells: list[str]) -> str:
        return "| " + " | ".join(_plain(cell).replace("|", "\\|") for cell in cells) + " |"

    rows = [line([shown(cell) for cell in row]) for row in table.rows]
    return [line(list(table.header)), line(["---"] * len(table.header)), *rows]


def _html(reports: Mapping[str, Report], pictures: Mapping[str, bytes], command: str) -> str:
    first = next(iter(reports.values()))
    parts = ["<h1>dojo-opt: measurements</h1>", f"<p><code>{escape(command)}</code></p>"]
    parts.append(f'<p class="small">{escape(_facts(first))}</p>')
    overview = _html_table(_overview(reports))
    for name in map(escape, reports):
        overview = overview.replace(f"<td>{name}</td>", f'<td><a href="#{name}">{name}</a></td>', 1)
    parts.append(overview)
    for name, report in reports.items():
        parts += [f'<h2 id="{escape(name)}">{escape(report.title)}</h2>', f"<p>{escape(report.summary)}</p>"]
        if name in pictures:
            data = base64.b64encode(pictures[name]).decode("ascii")
            parts.append(f'<img alt="{escape(report.title)}" src="data:image/png;base64,{data}">')
        parts += [_html_section(table) for table in _tables(report)]
        parts += [f"<p>{escape(note)}</p>" for note in report.notes]
        parts.append(f'<p class="small"><code>{escape(report.command)}</code>; {escape(_facts(report))}</p>')
    head = f'<meta charset="utf-8"><title>dojo-opt report</title><style>{_STYLE}</style>'
    return f'<!DOCTYPE html><html lang="en"><head>{head}</head><body>{"".join(parts)}</body></html>\n'


def _html_section(table: Table) -> str:
    """A table under its title; a long one is folded."""
    note = f'<p class="small">{escape(table.note)}</p>' if table.note else ""
    if table.title and len(table.rows) > _LONG:
        summary = f"<summary>{escape(table.title)} ({len(table.rows)} rows)</summary>"
        return f"<details>{summary}{_html_table(table)}{note}</details>"
    return (f"<h3>{escape(table.title)}</h3>" if table.title else "") + _html_table(table) + note


def _html_table(table: Table) -> str:
    def cell(value: Cell) -> str:
        text = shown(value)
        mark = {"yes": ' class="yes"', "NO": ' class="no"'}.get(text, "")
        if not mark and len(text) < _SHORT and any(c.isdigit() for c in text):
            mark = ' class="num"'
        return f"<td{mark}>{escape(text)}</td>"

    head = "".join(f"<th>{escape(name)}</th>" for name in table.header)
    body = "".join("<tr>" + "".join(cell(value) for value in row) + "</tr>" for row in table.rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
