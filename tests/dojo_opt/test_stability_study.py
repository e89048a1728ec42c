"""The stability study: rules that can be missed, refusals that have to be made, trials that pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines import Ours, Run
from benchmarks.studies.stability import StabilityStudy
from benchmarks.studies.stability import body_trials as bodies
from benchmarks.studies.stability import chain_trials as chains
from benchmarks.studies.stability import ground_trials as ground
from benchmarks.studies.stability import joint_trials as joints
from benchmarks.studies.stability import stability_study as study
from dojo_opt.report import Progress
from dojo_opt.report.stability.robot_trials import robot_trials
from dojo_opt.report.stability.trial import StabilityTrial

OURS = Ours(kappa=1e-10, rounds=1)
PASSING = {
    "a million on one": ground.on_a_foot(1e6, 1e-2),
    "a box at 100 m/s": ground.impact("box", 1e-3),
    "half a second": ground.drop(0.5, 20.0),
    "friction 10": ground.friction(10.0),
    "a plate on 100": ground.plate(100, 1e-2),
    "a milligram": ground.small(1e-3, 1e-6),
    "deep overlap": ground.overlap(0.5),
    "1e8 N/m": joints.spring(1e8, 1e-2),
    "1e8 N/m at half a second": joints.spring(1e8, 0.5),
    "1e8 N m/rad on a ball joint": joints.turning_spring("spherical", 1e8, 1e-2),
    "1e6 N s/m": joints.damper(1e6, 1e-2),
    "jammed": joints.jammed_fingers(),
    "straight legs": joints.straight_legs(0.0),
    "1000 rad/s": bodies.spin((0.1, 0.2, 0.3), (2.0, 1000.0, 2.0), 1e-3),
    "10 rad per step": bodies.spin((0.1, 0.2, 0.3), (2.0, 1000.0, 2.0), 1e-2, refusal="half a turn"),
    "30 rad per step, divided": bodies.spin((0.1, 0.2, 0.3), (2.0, 3000.0, 2.0), 1e-2),
    "a tip 50,000 times heavier": chains.heavy_tip(5e4, 2e-4, angle=0.5),
    "100 links on the ground": chains.on_the_ground(1e-2),
}


def ours(trial: StabilityTrial) -> Run:
    return trial.run(
        replace(OURS, tolerance=trial.tolerance, divide=not trial.refusal, kappa=trial.kappa or OURS.kappa)
    )


@pytest.mark.parametrize("name", PASSING)
def test_trials_pass(name: str) -> None:
    run = ours(PASSING[name])
    verdict = PASSING[name].judge(run, ours=True)
    assert verdict.passed, (verdict, run.message)


def test_rules_fail_when_the_physics_is_wrong() -> None:
    """A damped spring loses its amplitude, a softer kappa holds the load too high, a coarse tolerance loses momentum."""
    spring = replace(joints.spring(1e2, 1e-2), mechanism=joints.slider(spring=1e2, damper=1.0))
    assert not spring.judge(ours(spring), ours=True).passed
    foot = replace(ground.on_a_foot(1e2, 1e-3), kappa=1e-2)
    assert not foot.judge(ours(foot), ours=True).passed
    spin = replace(bodies.spin((0.1, 0.2, 0.3), (2.0, 1000.0, 2.0), 1e-3), tolerance=1e-4)
    assert not spin.judge(ours(spin), ours=True).passed


def test_a_representable_step_is_not_refused_and_a_stop_does_not_pass() -> None:
    gentle = bodies.spin((0.1, 0.2, 0.3), (0.0, 1.0, 0.0), 1e-2, refusal="half a turn")
    verdict = gentle.judge(ours(gentle), ours=True)
    assert not verdict.passed and verdict.text == "not refused" and np.isnan(verdict.value)
    tip = chains.heavy_tip(5e4, 1e-3, angle=np.pi / 2.0)
    verdict = tip.judge(tip.run(replace(OURS, divide=False)), ours=True)
    assert not verdict.passed and verdict.text.startswith("failed at")


def test_a_chain_beyond_the_limit_of_the_time_step_says_so() -> None:
    """h = 2.2/omega of a light link under the weight of the tip, and a fifth of it."""
    omega = 2.0 * np.sqrt(0.2 * 5e4 * 9.81 / (0.2 * 0.2))
    steps = [2e-5 * round(factor / omega / 2e-5) for factor in (2.2, 0.4)]
    found = [chains.heavy_tip(5e4, h, angle=0.5) for h in steps]
    found = [replace(trial, duration=500 * trial.time_step, samples=100) for trial in found]
    found = [replace(trial, refusal="tolerance") for trial in found]  # whole steps
    assert [ours(trial).message == "" for trial in found] == [False, True]


def test_trials_of_a_robot_and_their_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "installed", list)
    mechanism = dojo.models.raiberthopper()
    report = StabilityStudy(quick=True, mechanism=mechanism).run(Progress())
    assert len(report.rows) == len(robot_trials(mechanism)) + 1
    assert report.notes[0].startswith(mechanism.name) and report.figure is not None
    pendulum = StabilityStudy(quick=True, mechanism=dojo.models.npendulum(3)).run(Progress())
    assert pendulum.met() and "stable up to a time step of 50 ms" in pendulum.notes[0]
