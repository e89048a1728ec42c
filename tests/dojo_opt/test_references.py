"""Moving references, and the new references at the end of a horizon that moves on."""

import copy
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.mpc.moving_reference import References, SampledReference
from dojo_opt.mpc.policy import Policy
from dojo_opt.mpc.receding_horizon import shift_multipliers, tail
from dojo_opt.plant.ground_plane import GroundPlane
from support.standing_hopper import HOPPER, random_policy, standing_problem


def _ahead(distance):
    rows = np.tile(HOPPER.neutral(), (2, 1))
    rows[1, 0] += distance
    return rows


def test_sampled_goes_round_with_its_advance():
    time = np.array([0.0, 0.1, 0.2])
    rows = np.tile(HOPPER.neutral(), (3, 1))
    rows[:, 0] = [0.0, 0.03, 0.1]
    cycle = np.zeros(14)
    cycle[0] = 0.1
    path = SampledReference(time, rows, HOPPER, cycle)
    np.testing.assert_allclose(path([0.05, 0.2, 0.3, 1.05, -0.1])[:, 0], [0.015, 0.1, 0.13, 0.515, -0.07], atol=1e-12)
    held = SampledReference(time, rows, HOPPER)
    np.testing.assert_allclose(held([0.15, 5.0])[:, 0], [0.065, 0.1], atol=1e-12)
    numbers = SampledReference(time, np.array([[0.0], [1.0], [0.0]]), cycle=np.zeros(1))
    np.testing.assert_allclose(numbers([0.05, 0.25])[:, 0], [0.5, 0.5], atol=1e-12)


def test_sampled_velocities_over_the_step_of_a_model():
    time = np.array([0.0, 0.1, 0.2])
    rows = np.tile(HOPPER.neutral(), (3, 1))
    rows[:, 0] = [0.0, 0.03, 0.1]
    cycle = np.zeros(14)
    cycle[0] = 0.1
    mean = SampledReference(time, rows, HOPPER, cycle).with_mean_velocities(0.05)
    np.testing.assert_allclose(mean.rows[:, 8], [0.7, 0.3, 0.7], atol=1e-9)
    with pytest.raises(ValueError, match="with_mean_velocities: expected a simulator of order 2"):
        SampledReference(time, rows, HOPPER.replace(order=4), cycle).with_mean_velocities(0.05)


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


class _Follower:
    """A reference that stands where the robot was first measured."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.place = np.inf

    def anchor(self, time, x):
        self.place = min(self.place, x[0])

    def __call__(self, times):
        return np.tile(np.r_[min(self.place, 9.0), HOPPER.neutral()[1:]], (len(times), 1))

    def inputs(self, times):
        return np.full((len(times), 3), min(self.place, 9.0))


def test_controllers_have_references_of_their_own_and_begin_anew():
    """A controller forgets where its reference was anchored; a fresh one, or a copy, does not share it."""
    mine = _Follower()
    mpc = dojo.MPC(standing_problem(), reference={0: mine, 1: mine.inputs})
    other, copied = mpc.fresh(), copy.copy(mpc)
    x = HOPPER.neutral()
    for place, controller in ((2.0, mpc), (3.0, other), (4.0, copied)):
        controller(0.0, np.r_[place, x[1:]])
        assert {term.reference[0, 0] for term in controller.problem.costs[:2]} == {place}
    assert mine.place == 2.0
    mpc.reset()
    mpc(7.0, np.r_[5.0, x[1:]])
    assert mpc.problem.costs[1].reference[0, 0] == mine.place == 5.0


def test_references_move_with_time_and_with_the_ground():
    problem = standing_problem()
    moved = dojo.MPC(problem)  # MPC's own terms; the terms of the user's problem stay
    references = References(moved.problem, {0: SampledReference([0.0, 1.0], _ahead(1.0), HOPPER), 1: np.zeros((3, 3))})
    references.move(0.5, GroundPlane(0.02))
    term = moved.problem.costs[0]
    np.testing.assert_allclose(term.reference[:, 0], 0.5 + 0.05 * np.arange(9), atol=1e-12)
    np.testing.assert_allclose(term.reference[:, 2], 0.57, atol=1e-12)
    np.testing.assert_array_equal(moved.problem.costs[1].reference, 0.0)
    np.testing.assert_array_equal(problem.costs[0].reference, np.tile(HOPPER.neutral(), (9, 1)))


def test_tail_follows_the_reference_or_the_last_input():
    problem = standing_problem()
    rng = np.random.default_rng(7)
    policy = random_policy(rng, T=8, time=0.0)
    moving = References(problem, SampledReference([0.0, 1.0], _ahead(1.0), HOPPER))
    xs, us = tail(policy, moving, 2)
    np.testing.assert_allclose(xs[:, 0] - policy.x[-1, 0], [0.05, 0.1], atol=1e-9)
    np.testing.assert_array_equal(us, policy.u[-1:].repeat(2, axis=0))
    calm = Policy(HOPPER, 0.0, np.tile(problem.start, (9, 1)), problem.controls0, np.zeros((8, 3, 14)))
    xs, _ = tail(calm, References(problem, None), 2)
    roll = HOPPER.rollout(problem.start, problem.controls0[:2]).x
    np.testing.assert_array_equal(xs, roll[1:])
    refusing = replace(calm, sim=HOPPER.replace(max_iterations=1))  # a step in up to 1024 parts takes longer than ticks
    np.testing.assert_array_equal(tail(refusing, References(problem, None), 2)[0], calm.x[-1:].repeat(2, axis=0))


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
