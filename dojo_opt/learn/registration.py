"""Names of Gymnasium: `gymnasium.make("dojo/HalfCheetah-v0")`, and `make_vec` with one compiled batch.

`import dojo_opt.learn` registers them, and so does `gymnasium.make("dojo_opt.learn:dojo/HalfCheetah-v0")`.
"""

from __future__ import annotations

from collections.abc import Hashable
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium

from dojo_opt.learn.environment_names import TASKS

if TYPE_CHECKING:
    from dojo_opt.learn.environment import Environment
    from dojo_opt.learn.task import Task
    from dojo_opt.learn.vector_environment import VectorEnvironment

__all__ = ["environment", "register", "task_of", "vector_environment"]


def task_of(name: str, **options: Any) -> Task:
    """One task for all environments of a process with these options: its models and compiled functions are shared.

    options: arguments of its function; those that cannot be hashed, such as lists, make a task of their own.
    """
    shared = all(isinstance(option, Hashable) for option in options.values())
    return (_shared if shared else _made)(name, **options)


def _made(name: str, **options: Any) -> Task:
    module, function, _ = TASKS[name]
    found: Task = getattr(import_module(f"dojo_opt.learn.{module}"), function)(**options)
    return found


_shared = cache(_made)


def environment(task: str, render_mode: str | None = None, **options: Any) -> Environment:
    """A single environment."""
    from dojo_opt.learn.environment import Environment

    return Environment(task_of(task, **options), render_mode=render_mode)


def vector_environment(
    task: str,
    num_envs: int = 1,
    autoreset_mode: Any = None,
    max_episode_steps: int | None = None,
    render_mode: None = None,
    **options: Any,
) -> VectorEnvironment:
    """Many environments, which are not drawn."""
    if render_mode is not None:
        raise ValueError(f"make_vec(render_mode=...): only single environments are drawn, got {render_mode!r}")
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
