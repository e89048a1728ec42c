"""Tick: the record of one planning instant of MPC, an entry of the log of a closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim.brief import brief_repr
from solvers.status import Status

Vector = NDArray[np.float64]

__all__ = ["Tick", "milliseconds"]


@dataclass(frozen=True)
class Tick:
    """One planning instant. When `fallback` is true the plan before it stays in force, with its gains."""

    time: float  # of the measurement [s]
    milliseconds: float  # that the tick took, by the clock
    cpu_milliseconds: float  # processor time, which other programs on the machine hardly change
    iterations: int  # of the planner, rejected ones included
    cost: float  # of the plan that is in force, when it was made
    alpha: float  # last step size; 0 when it was rejected
    gap: float  # largest entry of x (-) the state that the plan before expected
    status: Status
    fallback: bool
    contacts: tuple[str, ...]  # that touch the ground
    error: Vector = field(repr=False)  # (nv,) coordinates of x (-) reference [m, rad]; empty without a reference
    x: Vector = field(repr=False)  # (nx,) start of the plan: measured, as the model means it, after the delay
    first: bool = False  # the plan from which the others are warm-started

    __repr__ = brief_repr


def milliseconds(log: Sequence[Tick], cpu: bool = False) -> Vector:
    """Times of the ticks of a log but the first [ms], by the clock or by the processor."""
    return np.array([tick.cpu_milliseconds if cpu else tick.milliseconds for tick in log if not tick.first])
