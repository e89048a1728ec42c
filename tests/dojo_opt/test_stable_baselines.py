"""Scripts of Stable-Baselines3 train on the environments without change (`pip install "dojo-opt[sb3]"`)."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("stable_baselines3")
import gymnasium  # noqa: E402
from stable_baselines3 import PPO, SAC  # noqa: E402
from stable_baselines3.common.env_checker import check_env  # noqa: E402
from stable_baselines3.common.env_util import make_vec_env  # noqa: E402

NAME = "dojo_opt.learn:dojo/Pendulum-v0"


def test_its_checker_finds_no_fault():
    check_env(gymnasium.make(NAME).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_its_algorithms_train(algorithm):
    """On two environments; the policy changes, and acts within the bounds."""
    pytest.importorskip("torch").set_num_threads(1)
    few = {"n_steps": 64, "batch_size": 32} if algorithm is PPO else {"learning_starts": 32, "batch_size": 32}
    model = algorithm("MlpPolicy", make_vec_env(NAME, n_envs=2, seed=0), seed=0, device="cpu", **few)
    observation = model.env.reset()
    before = model.predict(observation, deterministic=True)[0]
    model.learn(128)
    assert model.num_timesteps == 128
    after = model.predict(observation, deterministic=True)[0]
    assert after.shape == (2, 1) and np.all(np.abs(after) <= 1.0)
    assert np.abs(after - before).max() > 1e-4
