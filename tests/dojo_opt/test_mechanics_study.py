"""The mechanics study measures what its columns say, and would notice a wrong one."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from dojo_opt.report.mechanics import Mechanics, joints
from dojo_opt.report.study import Progress, study
from sim.parts import KINDS


@pytest.mark.parametrize("kind", ["fixed", "revolute", "planar_orbital", "spherical"])
def test_joints_keep_their_bars(kind: str) -> None:
    for name, value in joints.check(kind).items():
        if sum(KINDS[kind]) == 0 and name not in ("momentum", "energy", "derivatives"):
            assert value is None
        elif name == "energy":
            assert value is not None and value >= joints.BARS[name]
        else:
            assert value is not None and value <= joints.BARS[name], name


def test_a_wrong_derivative_is_seen() -> None:
    A = np.array([[1.0, 2.0], [3.0, -4.0]])

    def function(x: np.ndarray) -> np.ndarray:
        return np.asarray(A @ x + x**3)

    assert joints.relative_error(A, function) < 1e-9
    assert joints.relative_error(A + [[0.0, 0.0], [0.0, 1e-3]], function) == pytest.approx(1e-3 / 4.0, rel=1e-2)


def test_stops_that_are_never_met_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a joint that is stuck would keep its stops."""
    whole = joints.alone

    def stuck(kind: str, **options: float) -> object:
        mech = whole(kind, **options)
        return replace(mech, joints=[replace(mech.joints[0], damper=1e6)])

    monkeypatch.setattr(joints, "alone", stuck)
    monkeypatch.setattr(joints, "replace", lambda part, **changes: replace(part, **{**changes, **_damped(changes)}))
    assert joints.limits("prismatic") == 1.0


def _damped(changes: dict[str, object]) -> dict[str, object]:
    return {"damper": 1e6} if "damper" in changes else {}


def test_the_study_by_its_name() -> None:
    assert isinstance(study("mechanics", quick=True), Mechanics)
    report = Mechanics(quick=True).run(Progress(io.StringIO()))
    assert report.met(), [row.name for row in report.rows if row.met is False]
    assert report.tables[0].header[1:] == tuple(joints.BARS)
    assert len(report.tables[0].rows) == 4
