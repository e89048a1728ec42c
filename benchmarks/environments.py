"""Cost of environments: Python over the simulation in `step`, and batches of 64 beside a single environment.

    NUMBA_NUM_THREADS=1 python benchmarks/environments.py [--tasks HalfCheetah ...]

Processor time, medians of rounds of 50 actions, uniformly drawn. The simulation is the compiled call with the same
states and inputs, right after the round; what `step` takes beyond it is Python. The batch is `make_vec(...,
num_envs=64)`, per environment and action. An environment of `forces` observes contacts; its simulation writes them.
"""

from __future__ import annotations

import argparse
import sys
from copy import deepcopy
from time import process_time
from typing import Any

import gymnasium
import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.learn.environment_names import TASKS
from dojo_opt.learn.registration import task_of
from dojo_opt.report.result import Report, Table
from solvers.types import Floats

ACTIONS, ROUNDS, ROWS = 50, 7, 64
FORCES = "Ant, forces"
MOST, LEAST = 30.0, 15.0  # [us] of Python; times faster


def _named(name: str) -> tuple[str, dict[str, Any]]:
    """Name and options of a task."""
    if name == FORCES:
        return "Ant", {"include_cfrc_ext_in_observation": True, "contact_cost_weight": 5e-4}
    return name, {}


def _begin(env: dojo.Environment, task: dojo.learn.Task) -> Floats:
    """Reset an environment; the first state of its simulator, which the task draws from a copy of the generator."""
    x: Floats = task.starts([deepcopy(env.np_random)])[0, : task.sim.nx]
    env.reset()
    return x


def single(name: str, rounds: int) -> tuple[float, float]:
    """(time of an action in `step`, time of its compiled call) [us], medians of rounds."""
    registered, options = _named(name)
    task = task_of(registered, **options)
    env = dojo.Environment(task)  # as gymnasium.make(...).unwrapped
    row = task.sim.stepper(task.substeps, contacts=bool(task.touch))
    env.action_space.seed(0)
    steps, sims = [], []
    for k in range(rounds + 1):
        env.np_random = np.random.default_rng(k)
        x = _begin(env, task)
        actions = [env.action_space.sample() for _ in range(ACTIONS)]
        states: list[Floats] = []
        spent = 0.0
        for a in actions:
            states.append(x)
            began = process_time()
            over = env.step(a)[2]
            spent += process_time() - began
            x = _begin(env, task) if over else row.end.copy()  # the stepper of the task is that of the environment
        inputs = [task.inputs(a.astype(np.float64)) for a in actions]
        began = process_time()
        for x, u in zip(states, inputs, strict=True):
            row.advance(x, u)
        sims.append((process_time() - began) / ACTIONS)
        steps.append(spent / ACTIONS)
    return 1e6 * float(np.median(steps[1:])), 1e6 * float(np.median(sims[1:]))


def batch(name: str, rounds: int) -> float:
    """Time of an action of one of 64 environments [us], median of rounds."""
    registered, options = _named(name)
    env = gymnasium.make_vec(f"dojo/{registered}-v0", num_envs=ROWS, **options)
    env.action_space.seed(0)
    found = []
    for k in range(rounds + 1):
        env.reset(seed=k)
        actions = [env.action_space.sample() for _ in range(ACTIONS)]
        began = process_time()
        for a in actions:
            env.step(a)
        found.append((process_time() - began) / (ACTIONS * ROWS))
    return 1e6 * float(np.median(found[1:]))


def run(given: argparse.Namespace) -> Report:
    """All tasks, or some."""
    rounds = 2 if given.quick else ROUNDS
    names = given.tasks or (["Cartpole"] if given.quick else [*TASKS, FORCES])
    report, cells, missing = Report("Cost of environments, per action", ""), [], []
    for name in progress()([(n, n) for n in names], "environment"):
        try:
            step, simulated = single(name, rounds)
        except ImportError as error:  # Go2 without its file
            missing.append(f"{name}: {error}")
            continue
        each = batch(name, rounds)
        numbers = simulated, step, step - simulated, each, step / each
        cells.append([name, *(round(n, 1) for n in numbers)])
    report.tables.append(
        Table(
            "environments",
            ("environment", "simulation [us]", "step [us]", "Python [us]", "one of 64 [us]", "single / one of 64"),
            cells,
        )
    )
    over, gains = [row[3] for row in cells], [row[5] for row in cells]
    report.rows = [
        number("environments", len(cells)),
        number("environments whose files are missing", len(missing), note="; ".join(missing)),
        number("largest Python per step", max(over), None if given.quick else MOST, unit="us"),
        number("least gain of a batch of 64, 15 over it", LEAST / min(gains), None if given.quick else 1.0),
    ]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--tasks", nargs="+", choices=[*TASKS, FORCES])
    return deliver("environments", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
