"""The time steps at which a robot is stable: dropped and pushed, with a rule that is stated before it runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dojo_opt.report.engine import PhysicsEngine
from dojo_opt.report.result import Report
from dojo_opt.report.stability.judging import KAPPA, judge
from dojo_opt.report.stability.robot_trials import robot_trials
from dojo_opt.report.stability.trial import StabilityTrial, TrialVerdict
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism

SUMMARY = (
    "One second from the neutral pose, a floating base raised by 0.1 m, with random velocities and without inputs, at "
    "time steps of 1 to 50 ms. Every trial has the rule by which it passes, stated before it runs."
)
NOTES = [
    f"dojo-opt runs with kappa {KAPPA:g} N s m and its default tolerance of 1e-8.",
    "x: measured, and above the bar. 'failed': not finite, lost, or a step that was not solved; the time is that of "
    "the last good sample.",
]


@dataclass(frozen=True)
class RobotStability:
    """The trials of a robot; peers: engines beside ours."""

    mechanism: Mechanism
    quick: bool = False
    peers: Sequence[PhysicsEngine] = ()

    def run(self, progress: Progress) -> Report:
        """Judge every trial."""
        trials = robot_trials(self.mechanism)
        report = Report(f"Stability of {self.mechanism.name}", summary=SUMMARY, notes=list(NOTES))
        report.notes.insert(0, _advice(trials, judge(report, trials, self.peers, progress)))
        return report


def _advice(trials: Sequence[StabilityTrial], verdicts: Sequence[TrialVerdict]) -> str:
    """The largest time step up to which everything passes."""
    good = 0.0
    for trial, verdict in zip(trials, verdicts, strict=True):
        if not verdict.passed:
            break
        good = trial.time_step
    name = trials[0].mechanism.name
    return f"{name}: stable up to a time step of {1e3 * good:g} ms." if good else f"{name}: no time step passed."
