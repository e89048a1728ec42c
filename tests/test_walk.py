"""The walks of CONTRIBUTING.md: an editor gets from each file to the next by "go to definition" at a call."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
jedi = pytest.importorskip("jedi", reason="what editors and IPython follow calls with")


def walks() -> list[list[Path]]:
    """The files of each table below a heading "The walk through ..."."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    sections = re.findall(r"^## The walk through .*?(?=^## )", text, re.MULTILINE | re.DOTALL)
    return [[ROOT / name for name in re.findall(r"^\| `([\w/]+\.py)`", section, re.MULTILINE)] for section in sections]


def defined(file: Path) -> set[str]:
    """Names of the functions, methods and classes of a file."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return {node.name for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, kinds)}


def calls(file: Path, names: set[str]) -> list[tuple[int, int]]:
    """Where a file calls functions of these names: line, column of the name."""
    found = {}
    for node in (node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call)):
        name, end = node.func, (node.func.end_lineno or 0, node.func.end_col_offset or 0)
        text = name.attr if isinstance(name, ast.Attribute) else getattr(name, "id", "")
        if text in names:
            found.setdefault(ast.unparse(name), (end[0], end[1] - 1))
    return list(found.values())


def leads(one: Path, other: Path) -> bool:
    """Whether the definition of something that a file calls is in the other."""
    script = jedi.Script(path=one, project=jedi.Project(ROOT))
    places = calls(one, defined(other))
    return any(d.module_path == other for place in places for d in script.goto(*place, follow_imports=True))


@pytest.mark.parametrize(
    ("first", "last", "back"),
    [pytest.param("simulator.py", "cone.py", 2, marks=pytest.mark.slow), ("ilqr.py", "riccati.py", 5)],
)
def test_every_file_of_a_walk_leads_to_the_next(first: str, last: str, back: int) -> None:
    """From one of the `back` files before it: a file calls several of the next ones."""
    files = next(files for files in walks() if files[0].name == first)
    assert any(file.name == last for file in files)
    lost = [
        file.name
        for k, file in enumerate(files[1:])
        if not any(leads(before, file) for before in files[max(0, k + 1 - back) : k + 1])
    ]
    assert lost == []


def test_a_call_through_a_string_leads_nowhere(tmp_path: Path) -> None:
    (tmp_path / "one.py").write_text("import importlib\nstep = importlib.import_module('other').step\nstep()\n")
    (tmp_path / "two.py").write_text("from other import step\nstep()\n")
    (tmp_path / "other.py").write_text("def step() -> None: ...\n")
    script = jedi.Script(path=tmp_path / "two.py", project=jedi.Project(tmp_path))
    assert [d.module_path for d in script.goto(2, 3, follow_imports=True)] == [tmp_path / "other.py"]
    script = jedi.Script(path=tmp_path / "one.py", project=jedi.Project(tmp_path))
    assert [d.module_path for d in script.goto(3, 3, follow_imports=True)] != [tmp_path / "other.py"]
