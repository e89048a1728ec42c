"""Tick: what MPC did at one planning instant, and the settings of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dojo_opt.options import Options, Stage
from sim.mechanism import checks
from sim.mechanism.brief import brief_repr
from sim.mechanism.checks import whole_number
from solvers.status import Status

Vector = NDArray[np.float64]

# penalties that grew with every tick would never stop; a second line search would take its time
OPTIONS = Options(halvings=4, penalty_growth=1.0, tolerance=1e-6, shooting=0.0)
GUESSES = ("states", "feedback", "open loop")

__all__ = ["GUESSES", "OPTIONS", "Settings", "Tick", "milliseconds"]


@dataclass(frozen=True)
class Settings:
    """Settings of `MPC`."""

    period: float | None = None  # between plans [s]; a knot by default
    kappa: float = 1e-4  # smoothing of the rollouts [N s m]
    kappa_grad: float | None = None  # of the derivatives; the same by default, which saves a linearisation per tick
    guess: str = "states"  # "states" keeps the shifted states; "feedback", "open loop" roll out from the measured one
    gain_scale: float = 1.0  # of the feedback between plans; 0 applies the planned inputs as they are
    delay: float = 0.0  # from a measurement to the input it causes [s]; plans start that much later
    time_limit: float = float("inf")  # of a tick [s]; looked at before each iteration
    mean_velocity: bool = True  # see `dojo_opt.mpc.measurement`
    friction: float | None = None  # that plans count on, instead of the model's; less than the ground has is safer
    learn_ground: bool = False  # take the height of the ground from the contacts that stand
    options: Options | None = None  # of the planner in a tick; its stages are made from kappa and kappa_grad
    log: int | None = 10_000  # the last ticks that `MPC.log` keeps, about 1 kB each; None keeps all

    def __post_init__(self) -> None:
        if self.guess not in GUESSES:
            raise ValueError(f"MPC(guess=...): expected one of {GUESSES}, got {self.guess!r}")
        if self.options is not None and not isinstance(self.options, Options):
            raise TypeError(f"MPC(options=...): expected Options, got {self.options!r}")
        for name, above in (("kappa", 0.0), ("time_limit", 0.0), ("period", 0.0), ("kappa_grad", 0.0)):
            value = getattr(self, name)
            if value is not None and not value > above:
                raise ValueError(f"MPC({name}=...): expected a number > 0, got {value}")
        for name in ("gain_scale", "delay"):
            checks.number(f"MPC({name}=...)", getattr(self, name), at_least=0.0)
        if self.log is not None:
            whole_number("MPC(log=...)", self.log)
        if self.friction is not None:
            checks.number("MPC(friction=...)", self.friction, at_least=0.0)

    def planner(self, iterations: int) -> Options:
        """Options of the planner for the iterations of one tick."""
        base = self.options or OPTIONS
        stage = Stage(self.kappa, self.kappa_grad or self.kappa, base.tolerance, iterations)
        settings = {name: getattr(base, name) for name in base.__dataclass_fields__}
        return Options(**(settings | {"stages": (stage,), "time_limit": self.time_limit}))


@dataclass(frozen=True)
class Tick:
    """One planning instant. When `fallback` is true the plan before it stays in force, with its gains."""

    time: float  # of the measurement [s]
    milliseconds: float  # that the tick took, by the clock
    cpu_milliseconds: float  # by the processor: what is left when others use the machine, too
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
