"""Tasks of Gymnasium: environments and batches of them as Gymnasium expects, the same motion in both."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn import environment

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")
from gymnasium.vector import AutoresetMode  # noqa: E402

NAMES = (
    "Pendulum", "Cartpole", "HalfCheetah", "Hopper", "Walker2d", "Ant", "Humanoid", "Quadruped", "QuadrotorWaypoint",
    "UuvWaypoint", "YoubotWaypoint",
)  # fmt: skip


@pytest.mark.filterwarnings("ignore::UserWarning")  # that observations have no bounds; faults are assertions
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "Cartpole" else pytest.mark.slow) for name in NAMES]
)
def test_environments_are_as_gymnasium_has_them(name, monkeypatch):
    from gymnasium.utils.env_checker import check_env

    monkeypatch.setattr("webbrowser.open", lambda url: True)
    env = gymnasium.make(f"dojo_opt.learn:dojo/{name}-v0", render_mode="rgb_array")
    check_env(env.unwrapped)
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (480, 480, 3) and picture.std() > 1.0


def test_people_watch_in_the_browser(monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    env = gymnasium.make("dojo_opt.learn:dojo/Pendulum-v0", render_mode="human")
    now = [100.0]  # [s] of a clock that runs while the program sleeps, and 10 ms per action
    monkeypatch.setattr(environment, "perf_counter", lambda: now[0])
    monkeypatch.setattr(environment, "sleep", lambda seconds: now.append(now.pop() + seconds))
    env.reset(seed=0)
    assert now == [100.0]
    for _ in range(3):
        now[0] += 0.01
        env.step(np.zeros(1, dtype=np.float32))
    assert now == pytest.approx([100.0 + 3 * 0.05])  # [s] of an action
    view = env.unwrapped.view
    assert opened == [view.url]
    env.close()
    with pytest.raises(ValueError, match="closed"):
        view.show(np.zeros(2))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_a_batch_is_its_environments_one_by_one(mode):
    """Compared with Gymnasium's own SyncVectorEnv of single environments, through resets."""
    batch = gymnasium.make_vec("dojo_opt.learn:dojo/Cartpole-v0", num_envs=3, autoreset_mode=mode)
    single = gymnasium.vector.SyncVectorEnv(
        [lambda: gymnasium.make("dojo/Cartpole-v0") for _ in range(3)], autoreset_mode=mode
    )
    assert batch.metadata["autoreset_mode"] == mode and batch.single_action_space == single.single_action_space
    (a, _), (b, _) = batch.reset(seed=5), single.reset(seed=5)
    np.testing.assert_array_equal(a, b)
    batch.action_space.seed(1)
    resets = 0
    for _ in range(60):
        actions = batch.action_space.sample()
        ours, theirs = batch.step(actions), single.step(actions)
        for a, b in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(a, b)
        resets += int(ours[2].sum())
        if mode == AutoresetMode.SAME_STEP and ours[2].any():
            i = int(np.argmax(ours[2]))
            np.testing.assert_array_equal(ours[4]["final_obs"][i], theirs[4]["final_obs"][i])
    assert resets > 3


def test_batches_can_be_reset_in_part():
    env = gymnasium.make_vec("dojo_opt.learn:dojo/Pendulum-v0", num_envs=3, autoreset_mode=AutoresetMode.DISABLED)
    before, _ = env.reset(seed=1)
    env.step(np.zeros((3, 1), dtype=np.float32))
    after, _ = env.reset(seed=1, options={"reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(after[1], before[1])
    assert np.abs(after[0] - before[0]).max() > 1e-6


@pytest.mark.slow
def test_observations_and_rewards_of_the_cheetah_agree_with_mujoco():
    """Reward and observation, from MuJoCo's own qpos and qvel after a fall without contact; see gymnasium's v5."""
    import mujoco

    task = dojo.learn.half_cheetah()
    model = mujoco.MjModel.from_xml_path(str(_assets() / "half_cheetah.xml"))
    model.opt.timestep, data = 1e-4, mujoco.MjData(model)
    x = task.sim.neutral()
    x[1] = data.qpos[1] = 2.0
    action = np.array([0.3, -0.2, 0.1, -0.3, 0.2, 0.1])
    data.ctrl[:] = action
    for _ in range(500):
        mujoco.mj_step(model, data)
    fine = task.sim.replace(time_step=1e-3)
    end = fine.step_batch(x[None], task.inputs(action)[None], 50).x
    np.testing.assert_allclose(task.observe(end)[0][0], np.r_[data.qpos[1:], data.qvel], atol=0.05)
    reward = task.rewards(x[None], action[None], end)[0][0]
    np.testing.assert_allclose(reward, data.qpos[0] / 0.05 - 0.1 * np.sum(action**2), atol=1e-2)


def test_hopper_and_walker_end_where_gymnasium_says():
    for task, angle in ((dojo.learn.hopper(), 0.2), (dojo.learn.walker2d(), 1.0)):
        x = np.tile(task.sim.neutral(), (3, 1))
        x[1, 2], x[2, 1] = angle + 1e-6, 0.69
        assert task.ends(x).tolist() == [False, True, True]


def _assets():
    from pathlib import Path

    return Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
