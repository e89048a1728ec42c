"""docs/figures.py: every measured number of the pages is the one in docs/measured, and the script finds those that are not."""

import json
import re

import pytest

from support.benchmark import loaded
from support.programs import HOME


@pytest.fixture(scope="module")
def figures():
    yield from loaded("figures", "docs")


@pytest.fixture(scope="module")
def studies(figures):
    return figures.measured()


def listed(figures, *texts, **given):
    return figures.Quotes([{"page": "page", "text": text} for text in texts], [], given)


@pytest.fixture
def speeds():
    """A study with two rows and a table."""
    rows = [{"name": "step / leap", "value": 1234.5, "met": None}, {"name": "drift", "value": 7.2e-11, "met": True}]
    table = {"title": "Cases", "header": ["", "h", "error"], "rows": [["a", 0.5, 3e-9], ["a", 1.0, "2 of 3"]]}
    return {"speed": {"rows": rows, "tables": [table], "details": {"raw": [1.0, 2.0]}, "machine": {"numba": "0.68.1"}}}


def test_the_pages_quote_the_measured_numbers(figures, studies):
    pages = {path.relative_to(figures.ROOT).as_posix() for path in (figures.ROOT / "docs").glob("*.md")}
    assert pages <= set(figures.PAGES)
    for page in figures.PAGES:
        text = (figures.ROOT / page).read_text(encoding="utf-8")
        filled, spans = figures.fill(page, text, figures.quotes(), studies)
        assert filled == text, f"{page}: run python docs/figures.py"
        assert figures.uncovered(page, text, spans, figures.quotes()) == []


def test_a_changed_number_is_put_right(figures, studies):
    """The number of any quote of a page, one digit more."""
    text = (figures.ROOT / "docs/numbers.md").read_text(encoding="utf-8")
    quotes = figures.quotes()
    _, spans = figures.fill("docs/numbers.md", text, quotes, studies)
    command = text.index("random extreme states: unsolved; refused")
    start, end = next((a, b) for a, b in spans if a <= command < b)
    wrong = text[:start] + text[start:end].replace("gains energy | ", "gains energy | 1") + text[end:]
    assert wrong != text
    assert figures.fill("docs/numbers.md", wrong, quotes, studies)[0] == text


def test_a_number_without_a_quote_is_found_with_its_line(figures, speeds):
    quotes = listed(figures, "drift {.0e speed > drift} m", page=["at 20 ms"])
    text, spans = figures.fill("page", "# Title 1\n`code 2` at 20 ms\ndrift 1e-5 m\nand 4.5 us", quotes, speeds)
    assert text.splitlines()[2] == "drift 7e-11 m"
    assert figures.uncovered("page", text, spans, quotes) == ["page:4: 4.5: and 4.5 us"]


def test_addresses_and_formats(figures, speeds):
    value, shown = figures.value, figures.shown
    assert shown(value(speeds, "speed > step / leap"), "d") == "1,234"
    assert shown(value(speeds, "speed > step / leap"), ".2f", "1e-3") == "1.23"
    assert shown(value(speeds, "speed > drift"), ".1e") == "7.2e-11"
    assert shown(value(speeds, "speed > Cases > a; 0.5 > error"), ".0e") == "3e-9"
    assert value(speeds, "speed > Cases > a; 1 > error") == "2 of 3"
    assert value(speeds, "speed > details > raw > 1") == 2.0
    assert (value(speeds, "speed > bars"), value(speeds, "speed > bars met")) == (1, 1)
    for wrong in ("speed > nothing", "speed > Cases > a > error", "height > drift"):
        with pytest.raises(KeyError):
            value(speeds, wrong)


def test_quotes_wrap_like_the_page_and_stand_in_it_once(figures, speeds):
    quotes = listed(figures, "drifts by {.0e speed > drift} m in numba {s speed > machine > numba}.")
    text, _ = figures.fill("page", "it drifts by\n  1 m in numba 0.1.", quotes, speeds)
    assert text == "it drifts by\n  7e-11 m in numba 0.68.1."
    for page in ("nothing", text + text):
        with pytest.raises(ValueError, match="places for the quote"):
            figures.fill("page", page, quotes, speeds)


def test_tables_are_written_between_their_marks(figures, speeds):
    table = {"page": "page", "name": "cases", "source": "speed > Cases", "header": ["what", "why"]}
    table |= {"columns": ["h", "error"], "rows": [["a; 1", "10 times"]]}
    quotes = figures.Quotes([], [table], {"page": []})
    text, spans = figures.fill("page", "<!-- cases -->\nold\n<!-- end of cases -->\n3", quotes, speeds)
    assert text.splitlines()[1:4] == [
        "| what | why | h | error |",
        "|---|---|---|---|",
        "| a; 1 | 10 times | 1.0 | 2 of 3 |",
    ]
    assert figures.uncovered("page", text, spans, quotes) == ["page:6: 3: 3"]
    assert figures.uncovered("page", text, spans, figures.Quotes([], [table], {})) == []  # a page that is not listed
    with pytest.raises(ValueError, match="there is no `<!-- cases -->`"):
        figures.fill("page", "no table", quotes, speeds)


def test_taken_reports_have_six_digits_and_nothing_bulky(figures, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "MEASURED", tmp_path / "measured")
    study = {"details": {"settings": [1] * 9, "plans": [{"cost": 1.23456789}] * 30}, "rows": []}
    (tmp_path / "report.json").write_text(json.dumps({"studies": {"planning": study}}))
    (tmp_path / "falls.json").write_text(json.dumps({"rows": [{"name": "falls", "value": 3}]}))
    figures.take(tmp_path)
    taken = json.loads((tmp_path / "measured/report.json").read_text())["studies"]["planning"]["details"]
    assert taken == {"settings": "left out here", "plans": [{"cost": 1.23457}] * 30}
    assert set(figures.measured(tmp_path / "measured")) == {"planning", "falls"}
    assert max(map(len, (tmp_path / "measured/report.json").read_text().splitlines())) <= 120
    (tmp_path / "gaits.json").write_text(json.dumps({"command": "python benchmarks/gaits.py --quick", "rows": []}))
    with pytest.raises(SystemExit, match="gaits.json is of a --quick run"):
        figures.take(tmp_path)


def test_measured_files_name_no_folder_of_the_machine_that_measured() -> None:
    found = {
        path.name: hit.group()
        for path in sorted((HOME / "docs" / "measured").glob("*.json"))
        for hit in re.finditer(r"/(tmp|home|root|work|Users|mnt)/\S*", path.read_text())
    }
    assert found == {}
