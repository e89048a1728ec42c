"""The mechanics study measures the quantities of its columns, and would notice a wrong value."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.compare import STUDIES
from benchmarks.studies.mechanics import MechanicsStudy
from benchmarks.studies.mechanics import joint_kinds as joints
from benchmarks.studies.mechanics.mechanics_study import QUICK_CASES, QUICK_PAIRS
from dojo_opt.report.study import Progress, study
from sim.mechanism.joint import KINDS
from sim.model.shape_kinds import OUT
from support import collision_checks as collisions
from support import parameter_errors as parameters
from support.situations import CASES


@pytest.mark.parametrize("kind", ["fixed", "revolute", "planar_orbital", "spherical", "screw"])
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


def test_a_wrong_distance_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    true = collisions.nearest
    monkeypatch.setattr(collisions, "nearest", lambda *case: true(*case) + np.eye(1, OUT)[0] * 1e-3)
    errors = collisions.check("sphere_sphere")
    assert errors["distance near"] == pytest.approx(1e-3, rel=1e-3)
    assert errors["frame deep"] == pytest.approx(0.5e-3, rel=1e-3)  # half of it at either surface


def test_a_wrong_derivative_by_a_parameter_is_seen() -> None:
    case = CASES["touching"]()

    class Off:
        def __getattr__(self, name: str) -> object:
            return getattr(case.sim, name)

        def linearize(self, *args: object, **options: object) -> dict[str, np.ndarray]:
            return {name: 1.001 * block for name, block in case.sim.linearize(*args, **options).items()}

    assert parameters.error(case, "mass") < parameters.BAR
    assert parameters.error(case._replace(sim=Off()), "mass") == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.slow
def test_the_study_by_its_name() -> None:
    assert isinstance(study("mechanics", quick=True, studies=STUDIES), MechanicsStudy)
    report = MechanicsStudy(quick=True).run(Progress(io.StringIO()))
    assert report.met(), [row.name for row in report.rows if row.met is False]
    kinds, pairs, by_parameters = report.tables
    assert kinds.header[1:] == tuple(joints.BARS)
    assert len(kinds.rows) == 5
    assert len(pairs.header) == 10
    assert [row[0] for row in pairs.rows] == list(QUICK_PAIRS)
    assert by_parameters.header[1:] == QUICK_CASES
    assert {"mass", "friction", "gravity", "time_step"} <= {row[0] for row in by_parameters.rows}
    bars = {row.name: row.bar for row in report.rows}
    assert (bars["pairs: distance"], bars["pairs: distance, rounded"]) == (1e-5, 1e-4)
    assert [axes.get_title() for axes in report.figure.axes] == [
        "joint kinds",
        "pairs of shapes",
        "derivatives by parameters",
    ]
