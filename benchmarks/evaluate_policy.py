"""Returns of saved policies in Gymnasium's MuJoCo tasks. Nothing of dojo-opt is imported: a policy is an .npz file.

python benchmarks/evaluate_policy.py HalfCheetah-v5 policy.npz ...      [--episodes 8] [--finer 5] [--output FILE]

Four columns: the original task; with shorter time steps at the same control rate; with elliptic friction cones instead
of pyramids at its own time step; and, with the shorter time steps, contacts and limits of joints that yield for 4 ms
instead of 20 ms. The tasks need `pip install "gymnasium[mujoco]"`, which also brings imageio.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable

import gymnasium
import numpy as np

from solvers.types import Floats

ELLIPTIC = 1  # mujoco.mjtCone.mjCONE_ELLIPTIC
STIFF = (0.004, 1.0)  # time constant [s] and damping ratio of contacts and limits
OPTIONS = {"Ant-v5": {"include_cfrc_ext_in_observation": False, "contact_cost_weight": 0.0}}


def load(path: str) -> Callable[[Floats], Floats]:
    """The policy of a file, from observations to actions in [-1, 1]."""
    data = np.load(path, allow_pickle=False)
    shape = json.loads(str(data["network"]))
    sizes, layers, first = shape["sizes"], [], 0
    for n, m in zip(sizes[:-1], sizes[1:], strict=True):
        layers.append((data["weights"][first : first + n * m].reshape(n, m), data["weights"][first + n * m :][:m]))
        first += n * m + m
    mean, deviation = data["mean"], data["deviation"]

    def act(observation: Floats) -> Floats:
        y = np.clip((observation - mean) / deviation, -10.0, 10.0)
        for k, (W, b) in enumerate(layers):
            y = y @ W + b
            if k < len(layers) - 1:
                y = np.tanh(y) if shape["activation"] == "tanh" else np.where(y > 0.0, y, np.expm1(np.minimum(y, 0.0)))
        return np.clip(y, -1.0, 1.0) if len(layers) == 1 else np.tanh(y)

    return act


def returns(
    task: str,
    act: Callable[[Floats], Floats],
    episodes: int,
    finer: int,
    elliptic: bool = False,
    stiff: bool = False,
) -> Floats:
    """(episodes,) returns, with time steps shorter by this factor, the task's friction cones or elliptic ones, and its
    contacts and limits of joints or stiffer ones.
    """
    try:
        env = gymnasium.make(task, **OPTIONS.get(task, {}))
    except (ImportError, gymnasium.error.DependencyNotInstalled) as error:
        raise SystemExit(f'{task} needs its libraries: pip install "gymnasium[mujoco]" ({error})') from None
    inner = env.unwrapped
    low, high = env.action_space.low, env.action_space.high
    inner.model.opt.timestep /= finer  # type: ignore[attr-defined]
    inner.frame_skip *= finer  # type: ignore[attr-defined]
    if elliptic:
        inner.model.opt.cone = ELLIPTIC  # type: ignore[attr-defined]
    if stiff:
        inner.model.geom_solref[:] = inner.model.jnt_solref[:] = STIFF  # type: ignore[attr-defined]
    out = np.zeros(episodes)
    for k in range(episodes):
        observation, _ = env.reset(seed=1000 + k)
        over = False
        while not over:
            a = act(observation)
            command = 0.5 * (high + low) + 0.5 * (high - low) * a
            observation, reward, terminated, truncated, _ = env.step(command.astype(env.action_space.dtype))
            out[k] += float(reward)
            over = terminated or truncated
    return out


def in_columns(task: str, act: Callable[[Floats], Floats], episodes: int = 8, finer: int = 5) -> list[Floats]:
    """Returns of the four columns."""
    variants = ((1, False, False), (finer, False, False), (1, True, False), (finer, False, True))
    return [returns(task, act, episodes, *variant) for variant in variants]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task")
    parser.add_argument("policies", nargs="+")
    parser.add_argument("--episodes", type=int, default=8)
    parser.add_argument("--finer", type=int, default=5)
    parser.add_argument("--output", default="", help="JSON file: {policy: [mean return of each column]}")
    given = parser.parse_args()
    table: dict[str, list[float]] = {}
    print(
        f"{'policy':40} {given.task:>20} {'time step / ' + str(given.finer):>20} {'elliptic cones':>20} {'stiff':>20}"
    )
    for path in given.policies:
        columns = in_columns(given.task, load(path), given.episodes, given.finer)
        table[path] = [float(c.mean()) for c in columns]
        print(f"{path[-40:]:40} " + " ".join(f"{c.mean():12.1f} +-{c.std():5.0f}" for c in columns), flush=True)
    if given.output:
        with open(given.output, "w") as file:
            json.dump(table, file, indent=1)


if __name__ == "__main__":
    main()
