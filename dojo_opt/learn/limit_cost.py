"""The cost of joints near their limits: policies learn to lean on limits, which give way in other simulators."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dojo_opt.planning.residual import jit
from sim.mechanism import checks
from solvers.types import Floats

__all__ = ["with_limit_cost"]

_NEAR = 0.1  # [rad] from a limit


def with_limit_cost(
    call: str, reward: Callable[..., Any], limits: tuple[Floats, Floats], weight: float
) -> Callable[..., Any]:
    """A reward, minus the weight times how far the coordinates of x' are within .1 rad of their limits or beyond them;
    the reward itself without a weight.

    call: for messages;  limits: lower and upper ones, (nq,) each, infinite where there are none
    """
    if checks.number(f"{call}(limit_cost=...)", weight, at_least=0.0) == 0.0:
        return reward
    plain, count = jit(reward), len(limits[0])
    low, high = (tuple(float(bound) for bound in bounds) for bounds in limits)

    def shaped(x, a, after):  # type: ignore[no-untyped-def]
        total = 0.0
        for i in range(count):
            total += max(0.0, after[i] - high[i] + _NEAR) + max(0.0, low[i] + _NEAR - after[i])
        return plain(x, a, after) - weight * total

    return shaped
