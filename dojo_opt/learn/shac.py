"""SHAC: short-horizon actor-critic, with the derivatives of the simulator (Xu et al. 2022, arXiv 2204.07137).

    L(weights) = -1/(n H) sum_i [ sum_t gamma^t r_t + gamma^H V(x_H) ],   V trained on TD(lambda) returns

A row of the batch continues where the last epoch ended; the sums start anew where its episode ends. The end of an
episode has no derivative, so that a policy would learn to lunge into it. Where a task tells a smooth
`survival_probability` s(x), the discount of all that follows a state is gamma s(x) instead of gamma, and is
differentiated; a row starts anew where nothing that follows would count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dojo_opt.learn.action_delay import ActionDelay
from dojo_opt.learn.common_options import check_common
from dojo_opt.learn.critic_fit import fit_network
from dojo_opt.learn.discounted_sum import DiscountedSum
from dojo_opt.learn.epochs import learn
from dojo_opt.learn.evaluation import evaluate
from dojo_opt.learn.network import Adam, Network, clipped
from dojo_opt.learn.observation_statistics import ObservationStatistics
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.policy_rollout import Noise, PolicyRollout, roll_policy_batch, value_network
from dojo_opt.learn.randomization import Models, Randomization
from dojo_opt.learn.task import Task
from dojo_opt.learn.training import Training
from dojo_opt.learn.training_result import Learned
from dojo_opt.planning.same_robot import check_same_names
from sim.mechanism import checks
from solvers.types import Flags, Floats

__all__ = ["ShacOptions", "shac"]


_KNOWN = 1e4  # observations that the scaling of a given policy counts for
_LOST = 0.1  # survival probability below which a row starts anew
_GROWN = 0.7  # share of the epochs after which pushes grow no more


@dataclass(frozen=True)
class ShacOptions:
    """Settings of `shac`.

    Attributes:
        epochs: number of epochs; each is one rollout of the batch and one step of the policy (default 900).
        environments: rows of the batch (default 64).
        horizon: control steps of an epoch (default 16).
        episode: control steps after which a row starts anew while learning (default None: those of the task). If a row
            stays in one posture during long episodes, short ones bring it back.
        hidden: sizes of the hidden layers of policy and critic (default (64, 64)).
        activation: "tanh" or "elu" (default "tanh").
        gamma: discount of a control step (default 0.99).
        trace: lambda of TD(lambda) (default 0.95).
        rate: first learning rate of the policy, falling linearly to zero (default 1e-3).
        critic_rate: learning rate of the critic (default 2e-3).
        betas: of Adam (default (0.7, 0.95)).
        norm: largest length of the gradient (default 1).
        costate: largest length of the costate of a row; longer ones are shortened and counted (default 100).
        saturation: cost of outputs y of the network beyond 1.5, this times (|y| - 1.5)^2 in each step: near
            saturation the gradient of the squashed action vanishes, and the policy cannot recover (default 0).
        deviation: first and last standard deviation of the noise of actions, before they are squashed (default .4, .3).
        passes: passes of the critic over the data of an epoch (default 4).
        batches: minibatches per pass (default 4).
        blend: share of the critic in its target network after an epoch (default 0.3).
        randomization: models that the policy learns on (default: that of the task).
        push_factors: factors of the pushes of `randomization` in the first epoch and from 70 % of the epochs on, linear
            in between (default 1, 1). Evaluations have the pushes as they are.
        robust: whether the best policy is the one with the largest sum of mean returns with and without the pushes of
            `randomization`, if it has any, instead of those without (default False).
        kappa_grad: smoothing of the derivatives [N s m] (default None: that of the motion).
        cutoff: that of the simulators it learns on, as of `Simulator` (default None: that of the task): at a large
            kappa all contacts of a robot act, and far ones hardly count. Evaluations have that of the task.
        start: policy to begin with, of `imitate` or another run; it brings its network and scaling (default None).
        evaluations: number of evaluations on the way, evenly spaced, after one before the first epoch; the best policy
            is kept (default 10).
        episodes: of an evaluation (default 8).
        time_limit: of the processor time [s] (default inf).
        callback: function of the record of each epoch; it may raise StopIteration to end (default None).
        verbose: whether to print one line per evaluation (default False).
        stream: file for these lines (default None: the standard output).
    """

    epochs: int = 900
    environments: int = 64
    horizon: int = 16
    episode: int | None = None
    hidden: tuple[int, ...] = (64, 64)
    activation: str = "tanh"
    gamma: float = 0.99
    trace: float = 0.95
    rate: float = 1e-3
    critic_rate: float = 2e-3
    betas: tuple[float, float] = (0.7, 0.95)
    norm: float = 1.0
    costate: float = 100.0
    saturation: float = 0.0
    deviation: tuple[float, float] = (0.4, 0.3)
    passes: int = 4
    batches: int = 4
    blend: float = 0.3
    randomization: Randomization = Randomization()
    push_factors: tuple[float, float] = (1.0, 1.0)
    robust: bool = False
    kappa_grad: float | None = None
    cutoff: float | None = None
    start: LearnedPolicy | None = None
    evaluations: int = 10
    episodes: int = 8
    time_limit: float = float("inf")
    callback: Callable[[dict[str, Any]], None] | None = None
    verbose: bool = False
    stream: Any = None

    def __post_init__(self) -> None:
        lengths = () if self.episode is None else ("episode",)
        check_common("shac", self)
        if not isinstance(self.robust, bool):
            raise TypeError(f"shac(robust=...): expected True or False, got {checks.shown(self.robust)}")
        for name in ("environments", "passes", "batches", *lengths):
            checks.whole_number(f"shac({name}=...)", getattr(self, name))
        for name in ("gamma", "trace", "blend"):
            checks.fraction(f"shac({name}=...)", getattr(self, name))
        kappa = () if self.kappa_grad is None else ("kappa_grad",)
        for name in ("critic_rate", "norm", "costate", *kappa):
            checks.number(f"shac({name}=...)", getattr(self, name), above=0.0)
        if self.cutoff is not None:
            checks.number("shac(cutoff=...)", self.cutoff, at_least=0.0)
        for name, most in (("deviation", float("inf")), ("push_factors", float("inf")), ("betas", 1.0)):
            first, last = checks.vector(f"shac({name}=...)", getattr(self, name), 2)
            if min(first, last) < 0.0 or max(first, last) >= most:
                raise ValueError(
                    f"shac({name}=...): expected two numbers from 0 to below {most:g}, got {first}, {last}"
                )
        checks.number("shac(saturation=...)", self.saturation, at_least=0.0)
        if not (self.start is None or isinstance(self.start, LearnedPolicy)):
            raise TypeError(f"shac(start=...): expected a LearnedPolicy, got {self.start!r}")


class ShacTraining(Training):
    """Policy, critic, environments and random numbers of a run."""

    algorithm = "shac"

    def __init__(self, task: Task, options: ShacOptions, seed: int) -> None:
        super().__init__(task, options, seed)
        o, rng = options, np.random.default_rng((seed, 0))
        self.restarts = np.random.default_rng((seed, 2))
        self.models = Models(task, o.randomization, np.random.default_rng((seed, 3)), o.cutoff)
        network = Network((task.observations, *o.hidden, task.sim.nu), o.activation)
        self.critic = value_network(task, o.hidden, o.activation)
        self.policy = LearnedPolicy(network, network.start(rng, 0.1), *self._scale(None), task)
        if o.start is not None:
            if o.start.task is not None:
                names = (t.sim.mechanism.dof_names for t in (task, o.start.task))
                check_same_names("shac(start=...)", *names)
            network = o.start.network
            self.policy = replace(o.start, weights=o.start.weights.copy(), task=task)
        self.value = self.critic.start(rng)
        self.target = self.value.copy()
        self.actor_adam, self.critic_adam = Adam(network.count, o.betas), Adam(self.critic.count, o.betas)
        self.statistics = ObservationStatistics(task.observations)
        if o.start is not None:
            self.statistics.sums[0], self.statistics.sums[1] = o.start.mean, o.start.deviation**2
            self.statistics.sums[2] = _KNOWN
            self.policy.mean, self.policy.deviation = self._scale(self.statistics)
        self.x = task.starts([self.restarts] * o.environments)
        self.delays = ActionDelay(max(o.randomization.delays, default=0), o.environments, task.sim.nu)
        self.limit = task.steps if o.episode is None else min(o.episode, task.steps)
        self.age = self.restarts.integers(self.limit, size=o.environments)
        self.running, self.known = np.zeros(o.environments), np.zeros(o.environments, dtype=np.bool_)
        self.first, self.drawn = self.x.copy(), o.environments  # states to begin with, of which so many are in use
        self.finished: list[float] = []
        self.chosen = self.policy
        self.statistics.add(task.observe(self.x)[0])

    def _scale(self, statistics: ObservationStatistics | None) -> tuple[Floats, Floats]:
        """(mean, deviation) of observations."""
        n = self.task.observations
        return (np.zeros(n), np.ones(n)) if statistics is None else (statistics.sums[0].copy(), statistics.deviation())

    # -- values --------------------------------------------------------------------------------------------------------

    def values(self, weights: Floats, states: Floats, chosen: Flags) -> tuple[Floats, Floats]:
        """(V (n,) of states (n, nx), dV/dx (n, ndx) of the chosen ones, zeros elsewhere); the network gives
        V (1 - gamma).
        """
        policy, task, unit = self.policy, self.task, 1.0 / max(1.0 - self.options.gamma, 1e-3)
        out, _ = self.critic.forward(weights, policy.scaled(task.observe(states)[0]))
        observations, rates = task.observe(states[chosen], slopes=True)
        _, kept = self.critic.forward(weights, policy.scaled(observations))
        inside = np.abs((observations - policy.mean) / policy.deviation) < 10.0
        g = self.critic.backward(weights, kept, np.full((len(rates), 1), unit)) * inside / policy.deviation
        slopes = np.zeros((len(states), task.sim.ndx))
        slopes[chosen] = np.matmul(g[:, None], rates)[:, 0]
        return unit * out[:, 0], slopes

    # -- one epoch -----------------------------------------------------------------------------------------------------

    def restart(self, roll: PolicyRollout, t: int) -> Flags:
        """Which rows start anew after step t; their states are replaced."""
        self.age += 1
        states = roll.x[t + 1]
        anew = (roll.survival[t] < _LOST) | roll.terminated[t] | roll.unsolved[t] | (self.age >= self.limit)
        for row in np.flatnonzero(anew):
            states[row], self.age[row] = self._first_state(), 0
        self.task.redraw(states, self.age, [self.restarts] * len(states))
        return anew

    def _first_state(self) -> Floats:
        """A first state (nx,); many are drawn at once, which takes a third of the time per state."""
        if self.drawn == len(self.first):
            self.first[:], self.drawn = self.task.starts([self.restarts] * len(self.first)), 0
        self.drawn += 1
        return self.first[self.drawn - 1]

    def train(self) -> dict[str, Any]:
        """One epoch: its record, without an evaluation."""
        o, n = self.options, self.options.environments
        self.policy.mean[:], self.policy.deviation[:] = self._scale(self.statistics)
        share = self.epoch / o.epochs
        deviation = o.deviation[0] + share * (o.deviation[1] - o.deviation[0])
        drawn = self.models.draw(self.rng, n)
        push = o.push_factors[0] + (o.push_factors[1] - o.push_factors[0]) * min(1.0, share / _GROWN)
        noise = Noise.draw(self.rng, self.task, (o.horizon, n), deviation, o.randomization, push)
        roll = roll_policy_batch(
            self.policy, self.x, o.horizon, drawn=drawn, noise=noise, slopes=True,
            kappa_grad=o.kappa_grad, delays=self.delays, restart=self.restart,
        )  # fmt: skip
        self._count(roll)
        last = roll.cut.copy()
        last[-1] = True
        after, by_value = self.values(self.target, roll.after.reshape(o.horizon * n, -1), last.ravel())
        after, by_value = after.reshape(o.horizon, n), by_value.reshape(o.horizon, n, -1)
        total = DiscountedSum(roll, after, o.gamma)
        length, share_clipped = self._improve(total, by_value, o.rate * (1.0 - share))
        self.fit_critic(roll, total.traced(o.trace))
        self.statistics.add(roll.observations.reshape(o.horizon * n, -1))
        self.x = roll.x[-1].copy()
        self.epoch += 1
        self.steps += o.horizon * n
        recent = float(np.mean(self.finished)) if self.finished else None
        return self.record(recent, length, share_clipped)

    def _count(self, roll: PolicyRollout) -> None:
        """Returns of finished episodes, the last n of them, and unsolved steps."""
        self.unsolved += int(roll.unsolved.sum())
        for rewards, cut in zip(roll.rewards, roll.cut, strict=True):
            self.running += rewards
            self.finished += [float(v) for v in self.running[cut & self.known]]
            self.known |= cut
            self.running[cut] = 0.0
        self.finished = self.finished[-self.options.environments :]

    def _improve(self, total: DiscountedSum, by_value: Floats, rate: float) -> tuple[float, float]:
        """Step of the policy: (length of the gradient, share of clipped costates)."""
        o = self.options
        weights, ends = total.weights(by_value)
        found = total.roll.gradient(weights, ends, o.costate, o.saturation)
        gradient, length = clipped(-found.weights / weights.size, o.norm)
        if np.isfinite(length):
            self.actor_adam.step(self.policy.weights, gradient, rate)
        else:
            self.infinite += 1
        return length, found.clipped / weights.size

    def fit_critic(self, roll: PolicyRollout, returns: Floats) -> None:
        """Steps of the critic towards the returns of solved steps, then of its target network."""
        o = self.options
        solved = ~roll.unsolved.ravel()
        inputs = self.policy.scaled(roll.observations.reshape(-1, self.task.observations))[solved]
        goals = returns.ravel()[solved] * max(1.0 - o.gamma, 1e-3)
        batches = [
            rows for _ in range(o.passes) for rows in np.array_split(self.rng.permutation(len(goals)), o.batches)
        ]
        fit_network(self.critic, self.value, self.critic_adam, (inputs, goals), batches, o.critic_rate, o.norm)
        self.target += o.blend * (self.value - self.target)

    # -- results -------------------------------------------------------------------------------------------------------

    def rating(self, policy: LearnedPolicy, value: float) -> float:
        """As Training.rating, with the mean return under pushes where robust policies are asked for."""
        o = self.options
        if not o.robust or o.randomization.pushes is None:
            return value
        return value + float(evaluate(policy, o.episodes, self.seed, pushes=o.randomization.pushes).returns.mean())

    def snapshot(self) -> LearnedPolicy:
        """A copy of the policy as it is now."""
        p = self.policy
        return LearnedPolicy(p.network, p.weights.copy(), *self._scale(self.statistics), self.task)

    NUMBERS = (*Training.NUMBERS, "seed", "drawn")

    def arrays(self) -> dict[str, Floats]:
        """As Training.arrays, with rows, values, statistics and the moments of Adam."""
        rows = {name: getattr(self, name) for name in ("x", "age", "first", "running", "known", "value", "target")}
        moments = {"actor": self.actor_adam.moments, "critic": self.critic_adam.moments}
        return super().arrays() | rows | {"sums": self.statistics.sums, "decided": self.delays.actions} | moments

    def state(self) -> dict[str, Any]:
        """As Training.state, with the returns of finished episodes."""
        own = {"finished": list(self.finished), "restarts": self.restarts.bit_generator.state}
        return super().state() | own

    def resume(self, learned: Learned) -> None:
        """As Training.resume."""
        super().resume(learned)
        self.finished, self.restarts.bit_generator.state = list(learned.state["finished"]), learned.state["restarts"]


def shac(task: Task, *, seed: int = 0, resume: Learned | None = None, **options: Any) -> Learned:
    """Learn a policy with the derivatives of the simulator: see the module, and `dojo.learn.ShacOptions`.

    Args:
        task: the task to learn.
        seed: of all random numbers; the same seed gives the same policy, to the last bit, on any number of cores of a
            kind of processor; others multiply matrices in another order.
        resume: a run to continue, of the same task, seed and options: epochs that are done are not done again.
        **options: fields of `dojo.learn.ShacOptions`; by default those of `task.settings`.

    Returns:
        Learned, with the best of the evaluated policies.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a value out of range, or a run that does not fit.
    """
    return learn(ShacTraining, ShacOptions, task, seed, resume, {**getattr(task, "settings", {}), **options})
