"""Reports: rows and bars, the page and its files, names of studies."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import dojo_opt as dojo
from benchmarks.compare import STUDIES
from dojo_opt.report import Progress, Report, Row, Table, write_page


def report() -> Report:
    figure = Figure()
    figure.subplots().plot([0, 1])
    rows = [Row("error", 1e-3, "m", 1e-2), Row("speed", 1.0, "m/s", 2.0, at_least=True), Row("none", np.nan, "m", 1.0)]
    table = Table("engines", ("h", "ours", "a | b"), [(0.01, 1e-12, "FAILED"), (0.1, None, True)], note="of energy")
    details = {"raw": np.arange(3)}
    return Report("A study", "dojo-opt report study", rows, [table], details, summary="measured", figure=figure)


def test_a_bar_is_judged_by_its_direction_and_never_met_by_nan() -> None:
    assert [row.met for row in report().rows] == [True, False, False]
    assert Row("free", 1.0, "").met is None


def test_tables_are_rectangular() -> None:
    with pytest.raises(ValueError, match="2 columns, but a row has 1"):
        Table("t", ("a", "b"), [(1.0,)])


class Tags(HTMLParser):
    """Counts tags, and checks that they close."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_holds_pictures_tables_and_numbers(tmp_path: Path) -> None:
    files = write_page({"one": report(), "two": report()}, tmp_path / "new", "dojo-opt report all")
    assert sorted(file.name for file in files) == ["one.png", "report.html", "report.json", "report.md", "two.png"]
    page = Tags()
    page.feed((tmp_path / "new/report.html").read_text())
    assert page.open == []
    sources = [attrs["src"] for tag, attrs in page.seen if tag == "img"]
    assert len(sources) == 2 and all(source.startswith("data:image/png;base64,") for source in sources)
    numbers = json.loads((tmp_path / "new/report.json").read_text())
    assert numbers["studies"]["one"]["details"] == {"raw": [0, 1, 2]}
    assert numbers["studies"]["one"]["rows"][2]["value"] == "nan"
    markdown = (tmp_path / "new/report.md").read_text()
    assert "![A study](one.png)" in markdown and "a \\| b" in markdown and "1 of 3" in markdown


def test_names_of_a_user_are_text_in_every_page(tmp_path: Path) -> None:
    name = "</h2><script>alert(1)</script><img src=x onerror=alert(1)>\n\n# [x](javascript:alert(1)) ``` `"
    hostile = Report(name, f"dojo-opt report accuracy {name}", summary=name, notes=[name], machine={name: name})
    hostile.rows.append(Row(name, 1.0, name, note=name))
    hostile.tables.append(Table(name, (name,), [(name,)], name))
    write_page({"accuracy": hostile}, tmp_path, name)
    page = Tags()
    page.feed((tmp_path / "report.html").read_text())
    assert page.open == [] and not {"script", "img"} & {tag for tag, _ in page.seen}
    outside = re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", "", (tmp_path / "report.md").read_text())
    assert "<" not in outside and "](javascript" not in outside
    assert [line for line in outside.splitlines() if line.startswith("# ")] == ["# dojo-opt: measurements"]
    assert json.loads((tmp_path / "report.json").read_text())["studies"]["accuracy"]["title"] == name


def test_long_tables_are_folded_and_the_overview_leads_to_the_studies(tmp_path: Path) -> None:
    long = report()
    long.tables.append(Table("long", ("k",), [(k,) for k in range(40)]))
    write_page({"one": long}, tmp_path, "")
    text = (tmp_path / "report.html").read_text()
    assert text.count("<details>") == 1 and "<summary>long (40 rows)</summary>" in text
    assert 'href="#one"' in text and 'id="one"' in text


def test_text_shows_bars_and_tables() -> None:
    text = report().as_text()
    assert "<= 0.01" in text and ">= 2" in text and "FAILED" in text and "of energy" in text


def test_unknown_studies_and_robots_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="no report 'nonsense'; there are"):
        dojo.report.study("nonsense")
    with pytest.raises(ValueError, match="compile has its own scenes"):
        dojo.report.study("compile", mechanism=dojo.models.pendulum(), studies=STUDIES)


def test_without_a_file_the_quadruped_is_measured() -> None:
    assert dojo.report.study("timing").mechanism.name == "quadruped"


def test_the_time_of_a_robot() -> None:
    measured = dojo.report.run_report("timing", quick=True, mechanism=dojo.models.raiberthopper())
    rows = {row.name: row.value for row in measured.rows}
    assert len(rows) == 10 and np.isfinite(list(rows.values())).all()
    assert all(value > 0.0 for name, value in rows.items() if name.startswith("step"))  # gradients are differences
    assert [line[0] for line in measured.tables[0].rows] == ["1 ms", "2 ms", "5 ms", "10 ms", "20 ms"]
    assert measured.figure is not None and measured.command == "dojo-opt report timing --quick"


def test_progress_names_the_current_case(capsys: pytest.CaptureFixture[str]) -> None:
    import sys

    assert list(Progress(sys.stderr)([("first", 1), ("second", 2)], "study")) == [1, 2]
    assert "study 2/2: second" in capsys.readouterr().err
    assert list(Progress()([("first", 1)], "study")) == [1]
    assert capsys.readouterr().err == ""
