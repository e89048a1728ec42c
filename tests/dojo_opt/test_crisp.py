"""Planar tasks of CRISP, as true dynamics."""

import json

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.__main__ import main
from dojo_opt.tasks.crisp import pushing


@pytest.mark.parametrize("name", ["cart_pole", "hopper", "push_box", "push_t", "waiter"])
def test_a_task_is_solved_from_zero_inputs(name):
    """Every knot of the plan is a step of the simulator, and nothing enters a wall, the table or the ground."""
    task = getattr(dojo.tasks.crisp, name)()
    assert not task.problem.controls0.any()
    plan = task.run()
    outcome = task.outcome(plan)
    assert outcome.success, outcome
    sim = task.problem.sim
    steps = [sim.rollout(x, u[None]) for x, u in zip(plan.x[:-1], plan.u, strict=True)]
    # impacts of steps with a tolerance of 1e-8 leave their velocities uncertain by 1e-5
    np.testing.assert_allclose([step.x[-1] for step in steps], plan.x[1:], atol=4e-5)
    assert min(step.contacts.gap.min() for step in steps) > -1e-6


def test_the_hopper_leaves_the_ground_and_lands_ahead():
    task = dojo.tasks.crisp.hopper()
    plan = task.run()
    contacts = task.problem.sim.rollout(plan.x[0], plan.u).contacts.gap[:, 0]
    stands = contacts < 1e-3
    assert stands.any() and not stands[0]
    assert np.flatnonzero(np.diff(stands.astype(int)) == -1).size > 0  # it lifts off again
    assert plan.u[:, 1].max() <= 0.0


def test_the_cargo_slides_by_the_friction_of_the_table_alone():
    """Below mu g the cart takes it along; above, it falls behind at the difference."""
    sim = dojo.tasks.crisp.transport().problem.sim.replace(kappa=1e-9)
    for force, slides in ((3.0 * 1.5, False), (2.0 * 3.0 + 0.2 * 9.81, True)):
        x = sim.rollout([0.0, 0.0, 0.0, 0.0], np.full((10, 1), force)).x[-1]
        acceleration = 3.0 if slides else 1.5
        assert x[2] == pytest.approx(0.2 * acceleration, rel=1e-3)
        assert x[3] == pytest.approx(0.2 * (0.2 * 9.81 - 3.0) if slides else 0.0, abs=1e-3)


def test_a_plate_is_drawn_by_a_pusher_that_presses_and_tips_under_one_that_presses_too_much():
    """Pressed by N it slides at mu N - mu' (m g - N) = (m + m') a, and at more than m g l / reach it tips."""
    sim = dojo.tasks.crisp.waiter().problem.sim.replace(kappa=1e-8, time_step=1e-3)
    start = sim.neutral()
    start[[0, 3]] = -6.0, 0.2
    press, mass, weight = 4.0, 2.0 + 1.0, 2.0 * 9.81
    force = 0.1 * (weight - press) + mass * 0.5
    x = sim.rollout(start, np.tile([force, press], (200, 1))).x[-1]
    np.testing.assert_allclose(x[[5, 8]], 0.5 * 0.2, rtol=1e-2)
    assert abs(x[2]) < 1e-5
    tipping = weight * 7.0 / (0.2 + 6.0 + 7.0)
    for share, lifts in ((0.95, False), (1.05, True)):
        x = sim.rollout(start, np.tile([0.0, share * tipping], (200, 1))).x[-1]
        assert (x[2] < -1e-4) == lifts  # its right end rises


def test_forces_at_the_ends_of_a_face_are_a_force_on_it():
    """Both together are their sum in the middle: no turn; one alone turns the box."""
    problem = dojo.tasks.crisp.push_box().problem
    sim, rest = problem.sim, pushing.flat_pose((0.0, 0.0, 0.0))
    both, one = np.zeros(sim.nu), np.zeros(sim.nu)
    both[2:4], one[2] = 10.0, 20.0
    straight, turned = (sim.rollout(rest, np.tile(u, (10, 1))).x[-1] for u in (both, one))
    assert straight[0] == pytest.approx(0.5 * (20.0 - 0.5 * 9.8) * 0.2**2, rel=0.12)  # of steps of 20 ms
    assert abs(straight[6]) < 1e-9
    assert turned[6] < -0.05


def test_a_plan_of_another_robot_has_no_outcome():
    task, plan = (getattr(dojo.tasks.crisp, name)() for name in ("cart_pole", "hopper"))
    with pytest.raises(ValueError, match=r"PlanTask\.outcome\(plan\): expected a plan of 'crisp\.cart_pole'"):
        task.outcome(dojo.ilqr(plan.problem, max_iterations=1))
    with pytest.raises(TypeError, match="expected a Plan"):
        task.outcome(plan)


def test_an_angle_is_judged_modulo_a_turn():
    judge = pushing.Placed((1.0, 2.0, 4.0), 0.01, 0.01)
    plan = type("P", (), {"x": pushing.flat_pose((1.0, 2.0, 4.0 - 2.0 * np.pi))[None]})
    assert judge(plan)[0]
    plan.x = pushing.flat_pose((1.0, 2.0, 4.1))[None]
    done, measures = judge(plan)
    assert not done
    assert measures["turned off [rad]"] == pytest.approx(0.1)


def test_a_planned_task_runs_from_the_command_line(tmp_path, capsys):
    page = tmp_path / "tee.html"
    assert main(["run", "crisp.push_t", "--json", "--html", str(page)]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["success"] and numbers["iterations"] > 0
    assert page.stat().st_size > 1000
    assert main(["run", "crisp.push_t", "--seconds", "1"]) == 2
    assert "is a plan" in capsys.readouterr().err
    assert main(["run", "crisp.push_tea"]) == 2
    assert "did you mean" in capsys.readouterr().err
