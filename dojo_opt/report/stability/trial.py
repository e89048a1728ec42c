"""A trial: one extreme scene with the rule by which it passes, stated before it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from typing import NamedTuple

from numpy.typing import ArrayLike

from dojo_opt.report.engine import PhysicsEngine, Run
from dojo_opt.report.run_measures import complete
from sim.mechanism.mechanism import Mechanism

Measure = Callable[[Mechanism, Run], float]


class TrialVerdict(NamedTuple):
    """The result of an engine in a trial."""

    value: float  # not-a-number where it did not get through
    passed: bool
    text: str  # as it stands in a table


NOT_GIVEN = "not given"  # a scene that this study does not translate for an engine: no verdict on it


@dataclass(frozen=True)
class StabilityTrial:
    """A motion, its measure, and the largest value that passes.

    rule      in words, with unit and bar
    refusal   words in the reason with which the engine has to refuse the scene, where it cannot be represented
    why       it cannot be, or why the time step is the one that it is
    """

    group: str
    name: str
    rule: str
    mechanism: Mechanism
    q: ArrayLike
    v: ArrayLike
    time_step: float  # [s]
    duration: float  # [s]
    measure: Measure
    bar: float
    samples: int = 0  # 0: every step
    inputs: ArrayLike | None = None
    kappa: float = 0.0  # of ours [N s m]; 0: the one that the study recommends
    tolerance: float = 1e-8  # of ours
    refusal: str = ""
    why: str = ""
    peer_duration: float = 0.0  # [s] of other engines, where the whole would take minutes; 0: the whole
    slow: bool = False  # omitted from quick runs

    def run(self, engine: PhysicsEngine, duration: float = 0.0) -> Run:
        """The motion by one engine, the whole or part of it."""
        seconds = duration or self.duration
        steps = round(seconds / self.time_step)
        return engine.simulate(
            self.mechanism,
            time_step=self.time_step,
            q=self.q,
            v=self.v,
            duration=seconds,
            samples=min(self.samples or steps, steps),
            inputs=self.inputs,
        )

    def judge(self, run: Run, *, ours: bool) -> TrialVerdict:
        """The rule applied.

        Only dojo-opt must refuse states that cannot be represented; an engine that continues is measured.
        """
        if self.refusal and ours:
            refused = self.refusal in run.message
            return TrialVerdict(0.0 if refused else nan, refused, "refused" if refused else "not refused")
        if not complete(run):
            ended = run.message.startswith("ended ")  # the process of the engine
            return TrialVerdict(nan, False, run.message if ended else f"failed at {run.time[-1]:.2g} s")
        value = self.measure(self.mechanism, run)
        passed = bool(value <= self.bar)
        return TrialVerdict(value, passed, f"{value:.2g}" + ("" if passed else " x"))
