"""Horizon against the calls of Simulator: the same results, from better starts."""

import numpy as np
import pytest

import dojo_opt as dojo
from sim.simulator.horizon import Known
from solvers.status import Status

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.05)
T = 8


def trajectory(kappa=1e-4):
    rng = np.random.default_rng(0)
    us = np.array([0.0, 0.0, 4.18 * 9.81]) + rng.normal(size=(T, 3))
    return HOPPER.rollout_feedback(HOPPER.neutral(), us, kappa=kappa).x, us


def gains():
    rng = np.random.default_rng(1)
    return rng.normal(size=(T, 3)), 0.1 * rng.normal(size=(T, 3, 14)), 1e-3 * rng.normal(size=(T + 1, 14))


def counted(horizon, *given, **named):
    """A rollout, and the Newton iterations that it took."""
    before = horizon.iterations
    return horizon.roll(*given, **named), horizon.iterations - before


@pytest.mark.parametrize("alpha", [1.0, 0.5])
def test_rollouts_agree_with_the_simulator(alpha):
    xs, us = trajectory()
    k, K, gaps = gains()
    horizon = HOPPER.horizon(T, limits=(-50.0, 50.0))
    expected = HOPPER.rollout_feedback(
        xs[0], us, xs=xs, ks=k, Ks=K, gaps=gaps, alpha=alpha, limits=(-50.0, 50.0), kappa=1e-4
    )
    near = horizon.roll(xs[0], xs, us, 1e-4)
    np.testing.assert_allclose(near.x, xs, atol=2e-6)
    linear = horizon.linearize(xs, us, 1e-4)
    for known in (Known(), Known(linear), Known(linear, near.steps)):
        trial = horizon.roll(xs[0], xs, us, 1e-4, k=k, K=K, gaps=gaps, alpha=alpha, known=known)
        assert trial.status == 0 and trial.solved_knots == T
        np.testing.assert_allclose(trial.x, expected.x, atol=1e-5)
        np.testing.assert_allclose(trial.u, expected.u, atol=1e-4)


def test_known_solutions_save_iterations():
    xs, us = trajectory()
    horizon = HOPPER.horizon(T)
    near, linear = horizon.roll(xs[0], xs, us, 1e-4), horizon.linearize(xs, us, 1e-4)
    k = np.full((T, 3), 0.01)
    _, alone = counted(horizon, xs[0], xs, us, 1e-4, k=k)
    _, helped = counted(horizon, xs[0], xs, us, 1e-4, k=k, known=Known(linear, near.steps))
    assert helped <= 2 * T and helped < alone


def test_a_rollout_of_no_change_takes_one_iteration_per_step():
    xs, us = trajectory(1e-6)
    horizon = HOPPER.horizon(T)
    near = horizon.roll(xs[0], xs, us, 1e-6)
    again, iterations = counted(horizon, xs[0], near.x, us, 1e-6, known=Known(steps=near.steps))
    assert iterations == T
    np.testing.assert_allclose(again.x, near.x, atol=1e-6)


def test_a_limit_of_iterations_holds_for_one_rollout():
    xs, us = trajectory()
    horizon = HOPPER.horizon(T)
    whole, usual = counted(horizon, xs[0], xs, us, 1e-6)
    stopped, iterations = counted(horizon, xs[0], xs, us, 1e-6, max_iterations=1)
    again, later = counted(horizon, xs[0], xs, us, 1e-6)
    assert (stopped.status, iterations) == (Status.MAX_ITERATIONS, 1 + stopped.solved_knots)
    assert stopped.solved_knots < T
    assert (again.status, later) == (whole.status, usual) and whole.status == Status.SOLVED
    np.testing.assert_array_equal(again.x, whole.x)


def test_derivatives_and_gaps_agree_with_the_simulator():
    xs, us = trajectory()
    horizon = HOPPER.horizon(T)
    expected = HOPPER.linearize_trajectory(xs, us, kappa=1e-3)
    for guess in (None, expected.x_next):
        linear = horizon.linearize(xs, us, 1e-3, guess)
        np.testing.assert_allclose(linear.A, expected.A, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(linear.B, expected.B, rtol=1e-5, atol=1e-5)
    gaps = horizon.gaps(linear, xs)
    assert not gaps[0].any()
    np.testing.assert_allclose(gaps[1:], HOPPER.difference(linear.x_next, xs[1:]), atol=1e-12)


def test_knots_of_several_steps():
    xs, us = trajectory()
    horizon = HOPPER.replace(time_step=0.01).horizon(T, substeps=5)
    trial = horizon.roll(xs[0], xs, us, 1e-4)
    shot = HOPPER.replace(time_step=0.01).rollout_feedback(xs[0], us, xs=xs, substeps=5, kappa=1e-4)
    assert trial.steps is None
    np.testing.assert_allclose(trial.x, shot.x, atol=2e-6)


def test_states_are_checked_once():
    xs, _ = trajectory()
    horizon = HOPPER.horizon(T)
    xs[2, 3:7] *= 1.0 + 1e-7
    np.testing.assert_allclose(np.linalg.norm(horizon.states("call", xs)[:, 3:7], axis=1), 1.0, atol=1e-15)
    xs[2, 3:7] *= 1.1
    with pytest.raises(ValueError, match=r"ilqr\(states=...\): joint .* in row 2: expected a unit quaternion"):
        horizon.states("ilqr(states=...)", xs)
    with pytest.raises(ValueError, match=r"Simulator.horizon\(knots\): expected a whole number >= 1"):
        HOPPER.horizon(0)


def test_linearize_rollout_is_rollout_and_linearization():
    """In one pass: the states of the one, the derivatives of the other; a step without solution raises."""
    x, us = HOPPER.neutral(), np.tile([0.1, -0.2, 40.0], (T, 1))
    xs, line = HOPPER.linearize_rollout(x, us)
    t = HOPPER.rollout(x, us, throw=True)
    other = HOPPER.linearize_trajectory(t.x, us)
    np.testing.assert_allclose(xs, t.x, atol=1e-9)
    np.testing.assert_allclose(line.A, other.A, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(line.B, other.B, rtol=1e-4, atol=1e-6)
    assert line.status.tolist() == [0] * T
    np.testing.assert_array_equal(line.x_next, xs[1:])
    with pytest.raises(dojo.SimulationError, match=r"Simulator\.linearize_rollout: step 0"):
        HOPPER.replace(max_iterations=1).linearize_rollout(x + 0.1 * np.eye(HOPPER.nx)[2], us, throw=True)
