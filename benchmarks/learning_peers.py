"""PPO and SAC of Stable-Baselines3 as long as they are given, with its own settings, in Gymnasium's own environments.

python benchmarks/learning_peers.py DIR HalfCheetah --algorithms ppo sac --seeds 0 --seconds 60 [--plant dojo]

Needs `pip install stable-baselines3 "gymnasium[mujoco]"`. They learn in MuJoCo, or with `--plant dojo` in the
environments of this package. A run is DIR/TASK_ALGORITHM_SEED.npz (or TASK_ALGORITHM_dojo_SEED.npz) with `seconds` of
processor time without those of evaluations, `steps`, the mean `returns` of four episodes without noise, and those in
MuJoCo at the end as in benchmarks/evaluate_policy.py; `benchmarks/learning.py DIR TASK --table` shows it beside the
others. For one core, set NUMBA_NUM_THREADS=1 and OMP_NUM_THREADS=1. Published returns of these algorithms take
a million steps and more: runs of minutes on one core show the results of minutes, not the limits of the algorithms.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from evaluate_policy import OPTIONS, in_columns

import dojo_opt.learn  # noqa: F401 - registers the environments

EPISODES, MARKS = 4, 5


def environment(plant: str, name: str) -> gymnasium.Env[Any, Any]:
    """The task in a plant, "mujoco" or "dojo"."""
    if plant == "dojo":
        return gymnasium.make(f"dojo/{name}-v0")
    return gymnasium.make(f"{name}-v5", **OPTIONS.get(f"{name}-v5", {}))


def assessed(model: Any, env: gymnasium.Env[Any, Any]) -> float:
    """Mean return of a few episodes without noise."""
    total = 0.0
    for k in range(EPISODES):
        observation, _ = env.reset(seed=1000 + k)
        over = False
        while not over:
            action, _ = model.predict(observation, deterministic=True)
            observation, reward, terminated, truncated, _ = env.step(action)
            total += float(reward)
            over = terminated or truncated
    return total / EPISODES


def run(folder: Path, plant: str, name: str, algorithm: str, seed: int, seconds: float) -> None:
    """One run, unless it is saved."""
    import torch
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.callbacks import BaseCallback

    path = folder / f"{name}_{algorithm}{'_dojo' if plant == 'dojo' else ''}_{seed}.npz"
    if path.exists():
        return
    torch.set_num_threads(1)
    rows: list[tuple[float, int, float]] = []
    judge, judging = environment(plant, name), 0.0

    class Marks(BaseCallback):
        """Evaluates at a few moments, and ends the run at the last of them."""

        def _on_step(self) -> bool:
            nonlocal judging
            now = time.process_time()
            spent = now - began - judging
            if spent >= (len(rows) + 1) * seconds / MARKS:
                rows.append((spent, self.num_timesteps, assessed(self.model, judge)))
                judging += time.process_time() - now
                print(f"{name} {algorithm} seed {seed}: {rows[-1]}", flush=True)
            return len(rows) < MARKS

    env = environment(plant, name)
    model = {"ppo": PPO, "sac": SAC}[algorithm]("MlpPolicy", env, seed=seed, device="cpu")
    env.reset(seed=seed)
    env.step(np.zeros(env.action_space.shape or (), dtype=np.float32))  # compiled before the clock starts
    began = time.process_time()
    model.learn(total_timesteps=10**9, callback=Marks())
    spent, steps, returns = np.array(rows).T
    there = in_columns(f"{name}-v5", lambda observation: model.predict(observation, deterministic=True)[0])
    np.savez(path, seconds=spent, steps=steps, returns=returns, mujoco=[column.mean() for column in there])


def main() -> None:
    """Run and save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("task")
    parser.add_argument("--algorithms", nargs="+", choices=("ppo", "sac"), default=["ppo", "sac"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--seconds", type=float, default=180.0, help="of processor time")
    parser.add_argument("--plant", choices=("mujoco", "dojo"), default="mujoco", help="where they learn")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for algorithm in given.algorithms:
        for seed in given.seeds:
            run(given.folder, given.plant, given.task, algorithm, seed, given.seconds)


if __name__ == "__main__":
    main()
