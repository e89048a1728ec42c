"""The stability study: every trial by ours and by the engines that are installed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from math import isnan
from typing import Any

from dojo_opt.report.contact.study import KAPPA
from dojo_opt.report.engines import Engine, Ours, installed
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.stability import bodies, chains, ground, joints, stacks
from dojo_opt.report.stability.picture import picture
from dojo_opt.report.stability.robot import robot_trials
from dojo_opt.report.stability.trial import NOT_GIVEN, Trial, Verdict
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism

SUMMARY = (
    "Scenes at the edge of what a simulator can do, each with the rule by which it passes, stated before it runs. "
    "Rules ask for the physics and not only for survival: a stiff spring keeps its amplitude, a spinning body its "
    "angular momentum, a chain its energy; nothing sinks in at any speed. What a step cannot represent has to be "
    "refused with a reason. The same scene, time step and start for every engine."
)
NOTES = [
    f"dojo-opt runs with kappa {KAPPA:g} N s m and its default tolerance of 1e-8; free bodies with one of 1e-13, and "
    "what weighs grams or moves in microseconds with a smaller kappa, as the trial says.",
    "x: measured, and above the bar. 'failed': not finite, lost, or a step that was not solved; the time is that of "
    "the last good sample. (s): other engines ran only so many seconds of it.",
    "Chains: forces of hinges act along the links at the start of a step, as in SHAKE and RATTLE. That limits the time "
    "step to 2/omega, omega = 2 sqrt(tension / (m l)) for links of mass m and length l; above it a step has no "
    "solution, and says so.",
    "Rules about penetration and rest ask for hard contact; engines with soft contacts miss them by design, and the "
    "table says by how much.",
    "A start in overlap is thrown out of the ground with depth / time step; avoid it.",
]
_LEFT_OUT = ("MuJoCo implicit",)  # as implicitfast in all of these


@dataclass(frozen=True)
class Stability:
    """All trials, or those of a mechanism; quick leaves out the long ones and all peers but one."""

    quick: bool = False
    mechanism: Mechanism | None = None

    def run(self, progress: Progress) -> Report:
        """Judge every trial."""
        command = "dojo-opt report stability" + (" --quick" if self.quick else "")
        report = Report("Stability: stiff and extreme scenes", command, summary=SUMMARY, notes=list(NOTES))
        trials = [trial for trial in self.trials() if not (self.quick and trial.slow)]
        peers = [engine for engine in installed() if engine.name not in _LEFT_OUT]
        peers = peers[1:2] if self.quick else peers
        verdicts: dict[str, list[Verdict]] = {name: [] for name in ("dojo-opt", *(peer.name for peer in peers))}
        report.details["trials"] = []
        for trial in progress([(trial.name, trial) for trial in trials], "stability"):
            numbers = self._measure(trial, peers, verdicts)
            report.details["trials"].append(numbers)
            ours = verdicts["dojo-opt"][-1]
            note = trial.rule + (f"; {trial.why}" if trial.why else "")
            name = f"{trial.group}: {trial.name}"
            report.rows.append(Row(name, ours.value, "", 0.0 if trial.refusal else trial.bar, note=note))
        report.tables += _tables(trials, verdicts, report.details["trials"])
        report.rows.append(_passed(verdicts["dojo-opt"]))
        if self.mechanism is not None:
            report.notes.insert(0, _advice(trials, verdicts["dojo-opt"]))
        report.figure = picture(trials, verdicts)
        return report

    def trials(self) -> list[Trial]:
        """What is run."""
        if self.mechanism is not None:
            return robot_trials(self.mechanism)
        return [*ground.trials(), *stacks.trials(), *joints.trials(), *bodies.trials(), *chains.trials()]

    def _measure(self, trial: Trial, peers: Sequence[Engine], verdicts: dict[str, list[Verdict]]) -> dict[str, Any]:
        """One trial by every engine; verdicts are appended, numbers returned."""
        ours = Ours(kappa=trial.kappa or KAPPA, tolerance=trial.tolerance, rounds=1)
        numbers: dict[str, Any] = {"group": trial.group, "name": trial.name, "rule": trial.rule, "bar": trial.bar}
        for engine in [ours, *peers]:
            own = engine is ours
            try:
                run = trial.run(engine, 0.0 if own else trial.peer_duration)
            except ValueError as error:
                verdict = Verdict(float("nan"), False, NOT_GIVEN)
                found: dict[str, Any] = {"message": str(error)}
            else:
                verdict = trial.judge(run, ours=own)
                found = {"message": run.message, "us_per_step": 1e6 * run.seconds / max(1, run.steps)}
            if not own and trial.peer_duration and trial.peer_duration < trial.duration and not isnan(verdict.value):
                verdict = verdict._replace(text=f"{verdict.text} ({trial.peer_duration:g} s)")
            verdicts["dojo-opt" if own else engine.name].append(verdict)
            numbers["dojo-opt" if own else engine.name] = {"value": verdict.value, "passed": verdict.passed, **found}
        return numbers


def _tables(
    trials: Sequence[Trial], verdicts: dict[str, list[Verdict]], numbers: Sequence[dict[str, Any]]
) -> list[Table]:
    """One table per group, the engines side by side."""
    tables = []
    for group in dict.fromkeys(trial.group for trial in trials):
        rows: list[list[Cell]] = []
        for k, trial in enumerate(trials):
            if trial.group == group:
                cost = float(numbers[k]["dojo-opt"].get("us_per_step", 0.0))
                rows.append([trial.name, trial.rule, *(found[k].text for found in verdicts.values()), cost])
        tables.append(Table(group, ("", "passes when", *verdicts, "dojo-opt [us per step]"), rows))
    groups = [*(table.title for table in tables), "all"]
    passed: list[list[Cell]] = []
    for group in groups:
        rows_of = [group in (trial.group, "all") for trial in trials]
        passed.append([group, *(_share(list(compress(found, rows_of))) for found in verdicts.values())])
    return [*tables, Table("passed", ("", *verdicts), passed)]


def _share(verdicts: Sequence[Verdict]) -> str:
    """How many passed, of those that were given."""
    given = [verdict.passed for verdict in verdicts if verdict.text != NOT_GIVEN]
    return f"{sum(given)} of {len(given)}" if given else ""


def _passed(verdicts: Sequence[Verdict]) -> Row:
    """How many trials of ours passed; all have to."""
    count, refused = sum(verdict.passed for verdict in verdicts), sum(v.text == "refused" for v in verdicts)
    note = f"{refused} of them by a refusal, as their rules ask" if refused else ""
    return Row("trials passed", float(count), f"of {len(verdicts)}", float(len(verdicts)), at_least=True, note=note)


def _advice(trials: Sequence[Trial], verdicts: Sequence[Verdict]) -> str:
    """The largest time step up to which everything passes."""
    good = 0.0
    for trial, verdict in zip(trials, verdicts, strict=True):
        if not verdict.passed:
            break
        good = trial.time_step
    name = trials[0].mechanism.name
    return f"{name}: stable up to a time step of {1e3 * good:g} ms." if good else f"{name}: no time step passed."
