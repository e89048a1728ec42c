"""Evaluation: returns of whole episodes under a policy without noise."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.learn.action_delay import ActionDelay
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.randomization import Drawn, check_pushes, draw_pushes
from sim.mechanism.checks import whole_number
from sim.mechanism.memory_limit import room_for
from solvers.status import Status
from solvers.types import Floats, Integers

__all__ = ["Evaluation", "evaluate"]

_EPISODE = 1000.0  # bytes of its generator


class Evaluation(NamedTuple):
    """Episodes under a policy.

    Attributes:
        returns: (n,) sums of rewards.
        lengths: (n,) actions until they ended.
        unsolved: episodes that ended with a step that was not solved.
        states: (steps + 1, nx) of the first episode.
    """

    returns: Floats
    lengths: Integers
    unsolved: int
    states: Floats


def evaluate(
    policy: LearnedPolicy,
    episodes: int = 8,
    seed: int = 0,
    *,
    substeps: int | None = None,
    kappa: float | None = None,
    delay: int = 0,
    pushes: tuple[float, ArrayLike] | None = None,
) -> Evaluation:
    """Returns of episodes, all at once on all cores.

    Args:
        policy: a policy with a task.
        episodes: number of episodes.
        seed: of their first states.
        substeps: time steps per action; those of the task by default.
        kappa: smoothing [N s m]; that of the task by default.
        delay: control steps after which an action is applied (default 0).
        pushes: as of a `Randomization` (default None: none).

    Returns:
        Evaluation; the same for the same seed.

    Raises:
        ValueError: the policy has no task, or a number is out of range.
    """
    task = getattr(policy, "task", None)
    if task is None:
        raise ValueError(f"evaluate(policy): expected a policy with a task, got {policy!r}")
    count = room_for("evaluate(episodes)", episodes, 8.0 * (task.nx + task.observations) + _EPISODE, noun="episodes")
    model = Drawn.of(task)
    if substeps is not None:
        steps = whole_number("evaluate(substeps=...)", substeps)
        sim = task.sim.replace(time_step=task.knot_time / steps, kappa=task.sim.kappa)
        model = replace(model, sim=sim, substeps=steps)
    delays = ActionDelay(whole_number("evaluate(delay=...)", delay, 0), count, task.sim.nu)
    check_pushes("evaluate", pushes, task.sim.nv)
    velocities = slice(task.sim.nq, task.sim.nx)
    rngs = [np.random.default_rng((seed, i)) for i in range(count)]
    xs = task.starts(rngs)
    returns, lengths, unsolved = np.zeros(count), np.zeros(count, dtype=np.int64), 0
    alive, path, impulses = np.arange(count), [xs[0].copy()], model.sim.row_impulses(count)
    for age in range(task.steps):
        task.redraw(xs, np.full(count, age), rngs)
        x = xs[alive]
        actions, _ = delays.apply(age, policy.actions(task.observe(x)[0]), delay, alive)
        found = model.step(x, task.inputs(actions), kappa=kappa, impulses=impulses)
        bad = found.status != Status.SOLVED
        over = task.ends(found.x)
        returns[alive] += np.where(bad, 0.0, task.rewards(x, actions, found.x)[0] + task.survival * ~over)
        lengths[alive] += ~bad
        xs[alive], unsolved = found.x, unsolved + int(bad.sum())
        if pushes is not None:
            for i in alive:
                xs[i, velocities] += draw_pushes(rngs[i], task, (), pushes)
        if alive[0] == 0:
            path.append(xs[0].copy())
        if (bad | over).any():
            alive, impulses = alive[~(bad | over)], impulses.of_rows(~(bad | over))
        if not len(alive):
            break
    return Evaluation(returns, lengths, unsolved, np.array(path))
