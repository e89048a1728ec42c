"""Motions of many rows under a policy, and the gradient of their rewards by its weights and the first states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dojo_opt.learn.action_delay import ActionDelay
from dojo_opt.learn.costate_sweep import CostateSweep, SweepLimits, sweep_rows
from dojo_opt.learn.network import Network
from dojo_opt.learn.network_rows import blocks, parts
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.randomization import Drawn, Randomization, draw_pushes
from dojo_opt.learn.rollout_rows import Acting, Judging, act_rows, judge_rows
from dojo_opt.learn.task import Task
from sim.mechanism.short_repr import short_repr
from solvers.status import Status
from solvers.types import Flags, Floats

__all__ = ["Noise", "PolicyGradient", "PolicyRollout", "roll_policy_batch"]

_SOLVED = int(Status.SOLVED)  # NumPy is slower with members of an enum


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
    survival     (T, n) probability that the episode goes on after the step
    cut          (T, n) the next step starts from another state: of both, and of episodes that were cut off

    Derivatives, without rows unless they are kept: A (T, n, ndx, ndx), B (T, n, ndx, nu), by_reward (T, n, 2 ndx + nu),
    by_survival (T, n, ndx), and those of the observations, rates (T, n, no, ndx).

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
        kept, no, ndx, nu = rows if slopes else 0, self.task.observations, sim.ndx, sim.nu
        self.survival, self.by_survival = np.zeros((steps, rows)), np.zeros((steps, kept, ndx))
        self.rates, self.by_reward = np.zeros((steps, kept, no, ndx)), np.zeros((steps, kept, 2 * ndx + nu))
        self.A, self.B = np.zeros((steps, kept, ndx, ndx)), np.zeros((steps, kept, ndx, nu))
        self._inside = np.zeros((steps, kept, no), dtype=np.bool_)
        self._layers = np.zeros((steps if slopes else 1, *policy.network.rows(rows).shape))
        count = blocks(rows)
        self._work, self._failed = self.task.room(count), np.zeros(count, dtype=np.int64)

    def acting(self, noise: Noise | None) -> Acting:
        """What `act` needs in every step.

        Args:
            noise: of the rollout, or None.

        Returns:
            Arrays of this rollout.
        """
        policy, (steps, _, no), nu = self.policy, self.observations.shape, self.actions.shape[2]
        without = np.zeros((steps, 0, no)), np.zeros((steps, 0, nu))
        seen, explored = without if noise is None else (noise.observations, noise.actions)
        return Acting(
            self.task.addresses[0], self.task.layout, self.x, seen, explored, policy.mean, policy.deviation,
            self.observations, self.rates, self._inside, self._layers, self.outputs, self.actions, self._work,
            self._failed,
        )  # fmt: skip

    @cached_property
    def _judging(self) -> Judging:
        """What `judge` needs in every step."""
        _, reward, end, survival = self.task.addresses
        return Judging(
            reward, end, survival, self.task.layout, self.x, self.applied, self.after, self.rewards, self.by_reward,
            self.terminated, self.survival, self.by_survival, self._work, self._failed,
        )  # fmt: skip

    def act(self, t: int, acting: Acting) -> None:
        """Choose the actions (n, nu) of step t.

        Args:
            t: number of the step.
            acting: of the rollout.
        """
        act_rows(self._packed, acting, self.policy.linear, t)
        if self._failed.any():
            self.task.observe(self.x[t], self.slopes)  # which raises the error

    def judge(self, t: int) -> None:
        """The rewards of step t, without those of survival, and where episodes end.

        Args:
            t: number of the step.
        """
        judge_rows(self._judging, t)
        if self._failed.any():  # one of these raises the error
            self.task.rewards(self.x[t], self.applied[t], self.after[t], self.slopes)
            self.task.survives(self.after[t], self.task.ends(self.after[t]), self.slopes)

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

        sweep = CostateSweep(
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
    restart: Callable[[PolicyRollout, int], Flags] | None = None,
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
        restart: function of the rollout and the number t of a step that replaces the states x[t + 1] of rows that start
            anew, and returns which these are (n,); by default rows go on, unsolved ones stand still.

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
    acting, motion = out.acting(noise), model.motion(model.sim.row_impulses(len(starts)))
    for t in range(steps):
        out.act(t, acting)
        out.applied[t], out.decided_in[t] = lags.apply(t, out.actions[t], model.delay)
        x, inputs, room = out.x[t], task.inputs(out.applied[t]), (out.A[t], out.B[t])
        out.after[t], status = motion.step(x, inputs, room if one_pass else None)
        unsolved = status != _SOLVED
        if slopes and not one_pass:
            smooth = model.step(x, inputs, True, kappa_grad)
            out.A[t], out.B[t], unsolved = smooth.A, smooth.B, unsolved | (smooth.status != Status.SOLVED)
        out.x[t + 1], out.unsolved[t], out.cut[t] = out.after[t], unsolved, unsolved
        out.judge(t)
        if task.survival != 0.0:
            out.rewards[t] += task.survival * ~out.terminated[t]
        if unsolved.any():
            out.rewards[t, unsolved] = 0.0
        if noise is not None and noise.pushes is not None:
            out.x[t + 1, :, task.sim.nq : task.sim.nx] += noise.pushes[t]
        if restart is not None:
            out.cut[t] |= restart(out, t)
        if out.cut[t].any():
            lags.forget(out.cut[t])
            motion.impulses.forget(out.cut[t])
    return out


def value_network(task: Task, hidden: tuple[int, ...], activation: str) -> Network:
    """The shape of a critic."""
    return Network((task.observations, *hidden, 1), activation)
