"""Monte Carlo: closed loops under disturbances drawn from a seed, and the share that the robot survives."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from dojo_opt.planning.executors import check_executor, results_in_order
from dojo_opt.plant.closed_loop import closed_loop, coordinate_numbers, steps_of
from dojo_opt.plant.perturbation import Perturbation
from dojo_opt.plant.plant import Plant
from dojo_opt.plant.tick import Tick, milliseconds
from sim.mechanism.checks import whole_number
from sim.mechanism.memory_limit import room_for
from sim.mechanism.short_repr import short_repr, short_table
from sim.simulator.results import Interrupted
from solvers.types import Vector

Sampler = Callable[[np.random.Generator], Perturbation]

_RUN = 2000.0  # bytes of the objects that keep a run

__all__ = ["MonteCarloRun", "MonteCarlo", "monte_carlo", "wilson_interval"]


@dataclass(frozen=True)
class MonteCarloRun:
    """One run.

    Attributes:
        survived: whether the run reached its end.
        message: the end of the run as a sentence.
        duration: length of the run [s].
        rms: `ClosedLoop.rms` of the components of the study [m, rad]; NaN without a reference.
        x: (nx,) last state.
        log: every tick of the controller.
        perturbation: perturbation of the plant.
        softened: number of steps of the plant that needed softer contact than its own, see `Plant`.
    """

    survived: bool
    message: str
    duration: float
    rms: float
    x: Vector
    log: Sequence[Tick]
    perturbation: Perturbation
    softened: int

    __repr__ = short_repr


@dataclass(frozen=True)
class MonteCarlo:
    """All runs, in the order of their numbers.

    Attributes:
        outcomes: one record per run.
        duration: intended length of each run [s].
        seed: seed of all random numbers.
    """

    outcomes: Sequence[MonteCarloRun]
    duration: float
    seed: int

    __repr__ = short_repr

    def _repr_html_(self) -> str:
        rows = [(i, o.survived, o.duration, o.rms, o.message) for i, o in enumerate(self.outcomes)]
        return short_table(self.summary(), ("run", "survived", "duration [s]", "rms [m, rad]", "message"), rows)

    @property
    def survived(self) -> int:
        """Number of runs that reached their end."""
        return sum(outcome.survived for outcome in self.outcomes)

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval (low, high) of the probability to survive."""
        return wilson_interval(self.survived, len(self.outcomes))

    @property
    def milliseconds(self) -> Vector:
        """(ticks,) times of all ticks but the first of every run [ms]."""
        return np.concatenate([milliseconds(outcome.log) for outcome in self.outcomes] or [np.zeros(0)])

    @property
    def rms(self) -> Vector:
        """(runs,) distances from the reference of the surviving runs [m, rad]; NaN for the others."""
        return np.array([o.rms if o.survived else np.nan for o in self.outcomes])

    def summary(self) -> str:
        """The study in one line.

        Returns:
            Survival with its interval, distances from the reference, and times of ticks.
        """
        lo, hi = self.interval
        text = f"{self.survived} of {len(self.outcomes)} survive {self.duration:g} s (95 %: {lo:.3f} to {hi:.3f})"
        ms, lasted = self.milliseconds, self.rms[np.isfinite(self.rms)]
        if lasted.size:
            text += f", rms median {np.median(lasted):.3f}, largest {lasted.max():.3f} (m, rad)"
        if ms.size:
            fallbacks = sum(tick.fallback for o in self.outcomes for tick in o.log)
            text += f"; tick median {np.median(ms):.2f} ms, 99 % {np.percentile(ms, 99):.2f} ms, {fallbacks} fallbacks"
        return text


def monte_carlo(
    controller: Any,
    plant: Plant,
    sampler: Sampler,
    duration: float,
    *,
    runs: int = 100,
    seed: int = 0,
    executor: Executor | None = None,
    control_step: float | None = None,
    components: Any = None,
) -> MonteCarlo:
    """Run a closed loop many times, each time under a perturbation that the sampler draws.

    Run i draws from the i-th child of the seed and starts from a fresh controller. States therefore depend neither on
    the executor nor on the number of its workers; the times of ticks do, and with a `time_limit` whatever depends on
    them.

    Args:
        controller: an `MPC`, or a function of (time, x) without memory.
        plant: the plant; each run perturbs a copy of it, see `Perturbation.over` for one that is perturbed already.
        sampler: generator -> Perturbation, such as `Disturbances`; with an executor that uses processes, a function or
            object that they can import.
        duration: length of each run [s].
        runs: number of runs (default 100).
        seed: seed of all random numbers (default 0).
        executor: anything with the interface of `concurrent.futures.Executor`: a ProcessPoolExecutor (use the "spawn"
            context: forked processes inherit no threads), Dask's `client.get_executor()`, Ray's or MPI's pools
            (default None: one run after the other).
        control_step: time between calls of the controller [s] (default None: as of `closed_loop`).
        components: coordinates of the `rms` of each run, as in `ClosedLoop.rms` (default None: all tracked ones).

    Returns:
        All runs, in the order of their numbers.

    Raises:
        TypeError: for an argument of the wrong kind, or a sampler that returns no Perturbation.
        ValueError: for a number out of range.
        Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the MonteCarlo of the finished runs.
    """
    if not isinstance(plant, Plant):
        raise TypeError(f"monte_carlo(plant): expected a Plant, such as Plant(simulator), got {plant!r}")
    for name, function in (("controller", controller), ("sampler", sampler)):
        if not callable(function):
            raise TypeError(f"monte_carlo({name}): expected a function, got {function!r}")
    check_executor("monte_carlo", executor)
    whole_number("monte_carlo(seed=...)", seed, 0)
    steps_of("monte_carlo(duration)", plant, duration)
    if components is not None:
        coordinate_numbers("monte_carlo(components=...)", components, plant.nominal)
    count = room_for("monte_carlo(runs=...)", runs, _RUN + 8.0 * plant.nominal.nx)
    children = np.random.SeedSequence(seed).spawn(count)
    tasks = [(controller, plant, sampler, float(duration), (control_step, components), child) for child in children]
    outcomes: list[MonteCarloRun] = []
    try:
        outcomes.extend(results_in_order(_run, tasks, executor))  # those before Ctrl-C stay
    except KeyboardInterrupt:
        raise Interrupted(MonteCarlo(outcomes, float(duration), seed) if outcomes else None) from None
    return MonteCarlo(outcomes, float(duration), seed)


def _run(
    controller: Any,
    plant: Plant,
    sampler: Sampler,
    duration: float,
    settings: tuple[float | None, Any],
    seed: np.random.SeedSequence,
) -> MonteCarloRun:
    """One run; at module level, so that other processes can import it."""
    perturbation = sampler(np.random.default_rng(seed))
    if not isinstance(perturbation, Perturbation):
        raise TypeError(f"monte_carlo(sampler): expected it to return a Perturbation, got {perturbation!r}")
    control_step, components = settings
    own = controller.fresh() if hasattr(controller, "fresh") else copy.copy(controller)
    perturbation = perturbation.over(plant.perturbation)
    loop = closed_loop(own, plant.perturbed(perturbation), duration, control_step=control_step)
    return MonteCarloRun(
        survived=loop.survived,
        message=loop.message,
        duration=loop.duration,
        rms=float("nan") if loop.reference is None else loop.rms(components),
        x=loop.x[-1],
        log=loop.log,
        perturbation=perturbation,
        softened=loop.softened,
    )


def wilson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of a probability after `successes` in `runs` trials.   Wilson 1927.

    (p + z^2/2n +- z sqrt(p (1 - p)/n + z^2/4n^2)) / (1 + z^2/n),   p = successes/n
    """
    if not 0 <= successes <= runs or runs < 1:
        raise ValueError(f"wilson_interval: expected 0 <= successes <= runs and runs >= 1, got {successes} of {runs}")
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    p, n = successes / runs, float(runs)
    center = p + z * z / (2.0 * n)
    spread = z * np.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
    scale = 1.0 + z * z / n
    lo, hi = float((center - spread) / scale), float((center + spread) / scale)
    return (lo if successes else 0.0), (hi if successes < runs else 1.0)  # exactly, whatever the rounding
