"""The stability study: every trial by ours and by the engines that are installed."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.engines import PhysicsEngine, installed
from benchmarks.studies.stability import body_trials, chain_trials, ground_trials, joint_trials, stack_trials
from dojo_opt.report.result import Report
from dojo_opt.report.stability import RobotStability
from dojo_opt.report.stability.judging import KAPPA, judge
from dojo_opt.report.stability.trial import StabilityTrial
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism

SUMMARY = (
    "Extreme scenes, each with its rule for passing, stated before it runs. Rules ask for correct physics and not only "
    "for survival: a stiff spring keeps its amplitude, a spinning body its angular momentum, a chain its energy; "
    "nothing sinks in at any speed. Motions that a step cannot represent have to be refused with a reason. Every "
    "engine gets the same scene, time step and start."
)
NOTES = [
    f"dojo-opt runs with kappa {KAPPA:g} N s m and its default tolerance of 1e-8; free bodies have a tolerance of "
    "1e-13, and bodies of a few grams or motions of microseconds a smaller kappa, as the trial says.",
    "x: measured, and above the bar. 'failed': not finite, lost, or a step that was not solved, with the time of the "
    "last good sample. (s): other engines ran only for these seconds.",
    "Chains: forces of hinges act along the links at the start of a step, as in SHAKE and RATTLE. That limits the time "
    "step to 2/omega, omega = 2 sqrt(tension / (m l)) for links of mass m and length l; above it a step has no "
    "solution, and says so.",
    "Rules about penetration and rest ask for hard contact; engines with soft contacts miss them by design, and the "
    "table says by how much.",
    "A start in overlap is thrown out of the ground with depth / time step; avoid it.",
]
_LEFT_OUT = ("MuJoCo implicit",)  # as implicitfast in all of these


@dataclass(frozen=True)
class StabilityStudy:
    """All trials, or the trials of a mechanism; quick omits the long ones and all peers but one."""

    quick: bool = False
    mechanism: Mechanism | None = None

    def run(self, progress: Progress) -> Report:
        """Judge every trial."""
        if self.mechanism is not None:
            return RobotStability(self.mechanism, self.quick, self._peers()).run(progress)
        report = Report("Stability: stiff and extreme scenes", summary=SUMMARY, notes=list(NOTES))
        judge(report, [trial for trial in self.trials() if not (self.quick and trial.slow)], self._peers(), progress)
        return report

    def trials(self) -> list[StabilityTrial]:
        """Every trial of the study."""
        rooms = (ground_trials, stack_trials, joint_trials, body_trials, chain_trials)
        return [trial for room in rooms for trial in room.trials()]

    def _peers(self) -> list[PhysicsEngine]:
        peers = [engine for engine in installed() if engine.name not in _LEFT_OUT]
        return peers[1:2] if self.quick else peers
