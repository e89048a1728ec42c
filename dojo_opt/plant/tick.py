"""Tick: the record of one planning instant of MPC, an entry of the log of a closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sim.mechanism.short_repr import short_repr
from solvers.status import Status
from solvers.types import Vector

__all__ = ["Tick", "milliseconds"]


@dataclass(frozen=True)
class Tick:
    """One planning instant. If `fallback` is true, the previous plan stays in force, with its gains.

    Attributes:
        time: time of the measurement [s].
        milliseconds: duration of the tick by the clock [ms].
        cpu_milliseconds: processor time of the tick [ms], which other programs on the machine hardly change.
        iterations: iterations of the planner, rejected ones included.
        cost: cost of the plan that is in force, at the time when it was made.
        alpha: last step size; 0 after a rejected step.
        gap: largest entry of x (-) the state that the previous plan predicted [m, rad, m/s, rad/s].
        status: status of the planner.
        fallback: whether the previous plan stays in force.
        contacts: names of the contacts that touch the ground.
        error: (nv,) coordinates of x (-) reference [m, rad]; empty without a reference.
        x: (nx,) start of the plan: the measured state, as a state of the model, after the delay.
        first: whether the others are warm-started from this plan.
    """

    time: float
    milliseconds: float
    cpu_milliseconds: float
    iterations: int
    cost: float
    alpha: float
    gap: float
    status: Status
    fallback: bool
    contacts: tuple[str, ...]
    error: Vector = field(repr=False)
    x: Vector = field(repr=False)
    first: bool = False

    __repr__ = short_repr


def milliseconds(log: Sequence[Tick], cpu: bool = False) -> Vector:
    """Times of the ticks of a log but the first [ms], by the clock or by the processor."""
    return np.array([tick.cpu_milliseconds if cpu else tick.milliseconds for tick in log if not tick.first])
