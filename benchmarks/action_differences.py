"""Differences of one action between MuJoCo and this simulator, along MuJoCo's motion under learnt policies.

    python benchmarks/action_differences.py HalfCheetah policy.npz ...

The policies are files of `learned.policy.save`. Every action of four episodes is repeated here, from the same state,
with the time step and the smoothing of the task. The table has means and standard deviations of the differences, by
velocity; states in which the task's `survival_probability` is below a tenth do not count. Learning that adds such
changes to the velocities after each action (`Randomization(pushes=...)`) makes policies that bear them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import gymnasium
import numpy as np
from command import deliver, parser
from evaluate_policy import OPTIONS, load

from dojo_opt.learn.registration import task_of
from dojo_opt.report.result import Report, Row, Table
from solvers.status import Status
from solvers.types import Floats

EPISODES, LOST = 4, 0.1


def motion(name: str, policy: Path, steps: int) -> tuple[Floats, Floats, Floats]:
    """(states (n, nq + nv), actions (n, nu), states after them) of episodes in MuJoCo."""
    env = gymnasium.make(f"{name}-v5", **OPTIONS.get(f"{name}-v5", {}))
    act, data = load(str(policy)), env.unwrapped.data  # type: ignore[attr-defined]
    states, actions, after = [], [], []
    for k in range(EPISODES):
        observation, _ = env.reset(seed=1000 + k)
        for _ in range(steps):
            action = act(observation)
            states.append(np.concatenate([data.qpos, data.qvel]))
            command = action.astype(env.action_space.dtype)
            observation, _, terminated, truncated, _ = env.step(command)
            actions.append(command.astype(np.float64))
            after.append(np.concatenate([data.qpos, data.qvel]))
            if terminated or truncated:
                break
    return np.array(states), np.array(actions), np.array(after)


def study(args: argparse.Namespace) -> Report:
    """The table of a task."""
    task, report = task_of(args.task), Report(f"One action of {args.task} in MuJoCo and here")
    if not np.all(task.high == -task.low):
        raise SystemExit(f"{args.task}: its coordinates or actions are others in MuJoCo")
    found = [motion(args.task, policy, 20 if args.quick else 400) for policy in args.policies]
    x, a, y = (np.concatenate(parts) for parts in zip(*found, strict=True))
    kept = task.survives(x, task.ends(x))[0] >= LOST
    x, a, y = x[kept], a[kept], y[kept]
    here = task.sim.step_batch(x, task.inputs(a), task.substeps)
    solved = here.status == Status.SOLVED
    difference = (y - here.x)[solved, task.sim.nq :]
    rows = [[i, *pair] for i, pair in enumerate(zip(difference.mean(axis=0), difference.std(axis=0), strict=True))]
    report.tables.append(Table(args.task, ("velocity", "mean", "standard deviation"), rows))
    report.rows = [Row("actions", float(len(difference)), ""), Row("unsolved", float((~solved).sum()), "", 0.0)]
    return report


def main() -> int:
    """Measure, print."""
    arguments = parser(__doc__)
    arguments.add_argument("task", choices=("HalfCheetah", "Hopper", "Walker2d"))
    arguments.add_argument("policies", nargs="+", type=Path)
    return deliver("action_differences", study, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
