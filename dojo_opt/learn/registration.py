"""Names of Gymnasium: `gymnasium.make("dojo/HalfCheetah-v0")`, and `make_vec` with one compiled batch.

`import dojo_opt.learn` registers them, and so does `gymnasium.make("dojo_opt.learn:dojo/HalfCheetah-v0")`.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from dojo_opt.learn.environment import Environment
    from dojo_opt.learn.task import Task
    from dojo_opt.learn.vector_environment import VectorEnvironment

__all__ = ["TASKS", "environment", "register", "task_of", "vector_environment"]

TASKS = {  # name: module and function, steps of an episode
    "HalfCheetah": ("gymnasium_tasks", "half_cheetah", 1000),
    "Hopper": ("gymnasium_tasks", "hopper", 1000),
    "Walker2d": ("gymnasium_tasks", "walker2d", 1000),
    "Ant": ("gymnasium_tasks", "ant", 1000),
    "Humanoid": ("gymnasium_tasks", "humanoid", 1000),
    "Cartpole": ("gymnasium_tasks", "cartpole", 1000),
    "Pendulum": ("gymnasium_tasks", "pendulum", 200),
    "Swimmer": ("swimmer_task", "swimmer", 1000),
    "Quadruped": ("velocity_task", "quadruped", 500),
    "Go2": ("velocity_task", "go2", 500),
    "AntArs": ("dojo_tasks", "ant_ars", 150),
    "QuadrupedSampling": ("dojo_tasks", "quadruped_sampling", 200),
    "QuadrotorWaypoint": ("waypoint_tasks", "quadrotor", 500),
    "UuvWaypoint": ("waypoint_tasks", "uuv", 300),
    "YoubotWaypoint": ("waypoint_tasks", "youbot", 300),
}


@cache
def task_of(name: str, **options: Any) -> Task:
    """One task for all environments of a process: its models and compiled functions are shared.

    options: arguments of its function.
    """
    module, function, _ = TASKS[name]
    found: Task = getattr(import_module(f"dojo_opt.learn.{module}"), function)(**options)
    return found


def environment(task: str, render_mode: str | None = None, **options: Any) -> Environment:
    """A single environment."""
    from dojo_opt.learn.environment import Environment

    return Environment(task_of(task, **options), render_mode=render_mode)


def vector_environment(
    task: str,
    num_envs: int = 1,
    autoreset_mode: Any = None,
    max_episode_steps: int | None = None,
    **options: Any,
) -> VectorEnvironment:
    """Many environments."""
    from dojo_opt.learn.vector_environment import VectorEnvironment

    return VectorEnvironment(task_of(task, **options), num_envs, autoreset_mode, max_episode_steps)


def register() -> None:
    """Register all names; those that are there stay."""
    here = "dojo_opt.learn.registration"
    for name, (_, _, steps) in TASKS.items():
        if f"dojo/{name}-v0" not in gymnasium.registry:
            gymnasium.register(
                f"dojo/{name}-v0",
                entry_point=f"{here}:environment",
                vector_entry_point=f"{here}:vector_environment",
                max_episode_steps=steps,
                kwargs={"task": name},
            )
