"""Names of Gymnasium: `gymnasium.make("dojo/HalfCheetah-v0")`, and `make_vec` with one compiled batch.

`import dojo_opt.learn` registers them, and so does `gymnasium.make("dojo_opt.learn:dojo/HalfCheetah-v0")`.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from dojo_opt.learn.environment import Environment
    from dojo_opt.learn.task import Task
    from dojo_opt.learn.vector_environment import VectorEnvironment

__all__ = ["TASKS", "environment", "register", "vector_environment"]

TASKS = {  # name: function of gymnasium_tasks.py, steps of an episode
    "HalfCheetah": ("half_cheetah", 1000),
    "Hopper": ("hopper", 1000),
    "Walker2d": ("walker2d", 1000),
    "Ant": ("ant", 1000),
    "Humanoid": ("humanoid", 1000),
    "Cartpole": ("cartpole", 1000),
    "Pendulum": ("pendulum", 200),
}


@cache
def _task(name: str) -> Task:
    """One task for all environments of a process: its models and compiled functions are shared."""
    from dojo_opt.learn import gymnasium_tasks

    found: Task = getattr(gymnasium_tasks, TASKS[name][0])()
    return found


def environment(task: str, render_mode: str | None = None) -> Environment:
    """A single environment."""
    from dojo_opt.learn.environment import Environment

    return Environment(_task(task), render_mode=render_mode)


def vector_environment(task: str, num_envs: int = 1, **options: Any) -> VectorEnvironment:
    """Many environments."""
    from dojo_opt.learn.vector_environment import VectorEnvironment

    return VectorEnvironment(_task(task), num_envs, **options)


def register() -> None:
    """Register all names; those that are there stay."""
    here = "dojo_opt.learn.registration"
    for name, (_, steps) in TASKS.items():
        if f"dojo/{name}-v0" not in gymnasium.registry:
            gymnasium.register(
                f"dojo/{name}-v0",
                entry_point=f"{here}:environment",
                vector_entry_point=f"{here}:vector_environment",
                max_episode_steps=steps,
                kwargs={"task": name},
            )
