"""The study `planning`: plans are judged by their replays, settings by all variants of a problem."""

from __future__ import annotations

import json
from importlib.util import find_spec

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines.mujoco_ilqr import MujocoIlqr, MujocoSettings
from benchmarks.studies.planning import PlanningStudy, setting_families
from benchmarks.studies.planning import planners as measure
from benchmarks.studies.planning import planning_cases as cases
from benchmarks.studies.planning.planners import PlanOutcome
from benchmarks.studies.planning.planning_cases import Setting
from dojo_opt.planning.options import Options, Stage
from dojo_opt.report import Progress

needs_mujoco = pytest.mark.skipif(find_spec("mujoco") is None, reason="needs MuJoCo")


def test_a_plan_that_exploits_soft_contact_is_detected():
    """At kappa 1e-2 the ground pulls a block up that it does not touch: the plan counts as solved, and does not hold."""
    problem = dojo.problems.block("up")
    soft = measure.ours(problem, stages=(Stage(1e-2, 1e-2),))
    assert soft.success and soft.violation <= 1e-3
    assert soft.hard[1] > setting_families.TRUE
    true = measure.ours(problem)
    assert true.success and true.hard[1] < 1.1e-3 and true.hard[0] == pytest.approx(true.cost, rel=1e-3)


def test_the_history_ends_with_the_plan():
    plan = measure.ours(dojo.problems.block("right"), rounds=2)
    assert plan.history.shape == (plan.iterations, 4)
    assert np.all(np.diff(plan.history[:, 0]) > 0.0)
    assert 0.0 < plan.history[0, 0] < plan.history[-1, 0] <= plan.seconds
    assert plan.history[-1, 1] == pytest.approx(plan.cost)
    assert plan.history[-1, 2] == pytest.approx(plan.violation)


def test_finer_steps_keep_the_problem():
    coarse = dojo.problems.block("up")
    fine = cases.finer(coarse, 5)
    assert fine.knot_time == pytest.approx(coarse.knot_time)
    assert fine.sim.time_step == pytest.approx(coarse.sim.time_step / 5)
    xs, us = np.tile(coarse.start, (11, 1)), np.ones((10, 3))
    assert fine.cost(xs, us) == coarse.cost(xs, us)
    assert fine.violation(xs, us) == coarse.violation(xs, us) == pytest.approx(1.0)


def test_settings_differ_from_the_default_in_one_thing():
    every = cases.settings(quick=False)
    assert every[0].options == {}
    assert len({(s.group, s.name) for s in every}) == len(every) > 20
    for setting in every:
        Options(**setting.options)
    assert {s.name for s in cases.settings(quick=True)} < {s.name for s in every}


def outcome(cost: float, *, success: bool = True, replayed: float = 1e-4, seconds: float = 1.0) -> PlanOutcome:
    found = ("", 10, cost, 1e-4, seconds, (cost, replayed), (cost, replayed), 1.0, np.zeros((0, 4)))
    return PlanOutcome("planner", "setting", success, *found)


def test_scores_count_solved_true_and_good_plans():
    a, b = Setting("default", "default", {}), Setting("solver", "other", {})
    first = [outcome(1.0), outcome(2.0, success=False), outcome(5.0), outcome(0.1, replayed=np.nan)]
    second = [outcome(1.05, seconds=3.0), outcome(1.0), outcome(3.0), outcome(4.0, replayed=1.0)]
    x, y = setting_families.score("name", [None] * 4, [(a, first), (b, second)])
    assert (x.solved, x.true, x.good) == (3, 2, 1)
    assert (y.solved, y.true, y.good) == (4, 3, 3)
    assert x.excess == pytest.approx(0.5 * (5.0 / 3.0 - 1.0))
    assert y.excess == 0.0


@needs_mujoco
def test_mujoco_lifts_the_block_at_ten_times_the_cost():
    """Its differences see no contact that would end: it leaves the ground in the last knot."""
    problem = dojo.problems.block("up")
    plan = measure.peer(problem, MujocoSettings())
    assert plan.success and plan.violation <= 1e-3 and plan.message == ""
    assert plan.cost > 5.0 * measure.ours(problem).cost
    assert plan.history.shape == (plan.iterations, 4)
    assert plan.fine[1] < 0.1


@needs_mujoco
def test_a_lost_guess_of_mujoco_is_an_outcome():
    problem = dojo.problems.block("right")
    lost = dojo.Problem(problem.sim, problem.start, 3, cost=problem.specs[0], controls0=1e200)
    plan = measure.peer(lost, MujocoSettings(step=0.1))
    assert not plan.success and plan.message == "the rollout of the guess is lost"
    assert plan.iterations == 0 and not np.isfinite(plan.fine[0])


@needs_mujoco
def test_settings_of_the_yardstick_take_effect():
    problem = dojo.problems.block("up")
    assert MujocoIlqr(problem, MujocoSettings(step=5e-3)).substeps == 20
    assert np.all(MujocoIlqr(problem, MujocoSettings(smooth=True))._model.pair_solimp[:, 0] == 0.0)
    xs, us = np.tile(problem.start, (11, 1)), np.ones((10, 3))
    xs[:, 2] += 1.0
    one, two = (
        MujocoIlqr(problem, MujocoSettings(centered=centered))._linearize(xs, us)[0] for centered in (False, True)
    )
    assert 0.0 < np.abs(one - two).max() < 1e-5


@pytest.mark.slow
def test_the_quick_study_runs_and_plans_everything():
    report = PlanningStudy(quick=True).run(Progress())
    assert [row.name for row in report.rows if row.met is False and row.unit != "ms"] == []
    assert len(report.figure.axes) == 12
    numbers = json.loads(report.as_json())
    assert set(numbers["details"]["settings"]) == set(cases.NAMES)
    if find_spec("mujoco"):
        assert {name.rpartition(",")[0] for name in numbers["details"]["peers"]} == set(cases.NAMES)
