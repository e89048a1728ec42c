"""Policy: shifting a plan, its inputs, feedback, and lead."""

import numpy as np
import pytest

from dojo_opt.mpc.policy import Policy
from support.standing_hopper import HOPPER, random_policy


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
    for i in range(6):  # at its knots the shifted plan has the state of the old plan at that time
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
