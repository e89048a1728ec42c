"""Search over the weights of a policy by whole episodes: random directions, and the gradient of the return.

    ars               w += rate / (b s) sum over the b best of N directions d of (R(w + noise d) - R(w - noise d)) d
    gradient_search   w += rate / |g|   g,   g the mean gradient of the return of n rows

ARS is V2-t of Mania, Guy and Recht 2018 (arXiv 1803.07055), s the standard deviation of the 2b returns; the other is
the gradient search of Dojo (arXiv 2203.00806), here with the derivatives of the closed loop, and the 2-norm.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dojo_opt.learn.common_options import check_common
from dojo_opt.learn.epochs import learn
from dojo_opt.learn.network import Network
from dojo_opt.learn.observation_statistics import ObservationStatistics
from dojo_opt.learn.pair_returns import PairInputs, PairReturns, pair_returns
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.policy_rollout import Noise, roll_policy_batch
from dojo_opt.learn.randomization import Drawn, Models, Randomization
from dojo_opt.learn.shared_object import Shared
from dojo_opt.learn.task import Task
from dojo_opt.learn.training import Training
from dojo_opt.learn.training_result import Learned
from dojo_opt.planning.executors import results_in_order
from sim.mechanism import checks
from solvers.types import Floats

__all__ = ["GradientSearchOptions", "RandomSearchOptions", "ars", "gradient_search"]

_GROUP = 8  # directions that are rolled out together, with or without workers


@dataclass(frozen=True)
class RandomSearchOptions:
    """Settings of `ars`.

    Attributes:
        epochs: number of updates (default 100).
        directions: N of them per update, with two rollouts each (default 32).
        best: b of them that are used (default 4).
        rate: step of an update (default 0.02).
        noise: size of a direction (default 0.03).
        horizon: control steps of a rollout (default None: those of the task).
        hidden: sizes of hidden layers (default (): a linear policy).
        activation: "tanh" or "elu" (default "tanh").
        shift: number that is subtracted from the reward of every step, to offset the reward of survival (default 0).
        randomization: models that the policy learns on (default: that of the task).
        evaluations: number of evaluations on the way, evenly spaced, after one before the first epoch; the best policy
            is kept (default 10).
        episodes: of an evaluation (default 8).
        time_limit: of the processor time [s] (default inf).
        callback: function of the record of each epoch; it may raise StopIteration to end (default None).
        verbose: whether to print one line per evaluation (default False).
        stream: file for these lines (default None: the standard output).
    """

    epochs: int = 100
    directions: int = 32
    best: int = 4
    rate: float = 0.02
    noise: float = 0.03
    horizon: int | None = None
    hidden: tuple[int, ...] = ()
    activation: str = "tanh"
    shift: float = 0.0
    randomization: Randomization = Randomization()
    evaluations: int = 10
    episodes: int = 8
    time_limit: float = float("inf")
    callback: Callable[[dict[str, Any]], None] | None = None
    verbose: bool = False
    stream: Any = None

    def __post_init__(self) -> None:
        check_common("ars", self)
        for name in ("directions", "best"):
            checks.whole_number(f"ars({name}=...)", getattr(self, name))
        checks.number("ars(noise=...)", self.noise, above=0.0)
        checks.number("ars(shift=...)", self.shift)
        if self.best > self.directions:
            raise ValueError(f"ars(best=...): expected at most {self.directions}, as directions, got {self.best}")


@dataclass(frozen=True)
class GradientSearchOptions:
    """Settings of `gradient_search`.

    Attributes:
        epochs: number of updates (default 100).
        environments: rows of the batch, whose gradients are averaged (default 8).
        rate: length of an update (default 0.05).
        horizon: control steps of a rollout (default None: those of the task).
        hidden: sizes of hidden layers (default (): a linear policy).
        activation: "tanh" or "elu" (default "tanh").
        costate: largest length of the costate of a row; longer ones are shortened and counted (default 1e3).
        kappa_grad: smoothing of the derivatives [N s m] (default None: that of the motion).
        randomization: models that the policy learns on (default: that of the task).
        evaluations: number of evaluations on the way, evenly spaced, after one before the first epoch; the best policy
            is kept (default 10).
        episodes: of an evaluation (default 8).
        time_limit: of the processor time [s] (default inf).
        callback: function of the record of each epoch; it may raise StopIteration to end (default None).
        verbose: whether to print one line per evaluation (default False).
        stream: file for these lines (default None: the standard output).
    """

    epochs: int = 100
    environments: int = 8
    rate: float = 0.05
    horizon: int | None = None
    hidden: tuple[int, ...] = ()
    activation: str = "tanh"
    costate: float = 1e3
    kappa_grad: float | None = None
    randomization: Randomization = Randomization()
    evaluations: int = 10
    episodes: int = 8
    time_limit: float = float("inf")
    callback: Callable[[dict[str, Any]], None] | None = None
    verbose: bool = False
    stream: Any = None

    def __post_init__(self) -> None:
        check_common("gradient_search", self)
        checks.whole_number("gradient_search(environments=...)", self.environments)
        for name in ("costate",) if self.kappa_grad is None else ("costate", "kappa_grad"):
            checks.number(f"gradient_search({name}=...)", getattr(self, name), above=0.0)


class WeightSearch(Training):
    """A policy that moves as a whole."""

    def __init__(self, task: Task, options: Any, seed: int) -> None:
        super().__init__(task, options, seed)
        self.models = Models(task, options.randomization, np.random.default_rng((seed, 3)))
        network = Network((task.observations, *options.hidden, task.sim.nu), options.activation)
        n = task.observations
        weights = network.start(np.random.default_rng((seed, 0)), 0.1) if options.hidden else np.zeros(network.count)
        self.policy = LearnedPolicy(network, weights, np.zeros(n), np.ones(n), task)
        self.statistics = ObservationStatistics(n)
        self.horizon = task.steps if options.horizon is None else options.horizon
        self.chosen = self.policy

    def train(self) -> dict[str, Any]:
        """One update: its record, without an evaluation."""
        self.policy.mean[:], self.policy.deviation[:] = self.statistics.sums[0], self.statistics.deviation()
        found, length, share = self.update()
        self.epoch += 1
        return self.record(found, length, share)

    def update(self) -> tuple[float, float, float]:
        """Move the policy: (mean return, length of the gradient, share of clipped costates)."""
        raise NotImplementedError

    def arrays(self) -> dict[str, Floats]:
        """As Training.arrays, with the statistics of observations."""
        return super().arrays() | {"sums": self.statistics.sums}


class RandomSearch(WeightSearch):
    """ARS."""

    algorithm = "ars"

    def update(self) -> tuple[float, float, float]:
        """As WeightSearch.update; a pair shares its first state, its model, its noise and its pushes."""
        o, policy = self.options, self.policy
        directions = self.rng.standard_normal((o.directions, policy.network.count))
        x = self.task.starts([self.rng] * o.directions)
        drawn = self.models.draw(self.rng, o.directions)
        found = np.zeros((2, o.directions))
        groups = [slice(k, min(k + _GROUP, o.directions)) for k in range(0, o.directions, _GROUP)]
        for part, pairs in zip(groups, self._all_pairs(groups, directions, x, drawn), strict=True):
            found[:, part] = pairs.returns
            self.statistics.join(pairs.seen)
            self.steps, self.unsolved = self.steps + pairs.steps, self.unsolved + pairs.unsolved
        ahead, back = found
        best = np.argsort(-np.maximum(ahead, back), kind="stable")[: o.best]
        spread = float(np.concatenate([ahead[best], back[best]]).std())
        step = ((ahead - back)[best] @ directions[best]) / (o.best * max(spread, 1e-9))
        if np.all(np.isfinite(step)):
            policy.weights += o.rate * step
        else:
            self.infinite += 1
        return float(found.mean()), float(np.linalg.norm(step)), 0.0

    def _all_pairs(self, groups: list[slice], directions: Floats, x: Floats, drawn: Drawn) -> list[PairReturns]:
        """Returns of all groups of directions, which workers find as the caller does."""
        o, policy = self.options, self.policy
        scale = policy.mean.copy(), policy.deviation.copy()
        calls, seeds = [], np.random.default_rng((self.seed, 4, self.epoch))
        for part in groups:
            rows = drawn.rows(np.arange(part.start, part.stop))
            moves = o.noise * directions[part]
            given = PairInputs(
                policy.network, policy.weights, scale, moves, x[part], rows.substeps, rows.kappa, rows.parameters,
                rows.delay, int(seeds.integers(2**63)),
            )  # fmt: skip
            calls.append((self.shared, given, self.horizon, o.shift))
        return list(results_in_order(pair_returns, calls, self.executor))

    @cached_property
    def shared(self) -> Shared:
        """Data of every worker."""
        return Shared((self.task, self.models))


class GradientSearch(WeightSearch):
    """Gradient search."""

    algorithm = "gradient_search"

    def update(self) -> tuple[float, float, float]:
        """As WeightSearch.update; a row ends with its episode."""
        o, task, policy = self.options, self.task, self.policy
        x = task.starts([self.rng] * o.environments)
        drawn = self.models.draw(self.rng, o.environments)
        noise = Noise.of_observations(self.rng, task, (self.horizon, o.environments), o.randomization)
        roll = roll_policy_batch(
            policy, x, self.horizon, drawn=drawn, noise=noise, slopes=True, kappa_grad=o.kappa_grad
        )
        over = np.logical_or.accumulate(roll.terminated | roll.unsolved, axis=0)
        weights = np.ones_like(roll.rewards)
        weights[1:] = ~over[:-1]
        self.steps += int(weights.sum())
        self.unsolved += int((roll.unsolved & (weights > 0.0)).sum())
        found = roll.gradient(weights / o.environments, limit=o.costate)
        self.statistics.add(roll.observations[weights > 0.0])
        length = float(np.linalg.norm(found.weights))
        if np.isfinite(length):
            policy.weights += o.rate / max(length, 1e-9) * found.weights
        else:
            self.infinite += 1
        return float((weights * roll.rewards).sum() / o.environments), length, found.clipped / weights.size


def ars(
    task: Task, *, seed: int = 0, resume: Learned | None = None, executor: Executor | None = None, **options: Any
) -> Learned:
    """Augmented random search, without derivatives: see the module, and `dojo.learn.RandomSearchOptions`.

    Args:
        task: the task to learn.
        seed: of all random numbers; the same seed gives the same policy, to the last bit, on a kind of processor.
        resume: a run to continue, of the same task, seed and options.
        executor: anything with the interface of `concurrent.futures.Executor`, as for `dojo.monte_carlo`; its workers
            roll out the directions, and the policy is the same to the last bit (default None: none).
        **options: fields of `dojo.learn.RandomSearchOptions`.

    Returns:
        Learned, with the best of the evaluated policies.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a value out of range, or a run that does not fit.
    """
    return learn(RandomSearch, RandomSearchOptions, task, seed, resume, options, executor)


def gradient_search(task: Task, *, seed: int = 0, resume: Learned | None = None, **options: Any) -> Learned:
    """Ascend the gradient of the return of whole episodes: see the module, and `dojo.learn.GradientSearchOptions`.

    Args:
        task: the task to learn.
        seed: of all random numbers; the same seed gives the same policy, to the last bit, on a kind of processor.
        resume: a run to continue, of the same task, seed and options.
        **options: fields of `dojo.learn.GradientSearchOptions`.

    Returns:
        Learned, with the best of the evaluated policies.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a value out of range, or a run that does not fit.
    """
    return learn(GradientSearch, GradientSearchOptions, task, seed, resume, options)
