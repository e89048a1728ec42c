"""A small version of benchmarks/robustness.py: random extreme states, no miss unreported and none at all."""

import json

import numpy as np
import pytest

from support.benchmark import loaded


@pytest.fixture(scope="module")
def robustness():
    yield from loaded("robustness")


@pytest.mark.sweep(2)
@pytest.mark.parametrize("name", ["block", "hopper", "quadruped", "quadruped12"])
def test_no_extreme_state_is_missed(robustness, name):
    whole = robustness.total(robustness.study(160, [name], seeds=[7]), name)
    assert whole.unreported == 0
    assert not whole.misses, robustness.line(whole, name)
    assert np.median(whole.iterations) <= 6, robustness.line(whole, name)


@pytest.mark.slow
def test_benchmarks_and_studies_write_the_same_format(robustness, tmp_path, capsys):
    assert (
        robustness.main(["--states", "64", "--seeds", "0", "--mechanism", "block", "--out", str(tmp_path / "new")]) == 0
    )
    assert "iterations, 99 %" in capsys.readouterr().out
    written = json.loads((tmp_path / "new/robustness.json").read_text())
    assert written["command"].endswith("python benchmarks/robustness.py --states 64 --seeds 0 --mechanism block")
    assert {row["name"]: row["value"] for row in written["rows"]}["states"] == 64
    assert sum(sum(cell["iterations"].values()) for cell in written["details"]["cells"]) == 64
    assert robustness.main(["--quick", "--mechanism", "block", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["met"] is True


def test_a_missed_bar_is_the_exit_status(robustness, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(robustness, "lowest", lambda sim, x: -1.0)  # everything is below the ground
    assert robustness.main(["--states", "32", "--seeds", "0", "--mechanism", "block"]) == 1
    assert "NO" in capsys.readouterr().out
