"""PairReturns: returns of episodes under weights perturbed in both directions (antithetic pairs), for random search."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from dojo_opt.learn.action_delay import ActionDelay
from dojo_opt.learn.network import Network
from dojo_opt.learn.observation_statistics import ObservationStatistics
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.policy_rollout import Noise
from dojo_opt.learn.shared_object import Shared
from solvers.status import Status
from solvers.types import Floats

__all__ = ["PairInputs", "PairReturns", "pair_returns"]


class PairInputs(NamedTuple):
    """A policy, moves of its weights, and the first state and model of each move."""

    network: Network
    weights: Floats  # (count,)
    scale: tuple[Floats, Floats]  # mean (no,), deviation (no,) of observations
    moves: Floats  # (n, count)
    x: Floats  # (n, nx)
    substeps: int
    kappa: Floats | None  # (n,)
    parameters: Mapping[str, Floats]  # each (n, components), or (1, components) of all rows
    delay: int  # [control steps]
    seed: int  # of the noise of observations and of the pushes


class PairReturns(NamedTuple):
    """Returns of n moves."""

    returns: Floats  # (2, n): ahead, behind
    seen: ObservationStatistics
    steps: int
    unsolved: int


def pair_returns(shared: Shared, given: PairInputs, horizon: int, shift: float) -> PairReturns:
    """Both returns of every move, all rows at once.

    Args:
        shared: a task and its Models.
        given: the moves.
        horizon: control steps.
        shift: subtracted from the reward of every step.

    Returns:
        PairReturns; the same in every process.
    """
    task, models = shared.value
    policy = LearnedPolicy(given.network, given.weights, *given.scale, task)
    n = len(given.moves)
    weights = np.concatenate([given.weights + given.moves, given.weights - given.moves])
    rows = np.concatenate([np.arange(n)] * 2)
    drawn = models.drawn(given.substeps, given.kappa, given.parameters, given.delay).rows(rows)
    out, alive, x = np.zeros(2 * n), np.arange(2 * n), given.x[rows]
    seen, steps, unsolved = ObservationStatistics.empty(task.observations), 0, 0
    noise = Noise.of_observations(np.random.default_rng(given.seed), task, (horizon, n), models.randomization)
    delays, impulses = ActionDelay(given.delay, 2 * n, task.sim.nu), drawn.sim.row_impulses(2 * n)
    for t in range(horizon):
        here, own = x[alive], drawn.rows(alive)
        observed = task.observe(here)[0]
        seen.add(observed)
        blurred = 0.0 if noise is None else noise.observations[t, rows[alive]]
        actions, _ = delays.apply(t, policy.actions(observed, weights[alive], blurred), given.delay, alive)
        found = own.step(here, task.inputs(actions), impulses=impulses)
        bad, over = found.status != Status.SOLVED, task.ends(found.x)
        rewards = task.rewards(here, actions, found.x)[0] + task.survival * ~over - shift
        out[alive] += np.where(bad, 0.0, rewards)
        x[alive] = found.x
        if noise is not None and noise.pushes is not None:
            x[alive, task.sim.nq : task.sim.nx] += noise.pushes[t, rows[alive]]
        steps, unsolved = steps + len(alive), unsolved + int(bad.sum())
        if (bad | over).any():
            alive, impulses = alive[~(bad | over)], impulses.of_rows(~(bad | over))
        if not len(alive):
            break
    return PairReturns(out.reshape(2, n), seen, steps, unsolved)
