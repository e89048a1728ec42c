"""Problems as Gymnasium environments."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo

pytest.importorskip("gymnasium")


@pytest.mark.filterwarnings("ignore::UserWarning")  # that states and inputs have no bounds; faults are assertions
def test_it_is_an_environment_as_gymnasium_has_them():
    from gymnasium.utils.env_checker import check_env

    check_env(dojo.Environment(dojo.problems.swingup("cartpole")), skip_render_check=True)


def test_rewards_of_a_plan_add_up_to_its_cost():
    problem = dojo.problems.hop()
    plan = dojo.ilqr(problem)
    env = dojo.Environment(problem)
    x, _ = env.reset(seed=0)
    np.testing.assert_allclose(x, problem.start)
    total, over = 0.0, False
    for u in plan.u:
        x, reward, terminated, over, info = env.step(u)
        total += reward
        assert not terminated
    assert over and info["violation"] < 2e-3
    np.testing.assert_allclose(total, -plan.fun, rtol=1e-5)
    np.testing.assert_allclose(x, plan.x[-1], atol=1e-4)
    with pytest.raises(RuntimeError, match="the episode is over"):
        env.step(u)


def test_a_free_start_is_that_of_the_plan_where_the_plant_begins_there():
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
    costs = [dojo.cost.Tracking(np.tile([0.3, 0.0], (6, 1)), 1.0), dojo.cost.Effort(0.01)]
    problem = dojo.Problem(sim, sim.neutral(), 5, cost=costs, free_start=True)
    plan = dojo.ilqr(problem)
    env = dojo.Environment(problem, dojo.Plant(sim, plan.x[0]))
    env.reset(seed=0)
    np.testing.assert_allclose(sum(env.step(u)[1] for u in plan.u), -plan.fun, rtol=1e-5)


def test_actions_are_shares_of_the_limits():
    problem = dojo.problems.block()
    limited = dojo.Problem(problem.sim, problem.start, 3, cost=dojo.cost.Effort(1.0), control_limits=(-2.0, [2, 4, 6]))
    env = dojo.Environment(limited)
    env.reset(seed=0)
    _, reward, *_ = env.step(np.array([1.0, -1.0, 0.0]))
    np.testing.assert_allclose(reward, -(2.0**2 + 2.0**2 + 2.0**2))
    _, reward, *_ = env.step(np.array([50.0, -50.0, 0.0]))
    np.testing.assert_allclose(reward, -(2.0**2 + 2.0**2 + 2.0**2))
    assert env.action_space.high.tolist() == [1, 1, 1]


def test_a_first_state_without_a_unit_quaternion_is_named():
    sim = dojo.Simulator(dojo.models.block(), time_step=0.02, kappa=1e-4)

    def observation(x, out):
        out[0] = x[2]

    def reward(x, a, after):
        return after[0] - x[0]

    task = dojo.learn.Task(sim, 1, observation, 1, reward, low=[-5.0] * 3, high=[5.0] * 3,
                           start=lambda rng: sim.neutral() + 0.05, steps=20)  # fmt: skip
    env = dojo.Environment(task)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="unit quaternion"):
        env.step(np.zeros(3))


def test_perturbations_are_drawn_from_the_seed_and_a_fall_ends_it():
    problem = dojo.problems.hop()
    plant = dojo.Plant(problem.sim.replace(time_step=0.01), problem.start)

    def sampler(rng):
        return dojo.Perturbation(payload=float(rng.uniform(0, 2)))

    env = dojo.Environment(problem, plant, sampler)
    ends = []
    for seed in (1, 1, 2):
        env.reset(seed=seed)
        done = False
        while not done:
            x, _, terminated, truncated, info = env.step(np.array([5.0, 0.0, 0.0]))
            done = terminated or truncated
        assert terminated and info["message"] == "The robot has fallen."
        ends.append(x)
    np.testing.assert_array_equal(ends[0], ends[1])
    assert np.abs(ends[0] - ends[2]).max() > 1e-6


def test_a_plant_that_does_not_fit_is_refused():
    problem = dojo.problems.hop()
    with pytest.raises(ValueError, match=r"Environment\(plant=\.\.\.\): expected a time step that divides a knot"):
        dojo.Environment(problem, dojo.Plant(problem.sim.replace(time_step=0.03)))
    with pytest.raises(TypeError, match=r"Environment\(source\): expected a Task or a Problem"):
        dojo.Environment(problem.sim)
    with pytest.raises(ValueError, match=r"expected a plant of the problem's 'raiberthopper', got one of 'quadruped'"):
        dojo.Environment(problem, dojo.Plant(dojo.Simulator(dojo.models.quadruped(), time_step=0.01)))


def test_a_limit_on_one_side_holds():
    sim = dojo.Simulator(dojo.models.cartpole(), time_step=0.05)
    cost = dojo.cost.Effort(1.0)
    env = dojo.Environment(dojo.Problem(sim, sim.neutral(), 5, cost=cost, control_limits=(0.0, np.inf)))
    assert env.action_space.low == 0.0 and env.action_space.high == np.inf
    env.reset(seed=0)
    below, inside = (env.step(np.array([force]))[1] for force in (-50.0, 2.0))
    assert below == 0.0 and inside < 0.0


def test_noise_differs_from_episode_to_episode_and_comes_from_the_seed():
    problem = dojo.problems.hop()
    env = dojo.Environment(problem, dojo.Plant(problem.sim, start=problem.start, noise=0.01))
    seen = [env.reset(seed=seed)[0] for seed in (1, None, 1, 2)]
    np.testing.assert_array_equal(seen[0], seen[2])
    assert all(np.abs(seen[i] - seen[j]).max() > 1e-4 for i, j in ((0, 1), (0, 3), (1, 3)))
