"""Waypoint tasks: what they observe and reward, where they end, and that gradients lead to the waypoint."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn.registration import task_of


@pytest.mark.slow
def test_a_quadrotor_sees_the_way_in_its_own_axes_whatever_its_heading():
    task = task_of("QuadrotorWaypoint")
    x = np.concatenate([task.sim.neutral(), [1.0, 0.0, 2.5]])
    x[:3], x[7:10] = (0.0, 0.0, 2.0), (0.0, 0.3, 0.0)
    half = 0.25 * np.pi  # of a turn to the left by a right angle
    turned = x.copy()
    turned[3:7] = np.cos(half), 0.0, 0.0, np.sin(half)
    seen = task.observe(np.array([x, turned]))[0]
    np.testing.assert_allclose(seen[0, :9], [1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.3, 0.0], atol=1e-12)
    np.testing.assert_allclose(seen[1, :9], [0.0, -1.0, 0.5, 0.0, 0.0, 1.0, 0.3, 0.0, 0.0], atol=1e-12)
    there = x.copy()
    there[:3] = 1.0, 0.0, 2.5
    rest = np.zeros((1, 4))
    far, near = (task.rewards(s[None], rest, s[None])[0][0] for s in (x, there))
    np.testing.assert_allclose([far, near], [0.1 - np.sqrt(1.25 + 0.01), 0.0], atol=1e-12)
    low, lying, away = there.copy(), there.copy(), there.copy()
    low[2], away[0] = 0.05, 7.0
    lying[3:7] = np.cos(0.9), np.sin(0.9), 0.0, 0.0
    assert task.ends(np.array([there, low, lying, away])).tolist() == [False, True, True, True]


@pytest.mark.parametrize("name", ["QuadrotorWaypoint", "UuvWaypoint", "YoubotWaypoint"])
def test_actions_move_robots_as_their_inputs_say(name):
    """Hovering takes half of the thrust; thrust of all horizontal thrusters, or a force, moves the body forwards."""
    task = task_of(name)
    x = task.first(np.random.default_rng(0))
    x[: task.sim.nx] = task.sim.neutral()
    if name == "QuadrotorWaypoint":
        x[2], action = 2.0, np.zeros(4)
    else:
        action = {"UuvWaypoint": np.array([-0.5, -0.5, 0.5, 0.5, 0.0, 0.0]), "YoubotWaypoint": np.array([0.5, 0, 0])}[
            name
        ]
    end = task.sim.step_batch(x[None, : task.sim.nx], task.inputs(action)[None], 20 * task.substeps).x[0]
    moved = end[:3] - x[:3]
    if name == "QuadrotorWaypoint":
        np.testing.assert_allclose(moved, 0.0, atol=5e-3)  # kappa over the gaps of its contacts lifts it by 3 mm
    else:
        assert moved[0] > 0.1 and abs(moved[1]) < 1e-4


@pytest.mark.slow
def test_a_quadrotor_learns_to_fly_in_seconds():
    task = task_of("QuadrotorWaypoint")
    learned = dojo.learn.shac(task, epochs=60, evaluations=1, episodes=4)
    idle = dojo.learn.shac(task, epochs=1, evaluations=1, episodes=4, rate=1e-12)
    assert learned.unsolved == learned.infinite == 0
    assert learned.best > 400.0 > 10.0 * idle.history[-1]["evaluated"]  # without learning, it falls within two seconds
