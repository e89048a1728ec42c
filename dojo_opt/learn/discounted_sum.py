"""DiscountedSum: discounted returns of the rows of a rollout with bootstrapped values, and their gradient.

    J_t = r_t + gamma s(x_t+1) J_t+1,      J = V of the state where a row is cut off, or the rollout ends,
    dJ_t/dx_t+1 = dr_t/dx_t+1 + gamma s dJ_t+1/dx_t+1 + gamma ds/dx_t+1 J_t+1

s is the probability that an episode continues: 1 or 0, or smooth, if the task defines it.
"""

from __future__ import annotations

import numpy as np

from dojo_opt.learn.policy_rollout import PolicyRollout
from solvers.types import Floats

__all__ = ["DiscountedSum"]


class DiscountedSum:
    """Sums over the T steps and n rows of a rollout.

    Args:
        roll: the rollout.
        after: (T, n) values V of the states after the steps.
        gamma: discount of a step.
    """

    def __init__(self, roll: PolicyRollout, after: Floats, gamma: float) -> None:
        self.roll, self.after, self.gamma = roll, after, gamma
        self.last = roll.cut.copy()
        self.last[-1] = True
        self.follows = self._follows()

    def _follows(self) -> Floats:
        """(T, n) J_t+1, and 0 where it is less: an episode's end is not worth seeking, however bad it goes."""
        out = np.maximum(self.after, 0.0)
        for t in range(len(out) - 2, -1, -1):
            going = ~self.last[t]
            out[t, going] = np.maximum(self._sums(t + 1, out[t + 1])[going], 0.0)
        return out

    def _sums(self, t: int, follows: Floats) -> Floats:
        """(n,) J_t."""
        out: Floats = self.roll.rewards[t] + self.gamma * self.roll.survival[t] * follows
        return out

    def first(self) -> Floats:
        """(n,) the sums from the first step on."""
        return self._sums(0, self.follows[0])

    def weights(self, by_value: Floats) -> tuple[Floats, Floats]:
        """Factors for `PolicyRollout.gradient` of the sum of J over the first states, and those of new starts.

        Args:
            by_value: (T, n, ndx) derivatives of V by the states after the steps.

        Returns:
            (T, n) weights of the rewards, and (T, n, ndx) further derivatives by the states after the steps.
        """
        roll, last, weights = self.roll, self.last, np.zeros_like(self.after)
        discount = np.ones(self.after.shape[1])
        for t, survival in enumerate(roll.survival):
            weights[t] = discount
            discount = np.where(roll.cut[t], 1.0, self.gamma * discount * survival)
        ahead = self.gamma * weights
        ends = (ahead * self.follows)[:, :, None] * roll.by_survival
        ends[last] += (ahead * roll.survival)[last][:, None] * by_value[last]
        ends[roll.unsolved] = 0.0
        return weights, ends

    def traced(self, trace: float) -> Floats:
        """TD(lambda) returns, which critics learn.

        Args:
            trace: lambda.

        Returns:
            (T, n) returns.
        """
        out, later = np.zeros_like(self.after), self.after[-1]
        for t in range(len(out) - 1, -1, -1):
            later = np.where(self.roll.cut[t], self.after[t], (1.0 - trace) * self.after[t] + trace * later)
            out[t] = later = self._sums(t, later)
        return out
