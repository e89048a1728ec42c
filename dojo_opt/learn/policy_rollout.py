"""Motions of many rows under a policy, and the gradient of their rewards by its weights and the first states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dojo_opt.learn.action_delay import ActionDelay
from dojo_opt.learn.costate_sweep import Sweep, SweepLimits, sweep_rows
from dojo_opt.learn.network import Network
from dojo_opt.learn.network_rows import forward_rows, parts
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.randomization import Drawn, Randomization, draw_pushes
from dojo_opt.learn.task import Task
from sim.mechanism.short_repr import short_repr
from solvers.status import Status
from solvers.types import Flags, Floats

__all__ = ["Noise", "PolicyGradient", "PolicyRollout", "roll_policy_batch"]

_SPAN = 10.0  # as in policy.py


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
        slopes: whether to keep derivatives, for `gradient` (default False).
    """

    def __init__(self, policy: LearnedPolicy, steps: int, rows: int, slopes: bool = False) -> None:
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
        self.slopes, self._packed = slopes, policy.network.packed(policy.weights)
        kept, no, ndx, nu = steps if slopes else 0, self.task.observations, sim.ndx, sim.nu
        self.rates, self.by_reward = np.zeros((kept, rows, no, ndx)), np.zeros((kept, rows, 2 * ndx + nu))
        self.A, self.B = np.zeros((kept, rows, ndx, ndx)), np.zeros((kept, rows, ndx, nu))
        self._inside = np.zeros((kept, rows, no), dtype=np.bool_)
        self._layers = np.zeros((kept, *policy.network.rows(rows).shape))

    def act(self, t: int, noise: Noise | None) -> None:
        """Choose the actions (n, nu) of step t.

        Args:
            t: number of the step.
            noise: of the rollout, or None.
        """
        policy, network = self.policy, self.policy.network
        self.observations[t], rates = self.task.observe(self.x[t], self.slopes)
        scaled = (self.observations[t] - policy.mean) / policy.deviation
        if noise is not None:
            scaled = scaled + noise.observations[t]
        layers = self._layers[t] if self.slopes else network.rows(len(scaled))
        layers[: len(scaled), : scaled.shape[1]] = np.clip(scaled, -_SPAN, _SPAN)
        forward_rows(self._packed, layers)
        y = network.outputs(layers, len(scaled))
        if noise is not None:
            y = y + noise.actions[t]
        self.outputs[t], self.actions[t] = y, policy.squashed(y)
        if self.slopes:
            self.rates[t], self._inside[t] = rates, np.abs(scaled) < _SPAN

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
        policy, (steps, rows), flat = self.policy, weights.shape, (len(weights) * weights.shape[1], -1)
        ndx, sums = self.task.sim.ndx, policy.network.sums(parts(rows))
        costates, half = np.zeros((rows, ndx)), 0.5 * (self.task.high - self.task.low)

        def cubes(array: Any) -> Any:
            return array.reshape(steps * rows, *array.shape[2:])

        sweep = Sweep(
            np.ascontiguousarray(weights).ravel(),
            np.zeros((0, ndx)) if ends is None else np.ascontiguousarray(ends).reshape(flat),
            self.cut.ravel(), self.unsolved.ravel(), self.decided_in.ravel(),
            cubes(self.A), cubes(self.B), cubes(self.rates), cubes(self.by_reward),
            cubes(self.outputs), cubes(self.actions), cubes(self._inside),
            self._layers, half, policy.deviation, np.zeros((steps * rows, self.task.sim.nu)), costates,
            np.zeros((rows, ndx)), policy.network.rows(rows), sums,
            np.zeros(len(sums), dtype=np.int64), np.zeros(len(sums)),
        )  # fmt: skip
        sweep_rows(self._packed, sweep, SweepLimits(float(limit), float(saturation), policy.linear))
        by_weights = sums.sum(axis=0)[policy.network.places]
        return PolicyGradient(by_weights, costates, int(sweep.clipped.sum()), float(sweep.largest.max(initial=0.0)))


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
    out = PolicyRollout(policy, steps, len(starts), slopes)
    lags = ActionDelay(model.delay, len(starts), task.sim.nu) if delays is None else delays
    lags.begin()
    out.x[0] = starts
    one_pass = slopes and kappa_grad is None
    impulses = model.sim.row_impulses(len(starts))
    for t in range(steps):
        out.act(t, noise)
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
            out.A[t], out.B[t], out.by_reward[t] = A, B, by_reward
        if noise is not None and noise.pushes is not None:
            out.x[t + 1, :, task.sim.nq : task.sim.nx] += noise.pushes[t]
        out.cut[t] = unsolved
        if restart is not None:
            out.cut[t] |= restart(t, out.terminated[t], unsolved, out.x[t + 1])
        if out.cut[t].any():
            lags.forget(out.cut[t])
            impulses.forget(out.cut[t])
    return out


def value_network(task: Task, hidden: tuple[int, ...], activation: str) -> Network:
    """The shape of a critic."""
    return Network((task.observations, *hidden, 1), activation)
