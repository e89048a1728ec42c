"""The notebooks of docs/ run from top to bottom, and hold no outputs of an earlier run.

Here they learn for a moment only. With WHOLE_NOTEBOOKS=1, as in .ci/run, they learn as they say, and reach their aims.
"""

from __future__ import annotations

import ast
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "docs").glob("*.ipynb"))
WHOLE = bool(os.environ.get("WHOLE_NOTEBOOKS"))
QUICK = {"learning": ("epochs=100", "epochs=2")}


def _run(source: str, names: dict[str, Any]) -> Any:
    """What a notebook does with a cell: the value of an expression at the end, None behind a semicolon."""
    tree, shown = ast.parse(source), None
    last = tree.body[-1]
    if isinstance(last, ast.Expr) and not source.rstrip().endswith(";"):
        tree.body.pop()
        shown = ast.Expression(last.value)
    exec(compile(tree, "cell", "exec"), names)
    return None if shown is None else eval(compile(shown, "cell", "eval"), names)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_notebooks_run(path, monkeypatch):
    pytest.importorskip("gymnasium")
    monkeypatch.setenv("MPLBACKEND", "agg")
    page = json.loads(path.read_text(encoding="utf-8"))
    assert (page["nbformat"], page["nbformat_minor"]) >= (4, 5)
    assert len({cell["id"] for cell in page["cells"]}) == len(page["cells"])
    names: dict[str, Any] = {}
    long, short = QUICK.get(path.stem, ("", ""))
    assert any(long in "".join(cell["source"]) for cell in page["cells"])
    for cell in page["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None
            source = "".join(cell["source"])
            value = _run(source if WHOLE else source.replace(long, short), names)
            if value is not None:
                assert "<" in value._repr_html_()
    if path.stem == "learning":
        assert len(names["learned"].history) == (100 if WHOLE else 2)
        if WHOLE:
            assert np.linalg.norm(names["flight"].x[-1, :3] - names["goal"]) < 0.2
            assert names["total"].mean() > 300.0
        assert len(names["found"].unseen) == 1
        np.testing.assert_allclose(names["known"].values, (1.0, 0.2, 0.05), rtol=0.05)
