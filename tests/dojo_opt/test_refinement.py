"""Refinement by accuracy: time steps are divided until the replay of a plan agrees with it."""

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.planning import refinement
from dojo_opt.planning.multi_start import of_problem
from dojo_opt.planning.options import Options
from dojo_opt.planning.refinement import replay_error
from dojo_opt.problems import hop
from sim.simulator.results import Interrupted


def asked(accuracy, **settings):
    """A hop with a refined accuracy [m, rad]."""
    problem = hop()
    problem.refined_accuracy = accuracy
    for name, value in settings.items():
        setattr(problem, name, value)
    return problem


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.05, 0.015])
def test_steps_are_as_short_as_the_replay_needs(accuracy):
    problem = asked(accuracy)
    plan = dojo.ilqr(problem)
    assert plan.success and len(plan.u) == problem.horizon and plan.nit == len(plan.history)
    assert replay_error(plan) <= accuracy
    longer = dojo.ilqr(hop())
    for count in [2**k for k in range(1, 6) if 2**k < plan.substeps]:  # all of these are too long
        assert replay_error(longer) > accuracy
        longer = dojo.ilqr(problem.refined(count), warm_start=longer)
    replay = plan.replay(accuracy=1e-5)
    assert np.abs(replay.x[:, :7] - plan.x[:, :7]).max() <= 1.5 * accuracy  # seen by hand, quaternions as numbers


def test_a_plan_that_is_good_enough_is_kept():
    plan, same = dojo.ilqr(asked(1.0)), dojo.ilqr(hop())
    assert plan.success and plan.substeps == 1
    np.testing.assert_array_equal(plan.x, same.x)


def test_the_refinement_is_the_first_that_is_tried_and_its_constraints_hold():
    assert dojo.ilqr(asked(1.0, refinement=3)).substeps == 3
    goal = dojo.constraint.StateBounds(-np.inf, 10.0, components="body z", knots=10)
    plan = dojo.ilqr(asked(1.0, refined_constraints=(goal,)))
    assert plan.substeps == 2 and len(plan.multipliers) == len(dojo.ilqr(hop()).multipliers) + 1


@pytest.mark.parametrize("harder", [True, False])
def test_a_refinement_that_fails_is_tried_again_by_hard_stages(harder):
    """From the plan before; all iterations count, and the first end is that of the solve if both fail."""
    plan, tries = dojo.ilqr(hop()), []

    def solve(finer, last, options):
        tries.append((last, len(options.stages), options.max_iterations))
        success = len(tries) == 2 and harder
        status = dojo.Status.SOLVED if success else dojo.Status.LINE_SEARCH
        return replace(last, success=success, status=status, nit=7 * len(tries), fun=float(len(tries)))

    options = Options()
    found = refinement.refine(asked(None, refinement=2), plan, options, solve)
    most = options.max_iterations - plan.nit
    assert tries == [(plan, 4, most), (plan, 2, most - 7)]
    assert found.success == harder and found.fun == (2.0 if harder else 1.0) and found.nit == plan.nit + 21


def test_a_replay_that_stays_apart_is_no_success(monkeypatch):
    monkeypatch.setattr(refinement, "_MOST", 2)
    plan = dojo.ilqr(asked(1e-3))
    assert not plan.success and plan.status == dojo.Status.ACCURACY_NOT_REACHED
    assert plan.substeps == 2 and plan.message.startswith("The replay does not agree with the plan: ")
    assert plan.message.endswith(" apart, asked 0.001.")


def test_limits_are_those_of_all_solves_together(monkeypatch):
    first = dojo.ilqr(hop())
    plan = dojo.ilqr(asked(0.015), max_iterations=first.nit + 2)
    assert (plan.status, plan.nit) == (dojo.Status.MAX_ITERATIONS, first.nit + 2) and plan.substeps == 2
    none = dojo.ilqr(asked(0.015), max_iterations=first.nit)
    assert (none.status, none.nit, none.substeps) == (dojo.Status.MAX_ITERATIONS, first.nit, 1)
    ended = []

    def last(plan):
        for _ in range(20):  # of half a second each
            plan.simulator.rollout(plan.x[0], steps=300_000)
        ended.append(plan)
        return 0.0

    monkeypatch.setattr(refinement, "replay_error", last)
    late = dojo.ilqr(asked(0.015), time_limit=0.5)
    assert late.status == dojo.Status.TIME_LIMIT and not late.success and not ended


def test_ctrl_c_during_a_replay_leaves_the_plan(monkeypatch):
    def interrupt(plan):
        raise KeyboardInterrupt

    monkeypatch.setattr(refinement, "replay_error", interrupt)
    with pytest.raises(Interrupted) as stopped:
        dojo.ilqr(asked(0.05))
    plan = stopped.value.result
    assert plan.status == dojo.Status.INTERRUPTED and not plan.success and len(plan.u) == 20


def test_a_plan_of_a_worker_finds_its_problem():
    problem = asked(0.05)
    plan = replace(dojo.ilqr(problem), problem=None, simulator=None)
    assert plan.substeps > 1
    found = of_problem(plan, problem)
    assert found.simulator.time_step == pytest.approx(plan.time_step) and found.problem.refined_accuracy is None


@pytest.mark.parametrize(("accuracy", "text"), [(1e-5, ">= 0.0001"), (-1.0, ">= 0.0001"), ("fine", "number")])
def test_a_wrong_accuracy_is_refused(accuracy, text):
    sim = dojo.Simulator(dojo.models.cartpole(), time_step=0.05)
    with pytest.raises((ValueError, TypeError), match=r"Problem\(refined_accuracy=\.\.\.\)") as error:
        dojo.Problem(sim, sim.neutral(), 10, refined_accuracy=accuracy)
    assert text in str(error.value)


def test_mechanisms_without_an_accuracy_are_refused():
    rough = dojo.models.cartpole()
    joint = replace(rough.joints[0], friction=0.1)
    sim = dojo.Simulator(replace(rough, joints=(joint, *rough.joints[1:])), time_step=0.05)
    with pytest.raises(ValueError, match="dry friction"):
        dojo.Problem(sim, sim.neutral(), 10, refined_accuracy=0.01)


def test_plans_and_controllers_run_at_an_accuracy():
    """Knots of 50 ms, each simulated to 1e-5: the plan is its own replay, on steps of order 2 it is not."""
    fixed = dojo.problems.swingup("pendulum")
    cost, constraints = fixed.specs
    limits, sim = fixed.control_limits, fixed.sim.replace(accuracy=1e-5)
    problem = dojo.Problem(
        sim,
        fixed.start,
        fixed.horizon,
        cost=cost,
        constraints=constraints,
        control_limits=limits,
        refined_accuracy=1e-3,
    )
    plan = dojo.ilqr(problem)
    assert plan.success and plan.substeps == 1 and plan.time_step == 0.05
    assert replay_error(plan) < 1e-9 < 1e-4 < replay_error(dojo.ilqr(fixed))
    loop = dojo.closed_loop(dojo.MPC(problem), dojo.Plant(sim), 0.25)
    assert loop.message.startswith("Ran to the end") and loop.x[-1][0] > 0.1
