"""Tasks of Dojo, Go2 and the swimmer: what they observe, reward and end, and that they can be solved."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn.network import Network
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.randomization import Drawn
from dojo_opt.learn.registration import task_of
from support.robot_files import has_robots


def _returns(task, actions, rows=1):
    """(returns, last states) of open-loop actions (steps, nu), or (steps, rows, nu)."""
    model, x = Drawn.of(task), task.starts([np.random.default_rng(i) for i in range(rows)])
    total, alive = np.zeros(rows), np.ones(rows, dtype=bool)
    for a in actions:
        given = np.ascontiguousarray(np.broadcast_to(a, (rows, task.sim.nu)))
        found = model.step(x, task.inputs(given))
        assert found.success, found.message
        total += alive * task.rewards(x, given, found.x)[0]
        x, alive = found.x, alive & ~task.ends(found.x)
    return total, x, alive


@pytest.mark.slow
def test_the_ant_of_dojo_observes_its_attitude_and_normal_impulses():
    task = task_of("AntArs")
    assert task.observations == 37 and task.nx == task.sim.nx + 54
    _, x, alive = _returns(task, np.zeros((60, 8)), 2)
    assert alive.all()
    weight = 9.81 * task.sim.time_step * sum(body.mass for body in task.sim.mechanism.bodies)
    seen = task.observe(x)[0]
    np.testing.assert_allclose(seen[:, 28:].sum(axis=1), weight, rtol=0.02)
    turned = x[:1].copy()
    vector = np.array([0.3, -0.2, 0.5])
    angle = np.linalg.norm(vector)
    turned[0, 3:7] = np.r_[np.cos(0.5 * angle), np.sin(0.5 * angle) * vector / angle]
    np.testing.assert_allclose(task.observe(turned)[0][0, 3:6], vector, atol=1e-12)
    moved, a = x[:1].copy(), np.full((1, 8), 0.5)
    moved[0, 0] += 0.1
    pressed = np.sum(np.clip(seen[0, 28:], -1.0, 1.0) ** 2)
    expected = 2.0 * 0.1 / 0.05 + 0.05 - 0.05 * 8 * 0.25 - 5e-4 * pressed
    np.testing.assert_allclose(task.rewards(x[:1], a, moved)[0][0], expected, rtol=1e-12)
    low = x[:1].copy()
    low[0, 2] = 0.19
    assert task.ends(np.concatenate([x[:1], low])).tolist() == [False, True]


@pytest.mark.slow
def test_a_policy_feels_the_contacts_of_the_plant():
    """In a closed loop as in an environment, where the forces are part of the state."""
    task = task_of("AntArs")
    net, rng = Network((task.observations, task.sim.nu)), np.random.default_rng(2)
    weights = 0.3 * rng.standard_normal(net.count)
    policy = LearnedPolicy(net, weights, np.zeros(task.observations), np.ones(task.observations), task)
    model, x = Drawn.of(task), task.starts([rng])
    plant, states = dojo.Plant(task.sim, x[0, : task.sim.nx]), []
    for _ in range(20):
        states.append(x[0, : task.sim.nx])
        x = model.step(x, policy(x[0])[None]).x
    assert np.abs(x[0, -54:]).max() > 1.0  # [N]
    controller = policy.controller
    with pytest.raises(ValueError, match=r"forces of contacts.*call reset\(\)"):
        controller(0.0, plant.x)
    for _ in range(2):  # a second run begins without forces
        loop = dojo.closed_loop(
            controller, plant, 20 * task.knot_time, control_step=task.knot_time, fallen=lambda x: False
        )
        np.testing.assert_allclose(loop.x[:: task.substeps][:20], states, atol=1e-9)
    with pytest.raises(ValueError, match=r"commanded\(command\): expected shape \(0,\)"):
        policy.commanded((1.0,))


@pytest.mark.slow
def test_random_search_teaches_the_ant_of_dojo_to_run():
    learned = dojo.learn.ars(task_of("AntArs"), epochs=12, directions=6, best=6, rate=0.1, noise=0.1, evaluations=2)
    assert learned.unsolved == 0
    assert learned.best > 1.5 * _returns(task_of("AntArs"), np.zeros((150, 8)))[0][0], learned.best


@pytest.mark.slow
def test_sampled_gaits_of_the_quadruped_walk():
    """As Dojo samples them: the best of a batch walks, and a gait is what its formula says."""
    task = task_of("QuadrupedSampling")
    f, a, m, b, n = 0.15, 0.3, 0.9, 0.2, -1.5
    targets = task.inputs(dojo.learn.sampled_gait(task, (f, a, m, b, n)))
    k = 11  # the twelfth action; front left is half a period behind front right
    phase = f * 0.2 * np.pi * (k + 1)
    np.testing.assert_allclose(targets[k, [0, 1, 2]], [0.0, a * np.cos(phase) + m, b * np.cos(phase - np.pi / 2) + n])
    np.testing.assert_allclose(targets[k, [4, 5]], [m - a * np.cos(phase), n - b * np.cos(phase - np.pi / 2)])
    np.testing.assert_array_equal(targets[:, 3:6], targets[:, 6:9])
    rng = np.random.default_rng(0)
    samples = rng.uniform((0.1, 0.1, 0.6, -0.4, -1.8), (0.4, 0.4, 1.0, 0.4, -1.2), (20, 5))
    actions = np.array([dojo.learn.sampled_gait(task, p) for p in samples]).transpose(1, 0, 2)
    total, x, alive = _returns(task, actions, 20)
    assert np.max(total[alive]) > 0.3, total
    np.testing.assert_allclose(total[alive], x[alive, 0], atol=1e-9)


@pytest.mark.slow
def test_the_swimmer_swims_by_winding_only():
    task, time = task_of("Swimmer"), 0.04 * np.arange(250)
    wave = 0.3 * np.stack([np.sin(2.0 * time), np.sin(2.0 * time - 1.5)], axis=1)
    ahead, x, _ = _returns(task, wave, 2)
    behind, *_ = _returns(task, wave[:, ::-1], 2)
    rest, *_ = _returns(task, np.zeros((250, 2)))
    assert ahead.min() > 20.0 and behind.max() < -20.0 and abs(rest[0]) < 2.0
    seen = task.observe(x)[0]
    for row, o in zip(x, seen, strict=True):
        np.testing.assert_allclose(np.exp(1j * o[0]), (row[3] + 1j * row[6]) ** 2, atol=1e-3)  # it stays level
        np.testing.assert_array_equal(o[1:3], row[7:9])


@pytest.mark.slow
@pytest.mark.skipif(not has_robots(), reason="example-robot-data is not installed")
def test_go2_stands_and_needs_its_file(monkeypatch):
    task = task_of("Go2")
    assert task.observations == 36 and task.sim.nu == 12
    assert task.sim.mechanism.contact_names == ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
    _, x, alive = _returns(task, np.zeros((100, 12)))
    assert alive.all() and abs(x[0, 2] - task.sim.neutral()[2]) < 0.03
    with pytest.raises(OSError, match=r"nowhere\.urdf"):
        dojo.learn.go2("nowhere.urdf")
    monkeypatch.setattr("dojo_opt.learn.velocity_task._GO2", "another name")
    with pytest.raises(ImportError, match=r"dojo-opt\[robots\]"):
        dojo.learn.go2()
