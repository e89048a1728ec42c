"""Tasks of Gymnasium: environments and batches of them as Gymnasium expects, the same motion in both."""

from __future__ import annotations

import json

import numba
import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn import environment
from dojo_opt.learn.first_states import least_gap
from dojo_opt.learn.registration import task_of
from dojo_opt.learn.vector_environment import VectorEnvironment

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("mujoco")
from gymnasium.vector import AutoresetMode  # noqa: E402

from sim.mechanism.stance import gaps  # noqa: E402
from solvers.compiler.pipeline import FAST  # noqa: E402
from support.programs import python  # noqa: E402
from support.robot_files import has_robots  # noqa: E402

NAMES = (
    "Pendulum", "Cartpole", "HalfCheetah", "Hopper", "Walker2d", "Ant", "Humanoid", "Quadruped", "QuadrotorWaypoint",
    "UuvWaypoint", "YoubotWaypoint", "Swimmer", "Go2", "AntArs", "QuadrupedSampling",
)  # fmt: skip


@pytest.mark.filterwarnings("ignore::UserWarning")  # that observations have no bounds; faults are assertions
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "Cartpole" else pytest.mark.slow) for name in NAMES]
)
def test_environments_are_as_gymnasium_has_them(name, monkeypatch):
    from gymnasium.utils.env_checker import check_env

    if name == "Go2" and not has_robots():
        pytest.skip("example-robot-data is not installed")
    monkeypatch.setattr("webbrowser.open", lambda url: True)
    env = gymnasium.make(f"dojo_opt.learn:dojo/{name}-v0", render_mode="rgb_array")
    check_env(env.unwrapped)
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (480, 480, 3) and picture.std() > 1.0


USERS_CODE = """
import gymnasium, json
import numpy as np
from solvers.compiler import compiled
env = gymnasium.make("dojo_opt.learn:dojo/NAME-v0")
env.reset(seed=0)
env.step(np.zeros(env.action_space.shape, dtype=np.float32))
print(json.dumps([name for name in compiled(users=True) if name not in compiled()]))
"""


@pytest.mark.slow
@pytest.mark.skipif(numba.config.DISABLE_JIT or not FAST, reason="functions of the user are kept by the fast compiler")
def test_the_next_process_compiles_no_function_of_a_task():
    program = USERS_CODE.replace("NAME", "Pendulum")  # whose model is our own, so that Gymnasium's are not read
    python(program)
    assert json.loads(python(program)) == []


def test_people_watch_in_the_browser(monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    env = gymnasium.make("dojo_opt.learn:dojo/Cartpole-v0", render_mode="human")
    now = [100.0]  # [s] of a clock that runs while the program sleeps, and 10 ms per action
    monkeypatch.setattr(environment, "perf_counter", lambda: now[0])
    monkeypatch.setattr(environment, "sleep", lambda seconds: now.append(now.pop() + seconds))
    env.reset(seed=0)
    assert now == [100.0]
    for _ in range(3):
        now[0] += 0.01
        env.step(np.zeros(1, dtype=np.float32))
    assert now == pytest.approx([100.0 + 3 * 0.04])  # [s] of an action
    view = env.unwrapped.view
    assert opened == [view.url]
    env.close()
    with pytest.raises(ValueError, match="closed"):
        view.show(np.zeros(4))


# one of each kind of state and observation: joints, commands, waypoints, forces of contacts, Dojo's own observation
KINDS = ("HalfCheetah", "Quadruped", "QuadrotorWaypoint", "Ant, forces", "AntArs")


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_batches_of_every_kind_are_their_environments_one_by_one(name):
    """Ten actions from the seeds of the batch, in Gymnasium's own SyncVectorEnv."""
    options = {"include_cfrc_ext_in_observation": True} if name.endswith("forces") else {}
    made = f"dojo_opt.learn:dojo/{name.partition(',')[0]}-v0"
    batch = gymnasium.make_vec(made, num_envs=2, **options)
    single = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make(made, **options)] * 2)
    (a, _), (b, _) = batch.reset(seed=7), single.reset(seed=7)
    np.testing.assert_array_equal(a, b)
    assert batch.observation_space == single.observation_space and batch.action_space == single.action_space
    batch.action_space.seed(2)
    for _ in range(10):
        actions = batch.action_space.sample()
        for ours, theirs in zip(batch.step(actions)[:4], single.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)


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


def test_options_may_be_lists_and_batches_are_not_drawn():
    assert task_of("Quadruped", fastest=[1.0, 0.5, 1.0]).commands == task_of("Quadruped").commands
    with pytest.raises(ValueError, match="only single environments"):
        gymnasium.make_vec("dojo/Pendulum-v0", num_envs=2, render_mode="rgb_array")


def test_batches_can_be_reset_in_part():
    env = gymnasium.make_vec("dojo_opt.learn:dojo/Cartpole-v0", num_envs=3, autoreset_mode=AutoresetMode.DISABLED)
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


def test_forces_of_environments_that_are_over_together():
    """With the default reset, a step then moves none of them."""
    options = {"include_cfrc_ext_in_observation": True, "max_episode_steps": 2}
    envs = gymnasium.make_vec("dojo/Ant-v0", num_envs=2, **options)
    first, _ = envs.reset(seed=0)
    ends = [envs.step(np.zeros((2, 8)))[3].all() for _ in range(4)]
    assert ends == [False, True, False, False] and first.shape == envs.step(np.zeros((2, 8)))[0].shape


@pytest.mark.slow
def test_forces_of_contacts_are_those_of_mujoco():
    """Ants that have come to rest in both: the same bodies press, in Gymnasium's order; all forces add up to the
    weight, and their torques about the centre of mass to nothing.
    """
    task = dojo.learn.ant(include_cfrc_ext_in_observation=True, contact_cost_weight=5e-4)
    peer = gymnasium.make("Ant-v5")
    assert task.observations == peer.observation_space.shape[0] == 105
    idle, x = np.zeros(8), task.first(np.random.default_rng(0))
    assert not x[task.sim.nx :].any()
    peer.reset(seed=0)
    ours = VectorEnvironment(task, 2)
    ours.reset(seed=0)
    for _ in range(60):
        theirs = peer.step(idle)[0]
        seen, rewards, *_ = ours.step(np.zeros((2, 8)))
    felt = ours.x[:, task.sim.nx :].reshape(2, 13, 6)
    clipped = np.clip(felt[0][:, [3, 4, 5, 0, 1, 2]], -1.0, 1.0)
    np.testing.assert_array_equal(seen[0, 27:], clipped.ravel())
    press = [np.flatnonzero(np.abs(o[27:].reshape(13, 6)[:, 5]) > 0.5).tolist() for o in (seen[0], theirs)]
    assert press[0] == press[1] == [3, 6, 9, 12]
    weight = 9.81 * sum(body.mass for body in task.sim.mechanism.bodies)
    np.testing.assert_allclose(felt[0].sum(axis=0), [0.0, 0.0, weight, 0.0, 0.0, 0.0], atol=0.02 * weight)
    plain = dojo.learn.ant()
    assert plain.nx == plain.sim.nx and plain.observations == 27
    before = ours.x.copy()
    after = before.copy()
    after[:, 0] += 0.05
    acts = np.zeros((2, 8))
    paid = plain.rewards(before[:, : plain.nx], acts, after[:, : plain.nx])[0] - task.rewards(before, acts, after)[0]
    np.testing.assert_allclose(paid[0], 5e-4 * np.sum(clipped**2), rtol=1e-9)


@pytest.mark.slow
def test_forces_of_contacts_are_paid_for_without_being_observed():
    task = dojo.learn.humanoid(contact_cost_weight=5e-7)
    assert task.observations == 45 and task.nx == task.sim.nx + 78
    x = task.first(np.random.default_rng(0))
    x[task.sim.nx + 2] = 2000.0
    acts = np.zeros((2, 17))
    rows = np.array([x, np.r_[x[: task.sim.nx], np.zeros(78)]])
    pressed, free = task.rewards(rows, acts, rows)[0]
    np.testing.assert_allclose(free - pressed, 5e-7 * 2000.0**2, rtol=1e-9)
    x[task.sim.nx + 2] = 1e5
    np.testing.assert_allclose(free - task.rewards(x[None], acts[:1], x[None])[0][0], 10.0, rtol=1e-9)
    np.testing.assert_array_equal(*(task.observe(row[None])[0] for row in rows))
    learned = dojo.learn.shac(task, epochs=1, environments=4, evaluations=1, episodes=1)
    assert learned.infinite == learned.unsolved == 0


def test_hopper_and_walker_end_where_gymnasium_says():
    for task, angle in ((dojo.learn.hopper(), 0.2), (dojo.learn.walker2d(), 1.0)):
        x = np.tile(task.sim.neutral(), (3, 1))
        x[1, 2], x[2, 1] = angle + 1e-6, 0.69
        assert task.ends(x).tolist() == [False, True, True]


def test_a_walker_pays_for_joints_near_their_limits():
    plain, shaped = dojo.learn.walker2d(), dojo.learn.walker2d(limit_cost=3.0)
    x, acts = np.tile(plain.sim.neutral(), (3, 1)), np.zeros((3, 6))
    x[:, 3:9] = -0.5, -0.5, 0.0, -0.5, -0.5, 0.0  # bent legs, and ankles in the middle
    x[1, 4], x[2, 5] = -0.05, 0.78  # a knee near its upper limit 0, an ankle at its upper limit of 45 degrees
    paid = plain.rewards(x, acts, x)[0] - shaped.rewards(x, acts, x)[0]
    assert paid == pytest.approx([0.0, 3.0 * 0.05, 3.0 * (0.78 - np.deg2rad(45.0) + 0.1)], abs=1e-9)
    with pytest.raises(ValueError, match="limit_cost"):
        dojo.learn.walker2d(limit_cost=-1.0)


@pytest.mark.parametrize("make", ["half_cheetah", "hopper", "walker2d", "ant", "humanoid"])
def test_first_states_are_within_the_limits_of_joints(make):
    """Hopper and walker stand with straight legs, on a limit: the noise of the start would bend half of them beyond."""
    task = getattr(dojo.learn, make)()
    mech = task.sim.mechanism
    states = task.starts([np.random.default_rng(k) for k in range(50)])
    for joint in mech.joints:
        if joint.nrot < 3:
            q, (low, high) = states[:, mech.q_slice(joint.name)], np.transpose(joint.limits)
            assert np.all((low <= q) & (q <= high)), joint.name
            assert len(np.unique(q)) > 40, joint.name


def _assets():
    from pathlib import Path

    return Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"


@pytest.mark.parametrize("name", ["HalfCheetah", "Ant"])
def test_the_least_gap_of_first_states_is_that_of_forward_kinematics(name):
    mech = task_of(name).sim.mechanism
    assert all(contact.height == 0.0 for contact in mech.contacts), "margins are left out"
    least, rng = least_gap(mech), np.random.default_rng(0)
    for _ in range(3):
        q = mech.neutral + rng.uniform(-0.3, 0.3, mech.nq)
        for joint in mech.joints:
            if joint.nrot == 3:
                part = slice(mech.q_slice(joint.name).stop - 4, mech.q_slice(joint.name).stop)
                q[part] /= np.linalg.norm(q[part])
        np.testing.assert_allclose(least(q), gaps(mech, q).min(), rtol=0, atol=1e-12)
