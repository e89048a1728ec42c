"""The accuracy study: errors, equal-time comparison, recommendation, and both reports end to end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines import Ours
from benchmarks.studies.accuracy import accuracy_scenes as scenes
from dojo_opt.report import Progress, study
from dojo_opt.report.accuracy import advice, smooth_scene
from dojo_opt.report.accuracy import error_curves as curves
from dojo_opt.report.accuracy import robot_accuracy as robot
from dojo_opt.report.accuracy import starting_pose as start
from dojo_opt.report.accuracy.error_curves import CurvePoint
from dojo_opt.report.accuracy.robot_accuracy import SettingTrial


def points(*pairs: tuple[float, float]) -> list[CurvePoint]:
    return [
        CurvePoint(0.01 / (k + 1), seconds, 10, {"position": error}, "") for k, (seconds, error) in enumerate(pairs)
    ]


def test_equal_time_interpolates_on_logarithmic_axes_and_never_promises_speed() -> None:
    curve = points((1e-3, 1e-2), (1e-2, 1e-4), (1e-1, 1e-6))
    assert math.isclose(curves.at_time(curve, "position", 10.0**-2.5), 1e-3)
    assert curves.at_time(curve, "position", 1.0) == pytest.approx(1e-6)
    assert curves.at_time(curve, "position", 1e-4) == np.inf
    assert curves.at_time(points((1e-3, np.inf)), "position", 1.0) == np.inf


def test_ratio_is_the_worst_over_the_steps_of_the_peer() -> None:
    ours = {"dojo-opt": points((1e-3, 1e-1)), "dojo-opt order 4": points((1e-3, 1e-3), (1e-2, 1e-8))}
    peer = {"MuJoCo RK4": points((2e-3, 1e-2), (1e-2, 1e-7), (5e-2, np.inf))}
    over = curves.ratios(ours | peer, "MuJoCo RK4", "position")
    assert list(over) == [0.01, 0.005]
    assert over[0.005] == pytest.approx(1e-8 / 1e-7)
    assert curves.worst(over, 0.0) == (pytest.approx(0.1), "at every step of RK4")
    assert curves.worst({0.01: 3.0, 0.001: 0.2}, 0.0) == (3.0, "ours is better at steps of RK4 of 1 ms")
    assert curves.worst({0.01: 3.0, 1e-4: 5.0}, 1e-3) == (3.0, "at no step of RK4")


@pytest.mark.parametrize("make", [lambda: scenes.free_body(2.0), lambda: scenes.tree(0.2), lambda: scenes.chain(3)])
def test_every_order_converges_to_the_reference(make) -> None:
    scene = make()
    exact = scene.exact()
    errors = [curves.point(scene, curves.ours(order, 0), 0.01, exact).errors for order in (2, 4, 6)]
    key = "attitude" if scene.name == "free body" else "position"
    first, second, third = (e[key] for e in errors)
    assert 1e-7 < first < 1e-1 and second < 1e-1 * first and third < 1e-1 * second + 1e-11
    assert all(e["energy"] < 1e-2 for e in errors)
    if scene.floating:
        assert max(errors[1]["momentum"], errors[1]["angular"], errors[2]["angular"]) < 1e-12


def test_errors_below_the_effect_of_rounding_count_as_equal() -> None:
    floors = curves.floors(scenes.free_body(10.0))
    assert 1e-11 < floors["attitude"] < 1e-8 and floors["angular"] < 1e-11
    ours, peer = {"dojo-opt": points((1e-3, 2e-10))}, {"MuJoCo RK4": points((2e-3, 1e-11))}
    assert curves.ratios(ours | peer, "MuJoCo RK4", "position")[0.01] == pytest.approx(20.0)
    assert curves.ratios(ours | peer, "MuJoCo RK4", "position", floors["attitude"])[0.01] == 1.0


@pytest.mark.slow
def test_scenes_match_the_peer_figures() -> None:
    assert scenes.tree(1.0).exact().energy[0] == pytest.approx(15.84)
    chain = scenes.chain(5)
    assert sum(body.mass for body in chain.mechanism.bodies) == pytest.approx(2.0)
    assert chain.exact().position[0, -1, 1] == pytest.approx(1.8)


def test_pieces_start_again_on_the_reference() -> None:
    cut = curves.cut(scenes.chain(2), 3, 0.1)
    errors = [cut.error(curves.ours(4, 0), h) for h in (0.05, 0.025)]
    assert 3.0 < np.log2(errors[0] / errors[1]) < 5.5


def test_lost_runs_have_infinite_errors() -> None:
    scene = scenes.chain(2)
    fast = replace(
        scene, v=np.array([500.0, 0.0]), reference=lambda q, v, t: (np.tile(q, (11, 1)), np.tile(v, (11, 1)))
    )
    lost = curves.point(fast, Ours(rounds=0, divide=False), 0.1, fast.exact())
    assert lost.errors["position"] == np.inf and "half a turn" in lost.message


def test_a_mechanism_that_an_order_refuses_is_left_out_with_the_reason() -> None:
    scene = smooth_scene.smooth(dojo.models.npendulum(2, damper=5.0), np.array([0.3, 0.1]), np.zeros(2), 0.5)
    refused = curves.point(scene, curves.ours(4, 0), 0.05, scene.exact())
    assert refused.errors["position"] == np.inf and "too fast" in refused.message


def test_the_largest_step_that_is_good_enough_is_chosen() -> None:
    trials = [
        SettingTrial(0.02, 1e-4, 1e-8, 5e-3, 1e-3, ""),
        SettingTrial(0.01, 1e-6, 1e-8, 2e-4, 2e-3, ""),
        SettingTrial(0.01, 1e-5, 1e-8, 9e-4, 2e-3, ""),
        SettingTrial(0.001, 1e-8, 1e-8, 1e-6, 2e-2, ""),
    ]
    assert robot.choose(trials) is trials[2]
    assert robot.choose(trials[:1]) is trials[0]
    assert str(trials[2]) == "h = 10 ms, kappa 1e-05, tolerance 1e-08: 0.9 mm after 0.1 s, 250 times real time"


@pytest.mark.parametrize(
    "mechanism",
    [dojo.models.quadruped(), dojo.models.cartpole(), dojo.models.raiberthopper(), dojo.models.walker()],
)
def test_starts_are_reproducible_within_limits_and_above_ground(mechanism: dojo.Mechanism) -> None:
    q, v = start.start(mechanism)
    again = start.start(mechanism)
    np.testing.assert_array_equal(q, again[0])
    np.testing.assert_array_equal(v, again[1])
    sim = dojo.Simulator(mechanism, time_step=0.01)
    assert np.abs(v).max() > 0.1
    for k, dof in enumerate(sim.model.limit_dof):
        assert sim.model.limit_sign[k] * (q[sim.model.dof_qadr[dof]] - sim.model.limit_bound[k]) > 0.0
    if mechanism.contacts:
        assert min(start.gaps(sim, q)) == pytest.approx(0.02)


@pytest.mark.slow
def test_a_robot_gets_a_recommendation() -> None:
    report = study("accuracy", quick=True, mechanism=dojo.models.raiberthopper()).run(Progress())
    rows = {row.name: row for row in report.rows}
    assert "after 0.1 s" in rows["recommended time step"].note
    h, kappa = rows["recommended time step"].value / 1e3, rows["recommended kappa"].value
    assert report.summary.startswith(f"Use dojo.Simulator(mechanism, time_step={h:g}, kappa={kappa:g}): ")
    assert any("smaller steps need a smaller kappa" in note for note in report.notes)
    target = rows["its error after 0.1 s"].bar / 1e3
    exact = [(t["time_step"], t["kappa"]) for t in report.details["trials"] if t["error"] <= target]
    assert (h, kappa) == pytest.approx(max(exact)) and min(exact) < max(exact)
    assert [table.title for table in report.tables] == [
        "With contacts and limits",
        "Without contacts and limits, against the ODE",
    ]
    assert report.figure is not None and len(report.details["trials"]) > 5


@pytest.mark.slow
def test_a_robot_without_contacts_and_limits_is_measured_too() -> None:
    report = study("accuracy", quick=True, mechanism=dojo.models.npendulum(2)).run(Progress())
    assert len(report.tables) == 1 and not report.notes and len(report.figure.axes) == 2
    assert "times real time" in report.rows[0].note


@pytest.mark.slow
def test_a_robot_that_the_reference_does_not_know_is_compared_with_itself() -> None:
    report = study("accuracy", quick=True, mechanism=dojo.models.orbital(2)).run(Progress())
    assert report.rows[0].name == "recommended time step"
    assert "not compared with an independent ODE: that has no joint with two rotations ('joint_1')" in report.notes


def trial(h: float, kappa: float, error: float, message: str = "") -> robot.SettingTrial:
    return robot.SettingTrial(h, kappa, 1e-8, error, 0.05, message)


def test_advice_follows_from_the_trials() -> None:
    fine, rough = trial(1e-3, 1e-6, 8e-4), trial(2e-2, 1e-4, 6e-3)
    assert "time_step=0.001, kappa=1e-06): 0.8 mm off" in advice.recommendation(fine, 1e-3, 1e-5)
    assert "meets the target, 1 mm. The best one is" in advice.recommendation(rough, 1e-3, 1e-5)
    assert "the target, 4 mm, twice the change of the converged motion" in advice.recommendation(rough, 4e-3, 2e-3)
    lost = trial(1e-3, 1e-6, np.inf, "step 3 was not solved")
    assert advice.recommendation(lost, 1e-3, 1e-5).endswith("to its end: step 3 was not solved")
    hopper = advice.hints(dojo.models.raiberthopper(), fine, [fine, rough], robot.choose)
    assert "For planning, if 6 mm" in hopper[0] and "time_step=0.02 and kappa=0.0001" in hopper[0]
    alone = advice.hints(dojo.models.raiberthopper(), fine, [fine], robot.choose)
    assert len(alone) == 1 and "kappa/(gap h)" in alone[0]
    arm = advice.hints(dojo.models.npendulum(2), fine, [fine, rough], robot.choose)
    assert len(arm) == 1 and "has no contacts" in arm[0]
    flier = advice.hints(replace(dojo.models.raiberthopper(), contacts=()), fine, [fine], robot.choose)
    assert "has no contacts" in flier[0] and "--contacts LINK" in flier[1]


def test_features_unknown_to_the_reference_are_named() -> None:
    assert smooth_scene.not_in_reference(dojo.models.fourbar()).startswith("loop (")
    assert smooth_scene.not_in_reference(dojo.models.quadruped()) == ""
