"""MPC: shifting, measured states, moving references, ticks that fail, and the hop in closed loop."""

import pickle

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.mpc.horizon import shift_multipliers, tail
from dojo_opt.mpc.measurement import Measurement
from dojo_opt.mpc.moving import References, Sampled
from dojo_opt.mpc.policy import Policy
from dojo_opt.mpc.tick import Settings, milliseconds
from dojo_opt.options import Options
from solvers.jit import local_kernel
from solvers.status import Status

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.05)


def standing_problem(horizon=8, **kwargs):
    start = HOPPER.neutral()
    hold = np.array([0.0, 0.0, 9.81 * 4.18])
    terms = [dojo.cost.Tracking(start, 1.0), dojo.cost.Effort(1e-4, reference=hold)]
    return dojo.Problem(HOPPER, start, horizon, cost=terms, controls0=hold, **kwargs)


def random_policy(rng, T=6, time=0.3):
    x = np.array([HOPPER.integrate(HOPPER.neutral(), 0.3 * rng.standard_normal(HOPPER.ndx)) for _ in range(T + 1)])
    return Policy(HOPPER, time, x, rng.standard_normal((T, 3)), rng.standard_normal((T, 3, 14)))


def repeat_last(policy):
    return lambda count: (np.repeat(policy.x[-1:], count, axis=0), np.repeat(policy.u[-1:], count, axis=0))


def test_shift_by_whole_knots_moves_the_rows():
    policy = random_policy(np.random.default_rng(0))
    later = policy.shifted(0.3 + 2 * 0.05, repeat_last(policy))
    np.testing.assert_array_equal(later.x[:5], policy.x[2:])
    np.testing.assert_array_equal(later.u[:4], policy.u[2:])
    np.testing.assert_array_equal(later.K[:4], policy.K[2:])
    np.testing.assert_array_equal(later.u[4:], policy.u[-1:].repeat(2, axis=0))
    assert later.time == pytest.approx(0.4)


def test_shift_between_knots_keeps_the_impulse_and_stays_on_the_manifold():
    policy = random_policy(np.random.default_rng(1))
    later = policy.shifted(0.3 + 0.3 * 0.05, repeat_last(policy))
    np.testing.assert_allclose(later.u[:5], 0.7 * policy.u[:-1] + 0.3 * policy.u[1:], rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(later.x[:, 3:7], axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(
        HOPPER.difference(later.x[:-1], policy.x[:-1]), 0.3 * HOPPER.difference(policy.x[1:], policy.x[:-1]), atol=1e-9
    )
    for i in range(6):  # the state of the shifted plan at its knots is that of the old plan at that time
        np.testing.assert_allclose(later.x[i], policy.state(later.time + 0.05 * i), atol=1e-9)


def test_shift_by_nothing_is_the_same_plan():
    policy = random_policy(np.random.default_rng(2))
    assert policy.shifted(policy.time + 1e-12, repeat_last(policy)) is policy


def test_inputs_act_from_half_a_step_before_their_knot():
    policy = random_policy(np.random.default_rng(3), time=0.0)
    assert [policy.index(t) for t in (0.0, 0.024, 0.026, 0.074, 0.076, 9.0)] == [0, 0, 1, 1, 2, 5]


def test_feedback_is_zero_on_the_plan_and_linear_off_it():
    policy = random_policy(np.random.default_rng(4))
    on = policy.state(0.42)
    np.testing.assert_allclose(policy.feedback(0.42, on), 0.0, atol=1e-12)
    dx = 1e-3 * np.random.default_rng(5).standard_normal(14)
    np.testing.assert_allclose(policy.feedback(0.42, HOPPER.integrate(on, dx)), policy.K[2] @ dx, atol=1e-9)


def test_lead_of_a_delayed_plan_runs_from_the_measured_state_to_its_first():
    policy = random_policy(np.random.default_rng(6))
    before = HOPPER.neutral()
    late = Policy(HOPPER, 0.3, policy.x, policy.u, policy.K, 1, (0.28, before))
    np.testing.assert_allclose(late.state(0.28), before, atol=1e-12)
    np.testing.assert_allclose(late.state(0.3), policy.x[0], atol=1e-12)
    half = HOPPER.integrate(before, 0.5 * HOPPER.difference(policy.x[0], before))
    np.testing.assert_allclose(late.state(0.29), half, atol=1e-9)


def test_measured_velocity_becomes_the_mean_one_of_a_model_step():
    """In free fall the mean velocity of the last 50 ms is g/2 (50 ms) above the present one."""
    plant = HOPPER.replace(time_step=1e-3, kappa=1e-8)
    x = HOPPER.neutral()
    x[2] += 2.0
    fall = plant.rollout(plant.start(x[:8], np.zeros(7)), np.zeros((100, 3)), throw=True)
    measured = Measurement(HOPPER)
    for t, state in zip(fall.time, fall.x, strict=True):
        measured.add(float(t), state)
    now = measured.state()
    assert now[10] == pytest.approx(-9.81 * 0.075, abs=1e-6)
    assert fall.x[-1, 10] == pytest.approx(-9.81 * 0.0995, abs=1e-6)
    np.testing.assert_array_equal(now[:8], fall.x[-1, :8])
    assert Measurement(HOPPER, mean=False)._mean is False


def test_measured_velocity_is_left_alone_when_no_sample_is_a_model_step_old():
    measured = Measurement(HOPPER)
    x = HOPPER.neutral()
    x[8] = 0.7
    measured.add(0.0, x)
    assert measured.state()[8] == 0.7
    measured.add(0.2, x)
    assert measured.state()[8] == 0.7


def test_prediction_over_the_delay_ends_a_free_fall_where_it_ends():
    problem = standing_problem()
    mpc = dojo.MPC(problem, delay=0.02)
    plant = HOPPER.replace(time_step=1e-3, kappa=1e-8)
    x = HOPPER.neutral()
    x[2] += 2.0
    fall = plant.rollout(plant.start(x[:8], np.zeros(7)), np.zeros((100, 3)), throw=True)
    for t, state in zip(fall.time[:81], fall.x[:81], strict=True):
        mpc._measured.add(float(t), state)
    mpc._first_input = np.zeros(3)
    ahead = mpc._ahead(0.08)
    assert ahead[2] == pytest.approx(fall.x[-1, 2], abs=1e-6)
    assert ahead[10] == pytest.approx(-9.81 * 0.075, abs=1e-4)


def test_sampled_goes_round_with_its_advance():
    time = np.array([0.0, 0.1, 0.2])
    rows = np.tile(HOPPER.neutral(), (3, 1))
    rows[:, 0] = [0.0, 0.03, 0.1]
    cycle = np.zeros(14)
    cycle[0] = 0.1
    path = Sampled(time, rows, HOPPER, cycle)
    np.testing.assert_allclose(path([0.05, 0.2, 0.3, 1.05, -0.1])[:, 0], [0.015, 0.1, 0.13, 0.515, -0.07], atol=1e-12)
    held = Sampled(time, rows, HOPPER)
    np.testing.assert_allclose(held([0.15, 5.0])[:, 0], [0.065, 0.1], atol=1e-12)
    numbers = Sampled(time, np.array([[0.0], [1.0], [0.0]]), cycle=np.zeros(1))
    np.testing.assert_allclose(numbers([0.05, 0.25])[:, 0], [0.5, 0.5], atol=1e-12)


def test_sampled_velocities_over_the_step_of_a_model():
    time = np.array([0.0, 0.1, 0.2])
    rows = np.tile(HOPPER.neutral(), (3, 1))
    rows[:, 0] = [0.0, 0.03, 0.1]
    cycle = np.zeros(14)
    cycle[0] = 0.1
    mean = Sampled(time, rows, HOPPER, cycle).over(0.05)
    np.testing.assert_allclose(mean.rows[:, 8], [0.7, 0.3, 0.7], atol=1e-9)


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ({5: lambda t: np.zeros((len(t), 15))}, "index of a cost, 0 to 1"),
        (lambda t: np.zeros((len(t), 3)), r"expected shape \(9, 15\), got \(9, 3\)"),
        (np.zeros((4, 3)), r"expected shape \(any, 15\)"),
        (lambda t: np.full((len(t), 15), np.nan), "expected finite numbers"),
    ],
)
def test_references_are_checked_at_the_border(reference, message):
    with pytest.raises(ValueError, match=message):
        dojo.MPC(standing_problem(), reference=reference)


def test_references_move_with_time_and_with_the_ground():
    problem = standing_problem()
    moved = dojo.MPC(problem)  # MPC's own terms; those of the user's problem stay
    references = References(moved.problem, {0: Sampled([0.0, 1.0], _ahead(1.0), HOPPER), 1: np.zeros((3, 3))})
    references.move(0.5, 0.02)
    term = moved.problem.costs[0]
    np.testing.assert_allclose(term.reference[:, 0], 0.5 + 0.05 * np.arange(9), atol=1e-12)
    np.testing.assert_allclose(term.reference[:, 2], 0.57, atol=1e-12)
    np.testing.assert_array_equal(moved.problem.costs[1].reference, 0.0)
    np.testing.assert_array_equal(problem.costs[0].reference, np.tile(HOPPER.neutral(), (9, 1)))


def _ahead(distance):
    rows = np.tile(HOPPER.neutral(), (2, 1))
    rows[1, 0] += distance
    return rows


def test_tail_follows_the_reference_or_the_last_input():
    problem = standing_problem()
    rng = np.random.default_rng(7)
    policy = random_policy(rng, T=8, time=0.0)
    moving = References(problem, Sampled([0.0, 1.0], _ahead(1.0), HOPPER))
    xs, us = tail(policy, moving, 2)
    np.testing.assert_allclose(xs[:, 0] - policy.x[-1, 0], [0.05, 0.1], atol=1e-9)
    np.testing.assert_array_equal(us, policy.u[-1:].repeat(2, axis=0))
    calm = Policy(HOPPER, 0.0, np.tile(problem.start, (9, 1)), problem.controls0, np.zeros((8, 3, 14)))
    xs, _ = tail(calm, References(problem, None), 2)
    roll = HOPPER.rollout(problem.start, problem.controls0[:2]).x
    np.testing.assert_allclose(xs, roll[1:], atol=1e-12)


def test_multipliers_move_with_the_horizon_and_a_terminal_one_stays():
    goal = dojo.constraint.Goal(HOPPER.neutral())
    bounds = dojo.constraint.ControlBounds(-1.0, 1.0)
    problem = standing_problem(constraints=[goal, bounds])
    terminal, path = problem.constraints
    terminal.slope[:] = 3.0
    path.slope[:] = np.arange(8.0)[:, None]
    shift_multipliers(problem.constraints, 1.25)
    np.testing.assert_array_equal(terminal.slope, 3.0)
    np.testing.assert_allclose(path.slope[:, 0], [1.25, 2.25, 3.25, 4.25, 5.25, 6.25, 7.0, 7.0])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"guess": "rollout"}, "guess"),
        ({"kappa": 0.0}, "kappa"),
        ({"delay": -0.1}, "delay"),
        ({"period": 0.0}, "period"),
        ({"gain_scale": float("nan")}, "gain_scale"),
    ],
)
def test_settings_are_checked(settings, message):
    with pytest.raises(ValueError, match=message):
        Settings(**settings)


def test_calls_are_checked():
    mpc = dojo.MPC(standing_problem())
    with pytest.raises(ValueError, match=r"MPC\(x\): expected shape \(15,\)"):
        mpc(0.0, np.zeros(3))
    with pytest.raises(ValueError, match=r"MPC\(time\)"):
        mpc(np.nan, HOPPER.neutral())
    with pytest.raises(ValueError, match="whole number"):
        dojo.MPC(standing_problem(), iterations=0)


def test_plans_once_per_period_and_one_iteration_each():
    mpc = dojo.MPC(standing_problem())
    plant = dojo.Plant(HOPPER.replace(time_step=0.01, kappa=1e-8))
    loop = dojo.closed_loop(mpc, plant, 0.5)
    assert loop.survived
    np.testing.assert_allclose([t.time for t in mpc.log], 0.05 * np.arange(10), atol=1e-9)
    assert mpc.log[0].first and not any(t.first for t in mpc.log[1:])
    assert all(t.iterations <= 1 for t in mpc.log[1:])
    assert milliseconds(mpc.log).shape == (9,)
    assert all(t.contacts == ("foot",) for t in mpc.log)
    assert mpc.log[3].error.shape == (7,)
    assert np.abs(loop.x[-1, :8] - HOPPER.neutral()[:8]).max() < 5e-3


def test_runs_are_the_same_again_and_after_pickling():
    mpc = dojo.MPC(standing_problem(), period=0.025)
    plant = dojo.Plant(HOPPER.replace(time_step=0.005, kappa=1e-8), offset=0.1 * np.eye(14)[7], noise=1e-4, seed=3)
    first = dojo.closed_loop(mpc, plant, 0.3)
    again = dojo.closed_loop(mpc, plant, 0.3)
    np.testing.assert_array_equal(first.x, again.x)
    fresh = dojo.closed_loop(mpc.fresh(), plant, 0.3)
    np.testing.assert_array_equal(first.x, fresh.x)
    copied = dojo.closed_loop(pickle.loads(pickle.dumps(mpc)), plant, 0.3)
    np.testing.assert_array_equal(first.x, copied.x)


def test_problems_with_compiled_residuals_can_be_sent_to_other_processes():
    def height(x, u, out):
        out[0] = x[2] * u[2]

    problem = standing_problem()
    terms = [*problem.specs[0], dojo.cost.ResidualCost(local_kernel(height), 1)]
    problem = dojo.Problem(HOPPER, problem.start, 8, cost=terms, controls0=problem.controls0)
    xs = np.tile(problem.start, (9, 1))
    copied = pickle.loads(pickle.dumps(problem))
    assert copied.cost(xs, copied.controls0) == problem.cost(xs, problem.controls0) > 100.0
    assert copied.costs[0].reference is not problem.costs[0].reference


def test_a_tick_without_time_keeps_the_old_plan():
    mpc = dojo.MPC(standing_problem(), time_limit=1e-9)
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    u = mpc(0.05, HOPPER.integrate(x, 1e-3 * np.ones(14)))
    assert mpc.log[-1].fallback and mpc.log[-1].status == Status.TIME_LIMIT
    assert mpc.policy is before
    measured = mpc.log[-1].x
    np.testing.assert_allclose(u, before.control(0.05) + before.feedback(0.05, measured), rtol=1e-12)


def test_a_model_that_cannot_be_solved_keeps_the_old_plan():
    mpc = dojo.MPC(standing_problem(), mean_velocity=False)
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    wild = x.copy()
    wild[11:14] = [300.0, 0.0, 0.0]  # more than half a turn per step
    u = mpc(0.05, wild)
    assert mpc.log[-1].fallback
    assert mpc.policy is before
    assert np.isfinite(u).all()


def test_a_rejected_step_keeps_the_old_plan():
    """No step is short enough and no decrease large enough, and the gains do not lead back to the plan either."""
    mpc = dojo.MPC(standing_problem(), options=Options(halvings=0, armijo=1e9, ascent=0.0, penalty_growth=1.0))
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    mpc(0.05, HOPPER.integrate(x, 0.05 * np.eye(14)[0]))
    assert mpc.log[-1].fallback and mpc.log[-1].alpha == 0.0
    assert mpc.policy is before


def test_a_rejected_step_near_the_plan_rolls_it_out_with_its_gains():
    mpc = dojo.MPC(standing_problem(), options=Options(halvings=0, armijo=1e9, ascent=0.0, penalty_growth=1.0))
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    mpc(0.05, HOPPER.integrate(x, 1e-4 * np.eye(14)[0]))
    assert mpc.log[-1].fallback and mpc.log[-1].alpha == 0.0
    now = mpc.policy
    assert now is not before and now.time == 0.05
    np.testing.assert_array_equal(now.x[0], mpc.log[-1].x)
    again = HOPPER.closed_loop(now.x[0], now.u, kappa=mpc.settings.kappa).x
    np.testing.assert_allclose(again, now.x, rtol=1e-6, atol=1e-6)


def test_first_plan_can_be_given_and_has_to_fit():
    problem = standing_problem()
    plan = dojo.ilqr(problem)
    mpc = dojo.MPC(problem, plan=plan)
    mpc(0.0, problem.start)
    np.testing.assert_array_equal(mpc.policy.u, plan.u)
    wrong = dojo.MPC(standing_problem(horizon=5), plan=plan)
    with pytest.raises(ValueError, match=r"MPC\(plan=...\): expected inputs of shape \(5, 3\), got \(8, 3\)"):
        wrong(0.0, problem.start)


def test_limits_hold_for_feedback_too():
    mpc = dojo.MPC(standing_problem(control_limits=([-1.0, -1.0, 0.0], [1.0, 1.0, 45.0])))
    x = HOPPER.neutral()
    mpc(0.0, x)
    far = HOPPER.integrate(x, np.concatenate([[0, 0, -0.1, 0.3, 0.3, 0], np.zeros(8)]))
    u = mpc(0.01, far)
    assert np.all(np.abs(u[:2]) <= 1.0) and 0.0 <= u[2] <= 45.0
    assert np.any(np.abs(u[:2]) == 1.0) or u[2] in (0.0, 45.0)


def test_constraints_hold_in_closed_loop():
    """The leg lifts the body by 5 cm: with 100 N at once, or with the 45 N that a constraint allows."""
    start = HOPPER.neutral()
    raised = start.copy()
    raised[[2, 7]] += 0.05
    hold = np.array([0.0, 0.0, 9.81 * 4.18])
    tracking = dojo.cost.Tracking(raised, np.r_[10.0 * np.ones(7), 0.01 * np.ones(7)])
    largest = []
    for constraints in ([], [dojo.constraint.ControlBounds(-np.inf, 45.0, components=[2])]):
        costs = [tracking, dojo.cost.Effort(1e-6, reference=hold)]
        problem = dojo.Problem(HOPPER, start, 8, cost=costs, constraints=constraints, controls0=hold)
        mpc = dojo.MPC(problem, iterations=3, gain_scale=0.0)
        loop = dojo.closed_loop(mpc, dojo.Plant(HOPPER.replace(time_step=5e-3, kappa=1e-8)), 1.0)
        assert loop.x[-1, 2] == pytest.approx(0.6, abs=2e-3)
        largest.append(loop.u[:, 2].max())
    assert largest[0] > 90.0 and largest[1] < 50.0  # the penalty of a tick is not the last word


@pytest.mark.parametrize("guess", ["states", "feedback", "open loop"])
def test_every_guess_keeps_the_hopper_standing(guess):
    mpc = dojo.MPC(standing_problem(), guess=guess)
    plant = dojo.Plant(HOPPER.replace(time_step=0.005, kappa=1e-8), offset=0.05 * np.eye(14)[7])
    assert dojo.closed_loop(mpc, plant, 0.4).survived


def test_hopper_hops_and_survives_a_payload_that_the_open_loop_guess_does_not():
    """Planning facts, section 2.6: what a tick starts from decides."""
    mpc = dojo.tasks.hopper_mpc()
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, payload=2.35), 2.0)
    assert loop.survived, loop.message
    assert loop.rms() < 0.08
    foot = mpc.sim.maximal(loop.x)[:, 1, 2] - 0.05
    assert foot.max() > 0.1, "it does not hop"
    control = dojo.tasks.hopper_mpc(guess="open loop")
    assert not dojo.closed_loop(control, dojo.tasks.plant(control, 2e-3, payload=2.35), 2.0).survived
