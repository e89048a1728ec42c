"""The report `lean`: its scenes differ by the features in their names, and it counts existing features."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.studies.lean.lean_scenes import MANY, absent, features, pendulum_scene
from benchmarks.studies.lean.new_process import new_process
from dojo_opt import __main__ as cli
from dojo_opt.report.command import report
from dojo_opt.report.lean import cold_starts, omitted_terms
from dojo_opt.report.lean.cold_starts import ColdStart
from dojo_opt.report.lean.feature_variants import without
from dojo_opt.report.step_cost import costs
from dojo_opt.report.study import Progress, study


@pytest.fixture(scope="module")
def measured():
    """Costs of the scenes, by name."""
    return {cost.name: cost for cost in costs([pendulum_scene(*scene) for scene in features()], 1)}


def test_every_row_has_one_feature_more(measured):
    variables = {name: cost.variables for name, cost in measured.items()}
    far = {name: cost.far for name, cost in measured.items()}
    assert all(cost.velocities == 1 and not cost.message for cost in measured.values())
    assert (variables["pendulum"], far["pendulum"]) == (0, 0)
    assert variables["+ limit"] == 4  # two bounds, of two variables each
    assert variables["+ spring"] == variables["+ limit"]
    assert variables["+ frictionless contact"] == variables["+ spring"] + 2
    assert variables["+ cone"] == variables["+ spring"] + 4
    assert variables[f"+ {MANY} far contacts"] == variables["+ cone"]
    assert far[f"+ {MANY} far contacts"] == MANY
    assert variables[f"+ {MANY} near instead"] == variables["+ cone"] + 4 * MANY
    sizes = [cost.bytes for cost in measured.values()]
    assert sizes[0] < sizes[1] == sizes[2] < sizes[3] == sizes[4] < sizes[5] == sizes[6]


def test_times_are_for_solved_steps(measured):
    for cost in measured.values():
        assert cost.step.shape == (1,) and np.all(cost.step > 0.0) and cost.iterations >= 1.0


def test_a_motion_that_does_not_get_anywhere_is_reported():
    scene = pendulum_scene("stuck", features()[0][1])
    scene = type(scene)(
        "stuck", scene.simulator.replace(max_iterations=1, tolerance=1e-15, divide=False), np.array([2.0, 9.0])
    )
    (cost,) = costs([scene], 1)
    assert "iteration limit" in cost.message and np.isnan(cost.step).all() and np.isnan(cost.iterations)


@pytest.mark.parametrize(("never", "there"), [pair for _, *pair in absent()], ids=[what for what, *_ in absent()])
def test_an_absent_feature_leaves_no_trace_in_the_model(never, there):
    for a, b in zip(dojo.Simulator(never).model, dojo.Simulator(there).model, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_robot_loses_the_features_that_it_has():
    hopper = dojo.models.raiberthopper(limits=(0.2, 0.8), spring=10.0)
    names = [name for name, _ in without(hopper)]
    assert names == ["as it is"] + [
        f"without {what}" for what in ("friction", "contacts", "limits", "spring", "damper", "all of these")
    ]
    assert [name for name, _ in without(dojo.models.pendulum())] == ["as it is"]


def test_the_report_of_a_robot():
    hopper = dojo.models.raiberthopper(limits=(0.2, 0.8))
    report = dojo.report.run_report("lean", quick=True, mechanism=hopper)
    changes = {row.name: row.value for row in report.rows}
    assert set(changes) == {
        f"without {what}: change of step and gradient"
        for what in ("friction", "contacts", "limits", "damper", "all of these")
    }
    assert all(np.isfinite(value) and value > -100.0 for value in changes.values())
    assert any("inactive contacts" in note for note in report.notes)
    assert report.figure is not None and json.loads(report.as_json())["details"]["robot"]


@pytest.mark.slow
def test_a_simulation_in_a_new_process_imports_no_heavy_library():
    run = new_process("pendulum", cold=False)
    assert run["modules"] == [] and run["kernels"]


def test_cold_starts_add_up_along_their_bases(monkeypatch):
    """A feature's seconds are those beyond its base with a warm cache; functions count those that the base lacks."""
    seconds = {"pendulum": iter([7.0, 1.0]), "derivatives": iter([3.0, 1.5]), "parameters": iter([5.0])}
    functions = {"pendulum": 130, "derivatives": 30, "parameters": 100}

    def process(scene, cache):
        cache.mkdir(exist_ok=True)
        return next(seconds[scene.name]), functions[scene.name]

    monkeypatch.setattr(cold_starts, "_process", process)
    scenes = cold_starts.chosen(["parameters"])
    assert [scene.name for scene in scenes] == ["pendulum", "derivatives", "parameters"]
    found = cold_starts.measure(scenes, Progress())
    assert found["pendulum"] == (0.0, 0, 7.0, 130)
    assert found["derivatives"] == (7.0, 130, 2.0, 30)
    assert found["parameters"] == (9.0, 160, 3.5, 100) and found["parameters"].seconds == 12.5


def test_the_report_lists_cold_starts_on_request_the_worst_first(monkeypatch):
    cold = {"pendulum": (0.0, 0, 7.0, 130), "spring": (7.0, 130, 0.5, 4)}
    monkeypatch.setattr(
        cold_starts, "measure", lambda scenes, progress: {s.name: ColdStart(*cold[s.name]) for s in scenes}
    )
    monkeypatch.setattr(omitted_terms, "_robot", lambda report, *_: report.details.update(robot=[]))
    made = study("lean", quick=True, mechanism=dojo.models.pendulum(), cold=True).run(Progress())
    (table,) = made.tables
    assert [line[0] for line in table.rows] == ["spring", "pendulum"]
    assert (made.rows[-1].name, made.rows[-1].value, made.rows[-1].note) == ("the worst cold start", 7.5, "spring")
    assert not study("lean", mechanism=dojo.models.pendulum()).run(Progress()).tables
    with pytest.raises(ValueError, match="--cold: it belongs to the report lean, got timing"):
        report(cli._parser().parse_args(["report", "timing", "--cold"]))
    for given in (["--fixed"], ["--contacts", "foot"]):
        with pytest.raises(ValueError, match=f"report {given[0]}: it belongs to a ROBOT.urdf"):
            report(cli._parser().parse_args(["report", "timing", *given]))


def test_every_cold_scene_is_a_program_beyond_one_before_it():
    names = [scene.name for scene in cold_starts.SCENES]
    assert len(set(names)) == len(names)
    for k, scene in enumerate(cold_starts.SCENES):
        assert scene.base in ("", *names[:k])
        compile(cold_starts._HEAD + scene.program + cold_starts._TAIL, scene.name, "exec")
