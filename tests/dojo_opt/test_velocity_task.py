"""Robots that keep a commanded velocity: their observations, changes of commands, and that learning them repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dojo_opt as dojo


@pytest.fixture(scope="module")
def task():
    return dojo.learn.quadruped()


def _moving(task, rng):
    """A state with another attitude and velocity."""
    x = task.first(rng)
    turn = Rotation.random(random_state=3)
    x[3:7] = np.roll(turn.as_quat(), 1)
    x[task.sim.nq : task.sim.nx] = rng.standard_normal(task.sim.nv)
    return x, turn


def test_velocities_are_those_that_the_trunk_sees(task):
    x, turn = _moving(task, np.random.default_rng(0))
    nq = task.sim.nq
    seen = task.observe(x[None])[0][0]
    np.testing.assert_allclose(seen[:3], turn.inv().apply([0.0, 0.0, 1.0]), atol=1e-12)
    np.testing.assert_allclose(seen[3:6], turn.inv().apply(x[nq : nq + 3]), atol=1e-12)
    np.testing.assert_allclose(seen[9:12], x[task.sim.nx :])
    error = dojo.learn.velocity_error(x[: task.sim.nx], seen[9:12])
    np.testing.assert_allclose(error, [*(seen[3:5] - seen[9:11]), seen[8] - seen[11]], atol=1e-12)


@pytest.mark.slow
def test_the_best_reward_is_that_of_the_command(task):
    x = task.starts([np.random.default_rng(1)])
    x[:, task.sim.nq :] = 0.0
    x[:, 3:7], x[:, 2] = (1.0, 0.0, 0.0, 0.0), task.sim.neutral()[2]
    x[:, -3:] = x[:, task.sim.nq : task.sim.nq + 3] = 0.4, -0.2, 0.0
    still = np.zeros((1, task.sim.nu))
    best, slopes = task.rewards(x, still, x, slopes=True)
    np.testing.assert_allclose(best, 0.0, atol=1e-6)
    n = task.sim.ndx
    np.testing.assert_allclose(slopes[0, n + task.sim.nu :], 0.0, atol=1e-6)
    x[:, -3] += 0.3
    assert -0.3 < task.rewards(x, still, x)[0][0] < -0.2


@pytest.mark.slow
def test_commands_change_in_batches_as_in_single_environments(task):
    pytest.importorskip("gymnasium")
    from dojo_opt.learn.vector_environment import VectorEnvironment

    hasty = replace(task, hold=2, steps=5)
    single, batch = dojo.Environment(hasty), VectorEnvironment(hasty, 2)
    first, both = single.reset(seed=3)[0], batch.reset(seed=3)[0]
    commands = []
    for _ in range(5):
        np.testing.assert_array_equal(both[0], first)
        commands.append(first[9:12])
        action = np.full(hasty.sim.nu, 0.1)
        first, reward, *_ = single.step(action)
        both, rewards, *_ = batch.step(np.tile(action, (2, 1)))
        np.testing.assert_allclose(rewards[0], reward, rtol=1e-12)
    same = [np.array_equal(a, b) for a, b in zip(commands[:-1], commands[1:], strict=True)]
    assert same == [True, False, True, False]


@pytest.mark.slow
def test_learning_under_pushes_repeats_to_the_bit_and_gives_a_controller(task):
    runs = [
        dojo.learn.shac(task, epochs=2, environments=4, horizon=3, evaluations=0, episodes=1, seed=4) for _ in range(2)
    ]
    np.testing.assert_array_equal(runs[0].state["weights"], runs[1].state["weights"])
    assert runs[0].unsolved == runs[0].infinite == 0
    policy, x = runs[0].policy, task.first(np.random.default_rng(0))
    u = policy.commanded(lambda t: (t, 0.0, 0.0))(0.5, x[: task.sim.nx])
    x[-3:] = 0.5, 0.0, 0.0
    np.testing.assert_array_equal(u, policy(x))
    assert np.all((u >= task.low) & (u <= task.high))


def test_robots_of_another_kind_are_refused():
    with pytest.raises(ValueError, match="expected a floating base and hinges"):
        dojo.learn.quadruped(dojo.models.cartpole())
    with pytest.raises(ValueError, match="expected a floating base and hinges"):
        dojo.learn.quadruped(dojo.models.sphere())


def test_servos_keep_the_limits_of_the_inputs():
    mech = dojo.models.quadruped()
    weak = replace(mech, inputs=[replace(part, limits=(-1.0, 2.0)) for part in mech.inputs])
    made = dojo.learn.quadruped(weak).sim.mechanism
    assert {part.force_limits for part in made.inputs} == {(-1.0, 2.0)}
    with pytest.raises(ValueError, match="expected an input for every hinge, and nothing else; check 'RL_"):
        dojo.learn.quadruped(replace(weak, inputs=weak.inputs[:9]))
