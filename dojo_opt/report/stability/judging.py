"""Trials by ours and by other engines: their verdicts as the rows, tables and figure of a report."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress
from math import isnan
from typing import Any

from dojo_opt.report.dojo_engine import Ours
from dojo_opt.report.engine import PhysicsEngine
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.stability.trial import NOT_GIVEN, StabilityTrial, TrialVerdict
from dojo_opt.report.stability.verdict_figure import picture
from dojo_opt.report.study import Progress

KAPPA = 1e-10  # [N s m] the default of 1 kg at 10 ms: hard, and solved as reliably as larger ones


def judge(
    report: Report, trials: Sequence[StabilityTrial], peers: Sequence[PhysicsEngine], progress: Progress
) -> list[TrialVerdict]:
    """Run every trial by every engine, and add the verdicts to the report.

    Args:
        report: Gets a row per trial, a table per group, the count of those that passed, and the figure.
        trials: Trials to run.
        peers: Engines beside ours.
        progress: Shows the trial that runs.

    Returns:
        The verdict on ours for each trial.
    """
    verdicts: dict[str, list[TrialVerdict]] = {name: [] for name in ("dojo-opt", *(peer.name for peer in peers))}
    report.details["trials"] = []
    for trial in progress([(trial.name, trial) for trial in trials], "stability"):
        numbers = _measure(trial, peers, verdicts)
        report.details["trials"].append(numbers)
        ours = verdicts["dojo-opt"][-1]
        note = trial.rule + (f"; {trial.why}" if trial.why else "")
        name = f"{trial.group}: {trial.name}"
        report.rows.append(Row(name, ours.value, "", 0.0 if trial.refusal else trial.bar, note=note))
    report.tables += _tables(trials, verdicts, report.details["trials"])
    report.rows.append(_passed(verdicts["dojo-opt"]))
    report.figure = picture(trials, verdicts)
    return verdicts["dojo-opt"]


def _measure(
    trial: StabilityTrial, peers: Sequence[PhysicsEngine], verdicts: dict[str, list[TrialVerdict]]
) -> dict[str, Any]:
    """One trial by every engine; verdicts are appended, numbers returned."""
    ours = Ours(kappa=trial.kappa or KAPPA, tolerance=trial.tolerance, divide=not trial.refusal, rounds=1)
    numbers: dict[str, Any] = {"group": trial.group, "name": trial.name, "rule": trial.rule, "bar": trial.bar}
    for engine in [ours, *peers]:
        own = engine is ours
        try:
            run = trial.run(engine, 0.0 if own else trial.peer_duration)
        except ValueError as error:
            verdict = TrialVerdict(float("nan"), False, NOT_GIVEN)
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
    trials: Sequence[StabilityTrial], verdicts: dict[str, list[TrialVerdict]], numbers: Sequence[dict[str, Any]]
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


def _share(verdicts: Sequence[TrialVerdict]) -> str:
    """How many passed, of those that were given."""
    given = [verdict.passed for verdict in verdicts if verdict.text != NOT_GIVEN]
    return f"{sum(given)} of {len(given)}" if given else ""


def _passed(verdicts: Sequence[TrialVerdict]) -> Row:
    """How many trials of ours passed; all have to."""
    count, refused = sum(verdict.passed for verdict in verdicts), sum(v.text == "refused" for v in verdicts)
    note = f"{refused} of them by a refusal, as their rules ask" if refused else ""
    return Row("trials passed", float(count), f"of {len(verdicts)}", float(len(verdicts)), at_least=True, note=note)
