"""imitate: a policy that repeats plans, their feedback included.

    min over weights    mean over knots t, and displacements d ~ N(0, spread^2) of states, of
                        |a(x_t (+) d) - a_t - G_t d|^2,    G_t = K_t over half the range of inputs

To first order in d this is the error of actions plus spread^2 times that of the derivatives of actions by states, so a
policy learns the gains of a plan from the same number of plans (Mordatch and Todorov 2014 use the gains, too). Targets
are limited to [-1, 1], as inputs are. `shac(..., start=policy)` continues from there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.learn.common_options import check_common
from dojo_opt.learn.epochs import learn
from dojo_opt.learn.evaluation import Evaluation
from dojo_opt.learn.network import Adam, Network, clipped
from dojo_opt.learn.observation_statistics import ObservationStatistics
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.task import Task
from dojo_opt.learn.training import Training
from dojo_opt.learn.training_result import Learned
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.same_robot import check_same_knots, check_same_robot, check_same_velocities
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from solvers.types import Floats

__all__ = ["ImitationOptions", "imitate"]


@dataclass(frozen=True)
class ImitationOptions:
    """Settings of `imitate`.

    Attributes:
        epochs: number of epochs; in each, all knots are displaced anew (default 200).
        spread: standard deviation of displaced states, one or (ndx,) [m, rad, m/s, rad/s] (default 0.05).
        copies: displaced states per knot (default 4), beside the knot itself.
        batches: steps of the policy per epoch (default 8).
        rate: first learning rate, falling linearly to zero (default 3e-3).
        norm: largest length of the gradient (default 1).
        hidden: sizes of the hidden layers (default (64, 64)).
        activation: "tanh" or "elu" (default "tanh").
        evaluations: number of evaluations on the way, evenly spaced, after one before the first epoch; the best policy
            is kept (default 4).
        episodes: of an evaluation (default 8).
        time_limit: of the processor time [s] (default inf).
        callback: function of the record of each epoch; it may raise StopIteration to end (default None).
        verbose: whether to print one line per evaluation (default False).
        stream: file for these lines (default None: the standard output).
    """

    epochs: int = 200
    spread: ArrayLike = 0.05
    copies: int = 4
    batches: int = 8
    rate: float = 3e-3
    norm: float = 1.0
    hidden: tuple[int, ...] = (64, 64)
    activation: str = "tanh"
    evaluations: int = 4
    episodes: int = 8
    time_limit: float = float("inf")
    callback: Callable[[dict[str, Any]], None] | None = None
    verbose: bool = False
    stream: Any = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        check_common("imitate", self)
        checks.whole_number("imitate(batches=...)", self.batches)
        checks.whole_number("imitate(copies=...)", self.copies, 0)
        checks.number("imitate(norm=...)", self.norm, above=0.0)
        if checks.floats("imitate(spread=...)", self.spread).min(initial=0.0) < 0.0:
            raise ValueError(f"imitate(spread=...): expected numbers >= 0, got {self.spread!r}")


class _Knots:
    """Knots of all plans: states (n, nx), actions (n, nu), their derivatives by states (n, nu, ndx)."""

    def __init__(self, task: Task, plans: Sequence[Any]) -> None:
        call, sim = "imitate(plans)", task.sim
        if task.nx != sim.nx:
            raise ValueError("imitate(task): states of this task end with commands or forces, which plans do not have")
        half = 0.5 * (task.high - task.low)
        parts: list[tuple[Floats, Floats, Floats]] = []
        if isinstance(plans, str) or not isinstance(plans, Iterable):
            raise TypeError(f"{call}: expected plans, or (states, inputs, gains), got {checks.shown(plans)}")
        for given in plans:
            raw = (given.x, given.u, given.K) if isinstance(given, Plan) else given
            if not isinstance(raw, tuple | list) or len(raw) != 3:
                raise TypeError(f"{call}: expected plans, or (states, inputs, gains), got {given!r}")
            if isinstance(given, Plan):
                check_same_robot(f"{call}: expected plans", sim, given.simulator, given.x, given.u.shape[1])
                check_same_velocities(call, sim, given.simulator)
                check_same_knots(call, given, task.knot_time, "the actions of the task")
            us = checks.array(call, raw[1], ("T", sim.nu))
            xs = checks.array(call, raw[0], (len(us) + 1, sim.nx))
            Ks = checks.array(call, raw[2], (len(us), sim.nu, sim.ndx))
            parts.append((xs[:-1], (us - 0.5 * (task.high + task.low)) / half, Ks / half[:, None]))
        if not parts:
            raise ValueError(f"{call}: expected at least one plan, got none")
        self.x, self.actions, self.gains = (np.concatenate(column) for column in zip(*parts, strict=True))


class _Imitation(Training):
    """Policy and random numbers of a run."""

    algorithm = "imitate"
    advice = (
        "It does not follow the plans, or their motions have a smaller return: try more epochs or copies, a smaller "
        "spread, or more plans, made for the reward of the task."
    )
    plans: Sequence[Any] = ()

    def __init__(self, task: Task, options: ImitationOptions, seed: int) -> None:
        super().__init__(task, options, seed)
        self.knots = _Knots(task, self.plans)
        network = Network((task.observations, *options.hidden, task.sim.nu), options.activation)
        statistics = ObservationStatistics.empty(task.observations)
        statistics.add(task.observe(self.knots.x)[0])
        scale = statistics.sums[0].copy(), statistics.deviation()
        self.policy = LearnedPolicy(network, network.start(np.random.default_rng((seed, 0)), 0.1), *scale, task)
        self.adam = Adam(network.count, (0.9, 0.99))
        self.spread = checks.spread("imitate(spread=...)", options.spread, task.sim.ndx)
        self.chosen = self.policy

    def targets(self) -> tuple[Floats, Floats]:
        """Observations (m, no) around the knots, and the actions (m, nu) of the plans there."""
        knots, o = self.knots, self.options
        repeated = np.repeat(np.arange(len(knots.x)), 1 + o.copies)
        d = self.spread * self.rng.standard_normal((len(repeated), self.task.sim.ndx))
        d[:: 1 + o.copies] = 0.0
        x = self.task.sim.integrate(knots.x[repeated], d)
        actions = knots.actions[repeated] + np.matmul(knots.gains[repeated], d[:, :, None])[:, :, 0]
        return self.task.observe(x)[0], np.clip(actions, -1.0, 1.0)

    def train(self) -> dict[str, Any]:
        """One epoch: its record, without an evaluation. Its "return" is minus the mean square error of actions."""
        o, policy = self.options, self.policy
        seen, actions = self.targets()
        rate, total, longest = o.rate * (1.0 - self.epoch / o.epochs), 0.0, 0.0
        for rows in np.array_split(self.rng.permutation(len(seen)), o.batches):
            y, kept = policy.network.forward(policy.weights, policy.scaled(seen[rows]))
            a = policy.squashed(y)
            error = a - actions[rows]
            slope = (np.abs(y) < 1.0) if policy.linear else 1.0 - a**2
            gradient = np.zeros(policy.network.count)
            policy.network.backward(policy.weights, kept, 2.0 * error * slope / max(len(rows), 1), gradient)
            gradient, length = clipped(gradient, o.norm)
            total, longest = total + float((error**2).sum()), max(longest, length)
            if np.isfinite(length):
                self.adam.step(policy.weights, gradient, rate)
            else:
                self.infinite += 1
        self.epoch += 1
        return self.record(-total / actions.size, longest, 0.0)

    def count(self, found: Evaluation) -> None:
        """All steps are those of evaluations."""
        self.steps, self.unsolved = self.steps + int(found.lengths.sum()), self.unsolved + found.unsolved

    def arrays(self) -> dict[str, Floats]:
        """As Training.arrays, with the moments of Adam."""
        return super().arrays() | {"moments": self.adam.moments}


def imitate(
    task: Task, plans: Sequence[Any], *, seed: int = 0, resume: Learned | None = None, **options: Any
) -> Learned:
    """Learn a policy from plans and their gains: see the module, and `dojo.learn.ImitationOptions`.

    Args:
        task: whose states, inputs and control steps the plans have.
        plans: of `dojo.ilqr`, or (states (T + 1, nx), inputs (T, nu) [N, N m], gains (T, nu, ndx)).
        seed: of all random numbers; the same seed gives the same policy, to the last bit, on a kind of processor.
        resume: a run to continue, of the same plans, seed and options.
        **options: fields of `dojo.learn.ImitationOptions`.

    Returns:
        Learned, with the best of the evaluated policies.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a value out of range, or plans that do not fit the task.
    """
    if isinstance(plans, Plan) or not isinstance(plans, Sequence):
        raise TypeError(f"imitate(plans): expected a list of plans, got {plans!r}")
    search = type("Imitation", (_Imitation,), {"plans": plans})
    return learn(search, ImitationOptions, task, seed, resume, options)
