"""Motions of many rows under a policy, and the gradient of their rewards by its weights and the first states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dojo_opt.learn.action_delay import ActionDelay
from dojo_opt.learn.network import Network
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.randomization import Drawn, Randomization, draw_pushes
from dojo_opt.learn.task import Task
from sim.mechanism.short_repr import short_repr
from solvers.status import Status
from solvers.types import Flags, Floats

__all__ = ["Noise", "PolicyGradient", "PolicyRollout", "roll_policy_batch"]

_SPAN = 10.0  # as in policy.py
_STEEP = 1.5  # outputs that are squashed to actions beyond 0.9


@dataclass(frozen=True)
class Noise:
    """Noise of a rollout: before the squashing of actions, of scaled observations, and of velocities after actions."""

    actions: Floats  # (T, n, nu)
    observations: Floats  # (T, n, no)
    pushes: Floats | None = None  # (T, n, nv) [m/s, rad/s]

    __repr__ = short_repr

    @classmethod
    def draw(
        cls,
        rng: np.random.Generator,
        task: Task,
        shape: tuple[int, int],
        deviation: float,
        given: Randomization,
        push_factor: float = 1.0,
    ) -> Noise:
        """Normal noise of actions with a deviation, of observations with that of a randomisation, and the pushes of the
        latter times a factor.
        """
        actions = deviation * rng.standard_normal((*shape, task.sim.nu))
        observations, pushes = given.noise * rng.standard_normal((*shape, task.observations)), None
        if given.pushes is not None:
            pushes = push_factor * draw_pushes(rng, task, shape, given.pushes)
        return cls(actions, observations, pushes)

    @classmethod
    def of_observations(
        cls, rng: np.random.Generator, task: Task, shape: tuple[int, int], given: Randomization
    ) -> Noise | None:
        """As `draw` without noise of actions; None, and nothing drawn, where a randomisation has no noise or pushes."""
        return cls.draw(rng, task, shape, 0.0, given) if given.noise or given.pushes is not None else None


@dataclass(frozen=True)
class PolicyGradient:
    """Gradient of sum_t,i w_ti r_ti + ... of a rollout.

    Attributes:
        weights: (count,) by the weights of the policy.
        states: (n, ndx) by the first states.
        clipped: costates of a row and step that were longer than the limit.
        largest: costate before the limit.
    """

    weights: Floats
    states: Floats
    clipped: int
    largest: float

    __repr__ = short_repr


class PolicyRollout:
    """A rollout (T steps, n rows), and the buffers of its derivatives.

    x            (T + 1, n, nx) states; where a row started anew, its new state
    after        (T, n, nx) states after each step
    actions      (T, n, nu) as decided; rewards (T, n)
    applied      (T, n, nu) actions of the step, and decided_in (T, n) the steps in which they were decided, -1 before
    terminated   (T, n) the episode has ended there; unsolved (T, n) the step was not solved, and has no reward
    cut          (T, n) the next step starts from another state: of both, and of episodes that were cut off

    Args:
        policy: a policy with a task.
        steps: T.
        rows: n.
    """

    def __init__(self, policy: LearnedPolicy, steps: int, rows: int) -> None:
        assert policy.task is not None
        self.policy, self.task = policy, policy.task
        sim = self.task.sim
        self.x = np.zeros((steps + 1, rows, self.task.nx))
        self.after = np.zeros((steps, rows, self.task.nx))
        self.observations = np.zeros((steps, rows, self.task.observations))
        self.outputs = np.zeros((steps, rows, sim.nu))  # before they are squashed
        self.actions, self.rewards = np.zeros((steps, rows, sim.nu)), np.zeros((steps, rows))
        self.applied, self.decided_in = np.zeros((steps, rows, sim.nu)), np.zeros((steps, rows), dtype=np.int64)
        self.terminated, self.unsolved, self.cut = (np.zeros((steps, rows), dtype=np.bool_) for _ in range(3))
        self._slopes: list[tuple[Floats, ...]] = []
        self._inside: list[Flags] = []
        self._kept: list[Floats] = []

    def act(self, t: int, noise: Noise | None, slopes: bool) -> Floats:
        """Choose the actions (n, nu) of step t.

        Args:
            t: number of the step.
            noise: of the rollout, or None.
            slopes: whether to compute the derivatives.

        Returns:
            (n, no, ndx) derivatives of the observations by the states, or none.
        """
        policy = self.policy
        self.observations[t], rates = self.task.observe(self.x[t], slopes)
        scaled = (self.observations[t] - policy.mean) / policy.deviation
        if noise is not None:
            scaled = scaled + noise.observations[t]
        y, kept = policy.network.forward(policy.weights, np.clip(scaled, -_SPAN, _SPAN))
        if noise is not None:
            y = y + noise.actions[t]
        self.outputs[t], self.actions[t] = y, policy.squashed(y)
        if slopes:
            self._inside.append(np.abs(scaled) < _SPAN)
            self._kept.append(kept)
        return rates

    def keep(self, *slopes: Floats) -> None:
        """Keep the derivatives of a step: observation, A, B, reward.

        Args:
            *slopes: of the observations, A, B, of the rewards.
        """
        self._slopes.append(slopes)

    def gradient(
        self, weights: Floats, ends: Floats | None = None, limit: float = np.inf, saturation: float = 0.0
    ) -> PolicyGradient:
        """Gradient of sum_t,i weights_ti r_ti + sum_t,i e_ti(after_ti), by one sweep from the end.

            l_t = A_t^T m_t + dr/dx + O_t^T dL/do_t,    m_t = l_t+1 + dr/dx' + e_t',    dL/da_t = B_s^T m_s + dr_s/da

        where s is the step in which the action of step t is applied.

        Args:
            weights: (T, n) of the rewards.
            ends: (T, n, ndx) derivatives e' of further terms by the states after the steps.
            limit: length of the costate l of a row, beyond which it is shortened.
            saturation: cost of outputs y beyond 1.5, this times (|y| - 1.5)^2, whose actions have hardly a derivative.

        Returns:
            The gradient, by the weights and by the first states.
        """
        policy, ndx, nu = self.policy, self.task.sim.ndx, self.task.sim.nu
        rows = self.x.shape[1]
        costate, out, clipped, largest = np.zeros((rows, ndx)), np.zeros(policy.network.count), 0, 0.0
        half, by_decided = 0.5 * (self.task.high - self.task.low), np.zeros_like(self.actions)
        for t in range(len(self.actions) - 1, -1, -1):
            rates, A, B, reward = self._slopes[t]
            costate[self.cut[t]] = 0.0
            scale = np.where(self.unsolved[t], 0.0, weights[t])[:, None]
            after = costate + scale * reward[:, ndx + nu :]
            if ends is not None:
                after += ends[t]
            by_applied = half * np.matmul(after[:, None], B)[:, 0] + scale * reward[:, ndx : ndx + nu]
            known = np.flatnonzero(self.decided_in[t] >= 0)
            by_decided[self.decided_in[t, known], known] += by_applied[known]
            costate = np.matmul(after[:, None], A)[:, 0] + scale * reward[:, :ndx]
            a = self.actions[t]
            by_output = by_decided[t] * (np.abs(a) < 1.0 if policy.linear else 1.0 - a**2)
            y = self.outputs[t]
            by_output = by_output - 2.0 * saturation * np.sign(y) * np.maximum(np.abs(y) - _STEEP, 0.0)
            by_scaled = policy.network.backward(policy.weights, self._kept[t], by_output, out)
            costate += np.matmul((by_scaled * self._inside[t] / policy.deviation)[:, None], rates)[:, 0]
            length = np.sqrt(np.einsum("ni,ni->n", costate, costate))
            largest = max(largest, float(length.max(initial=0.0)))
            long = length > limit
            clipped += int(long.sum())
            costate[long] *= (limit / length[long])[:, None]
        return PolicyGradient(out, costate, clipped, largest)


def roll_policy_batch(
    policy: LearnedPolicy,
    starts: Floats,
    steps: int,
    *,
    drawn: Drawn | None = None,
    noise: Noise | None = None,
    slopes: bool = False,
    kappa_grad: float | None = None,
    delays: ActionDelay | None = None,
    restart: Callable[[int, Flags, Flags, Floats], Flags] | None = None,
) -> PolicyRollout:
    """Rows under a policy, each from its own state, on all cores.

    Args:
        policy: a policy with a task.
        starts: (n, nx) first states.
        steps: actions of each row.
        drawn: models of the rows; that of the task by default.
        noise: of actions and observations; none by default.
        slopes: whether `gradient` will be called.
        kappa_grad: smoothing of the derivatives [N s m]; that of the motion by default.
        delays: the last actions of the rows, for the delay of `drawn`; none by default, as where episodes begin.
        restart: function of (step, terminated (n,), unsolved (n,), states (n, nx)) that replaces the states of rows
            that start anew, and returns which these are (n,); by default rows go on, unsolved ones stand still.

    Returns:
        The rollout.

    Raises:
        ValueError: the policy has no task.
    """
    task = policy.task
    if task is None:
        raise ValueError("roll_policy_batch(policy): expected a policy with a task")
    model = Drawn.of(task) if drawn is None else drawn
    out = PolicyRollout(policy, steps, len(starts))
    lags = ActionDelay(model.delay, len(starts), task.sim.nu) if delays is None else delays
    lags.begin()
    out.x[0] = starts
    one_pass = slopes and kappa_grad is None
    impulses = model.sim.row_impulses(len(starts))
    for t in range(steps):
        rates = out.act(t, noise, slopes)
        out.applied[t], out.decided_in[t] = lags.apply(t, out.actions[t], model.delay)
        x, inputs = out.x[t], task.inputs(out.applied[t])
        found = model.step(x, inputs, one_pass, impulses=impulses)
        A, B, unsolved = found.A, found.B, found.status != Status.SOLVED
        if slopes and not one_pass:
            smooth = model.step(x, inputs, True, kappa_grad)
            A, B, unsolved = smooth.A, smooth.B, unsolved | (smooth.status != Status.SOLVED)
        out.after[t] = out.x[t + 1] = found.x
        out.rewards[t], by_reward = task.rewards(x, out.applied[t], found.x, slopes)
        out.terminated[t], out.unsolved[t] = task.ends(found.x), unsolved
        out.rewards[t] += task.survival * ~out.terminated[t]
        out.rewards[t, unsolved] = 0.0
        if slopes:
            out.keep(rates, A, B, by_reward)
        if noise is not None and noise.pushes is not None:
            out.x[t + 1, :, task.sim.nq : task.sim.nx] += noise.pushes[t]
        out.cut[t] = unsolved
        if restart is not None:
            out.cut[t] |= restart(t, out.terminated[t], unsolved, out.x[t + 1])
        lags.forget(out.cut[t])
        impulses.forget(out.cut[t])
    return out


def value_network(task: Task, hidden: tuple[int, ...], activation: str) -> Network:
    """The shape of a critic."""
    return Network((task.observations, *hidden, 1), activation)
