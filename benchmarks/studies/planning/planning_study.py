"""Planning: cost and violation of plans against processor time, ours over settings, and MuJoCo's."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from benchmarks.engines.mujoco_ilqr import MujocoSettings
from benchmarks.studies.planning import planning_cases as cases
from benchmarks.studies.planning import setting_families
from benchmarks.studies.planning.planners import HARD, REFINE, PlanOutcome, ours, peer
from benchmarks.studies.planning.planning_figure import draw
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.study import Progress
from solvers.compiler import threads

# largest iterations and cost of the reference problems, and time of an iteration [ms]
BARS: dict[str, tuple[int, float | None, float | None]] = {
    "hop, 1 x 50 ms": (35, 5.6, None),
    "hop, 5 x 10 ms": (50, 5.9, None),
    "block right, 1 x 100 ms": (30, 9.1, None),
    "block up, 1 x 100 ms": (20, 14.0, None),
    "trot, 1 x 50 ms": (30, None, 5.0),
    "trot, damping 5, 1 x 50 ms": (8, None, None),
}
VIOLATION, UPRIGHT, TARGETS = 1e-3, 0.99, 26
PEERS = (MujocoSettings(), MujocoSettings(step=5e-3), MujocoSettings(centered=True), MujocoSettings(smooth=True))
_ROUNDS = 3


@dataclass(frozen=True)
class PlanningStudy:
    """The reference problems over time steps and settings.

    quick: default and two other settings on two variants of each problem, one way to use MuJoCo.
    """

    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report("Plans: cost against run time")
        report.summary = (
            "Plans of a hop, of a block that is pushed or lifted, and of a trot, against the processor time of one "
            f"core. Every plan is replayed under its own gains on contact at kappa {HARD:g}, at its time step and at "
            f"1/{REFINE} of it: plans that exploit soft contact or long steps fail there. For comparison, the same "
            "problems are solved by MuJoCo's finite differences and iLQR in NumPy; MuJoCo replays those plans."
        )
        with threads(1):
            plans = self._references(report, progress)
            peers = self._peers(report, progress)
            _compare(report, plans, peers)
            alone = {
                name: ours(cases.reference(name), f"one stage, kappa_grad {k:g}", **_one_stage(k))
                for name, k in (("hop", 1e-4), ("block right", 1e-4), ("block up", 1e-2), ("trot", 1e-4))
            }
            scores = self._settings(report, progress)
        report.figure = draw(plans, alone, peers, scores)
        return report

    def _references(self, report: Report, progress: Progress) -> dict[str, PlanOutcome]:
        """Our plans with default settings, over time steps."""
        plans: dict[str, PlanOutcome] = {}
        problems = [(name, (name, problem)) for name, problem in cases.time_steps(quick=self.quick).items()]
        for name, problem in progress(problems, "planning, time steps"):
            plans[name] = plan = ours(problem, rounds=_ROUNDS)
            iterations, cost, each = BARS.get(name, (None, None, None))
            milliseconds = 1e3 * plan.seconds
            note = plan.message or f"{milliseconds:.3g} ms"
            report.rows.append(Row(f"{name}: iterations", plan.iterations, "", iterations, note=note))
            report.rows.append(Row(f"{name}: cost", plan.cost, "", cost))
            report.rows.append(Row(f"{name}: violation", plan.violation, "", VIOLATION))
            if each is not None:
                report.rows.append(Row(f"{name}: iteration", milliseconds / plan.iterations, "ms", each))
            if name.startswith("trot"):
                report.rows.append(Row(f"{name}: upright", plan.upright, "", UPRIGHT, at_least=True))
        report.tables.append(_plans_table("Time steps, default settings", plans))
        report.details["plans"] = {name: _numbers(plan) for name, plan in plans.items()}
        return plans

    def _peers(self, report: Report, progress: Progress) -> dict[str, list[PlanOutcome]]:
        """MuJoCo's plans of the reference problems."""
        if find_spec("mujoco") is None:
            report.notes.append('without MuJoCo; pip install "dojo-opt[bench]" for its plans')
            return {}
        found = {
            name: [peer(cases.reference(name), settings) for settings in (PEERS[:1] if self.quick else PEERS)]
            for name in progress([(name, name) for name in cases.NAMES], "planning, MuJoCo")
        }
        rows = {f"{name}, {plan.setting}": plan for name, plans in found.items() for plan in plans}
        report.tables.append(_plans_table("MuJoCo's mjd_transitionFD and iLQR in NumPy", rows))
        report.details["peers"] = {name: _numbers(plan) for name, plan in rows.items()}
        return found

    def _settings(self, report: Report, progress: Progress) -> dict[str, list[setting_families.Score]]:
        """Every setting on variants of every problem."""
        scores: dict[str, list[setting_families.Score]] = {}
        report.details["settings"] = {}
        for name in cases.NAMES if self.quick else cases.FAMILIES:
            problems = cases.family(name, quick=self.quick)
            outcomes = [
                (setting, setting_families.run(problems, setting))
                for setting in progress(
                    [(s.name, s) for s in cases.settings(quick=self.quick)], f"planning, settings on {name}"
                )
            ]
            scores[name] = setting_families.score(name, problems, outcomes)
            report.tables.append(_scores_table(name, scores[name]))
            report.details["settings"][name] = {
                f"{s.group}: {s.name}": [_numbers(o, history=False) for o in found] for s, found in outcomes
            }
        default = scores["hop"][0]
        if not self.quick:
            report.rows.append(Row("hop, 10 random targets: reached", default.solved, "", 10, at_least=True))
            report.rows.append(Row("hop, 10 random targets: iterations, median", default.iterations, "", TARGETS))
        for name, found in scores.items():
            rows = found[0]
            report.rows.append(Row(f"{name}: variants planned by default", rows.true, f"of {rows.variants}"))
        return scores


def _compare(report: Report, plans: dict[str, PlanOutcome], peers: dict[str, list[PlanOutcome]]) -> None:
    """Rows: the fastest of MuJoCo's plans that succeeded, over ours at every time step."""
    for name, found in peers.items():
        solved = [plan for plan in found if plan.success]
        if not solved:
            note = "; ".join(dict.fromkeys(plan.message for plan in found))
            report.rows.append(Row(f"{name}: MuJoCo's plans that succeed", 0, f"of {len(found)}", note=note))
            continue
        fastest = min(solved, key=lambda plan: plan.seconds)
        note = f"{1e3 * fastest.seconds:.3g} ms, {fastest.iterations} iterations, {fastest.setting}"
        for key, own in plans.items():
            if key.startswith(f"{name}, ") and "damping" not in key:
                report.rows.append(Row(f"MuJoCo's time / ours: {key}", fastest.seconds / own.seconds, "", note=note))
                report.rows.append(Row(f"MuJoCo's cost / ours: {key}", fastest.cost / own.cost, ""))


def _one_stage(kappa: float) -> dict[str, Any]:
    """Options of a plan at hard contact from the beginning."""
    return next(s.options for s in cases.settings(quick=False) if s.name == f"kappa_grad {kappa:g}")


def _plans_table(title: str, plans: dict[str, PlanOutcome]) -> Table:
    rows: list[list[Cell]] = []
    for name, p in plans.items():
        each = 1e3 * p.seconds / max(p.iterations, 1)
        found: list[Cell] = [p.iterations, 1e3 * p.seconds, each, p.cost, p.violation]
        rows.append([name, *found, p.hard[1], *p.fine, p.message or "solved"])
    header = ("", "iterations", "ms", "ms each", "cost", "violation", "replayed", "fine: cost", "violation", "")
    note = f"replayed: violation on contact at kappa {HARD:g}; fine: the same with steps of 1/{REFINE}."
    return Table(title, header, rows, note)


def _scores_table(name: str, scores: list[setting_families.Score]) -> Table:
    rows: list[list[Cell]] = [
        [f"{s.setting.group}: {s.setting.name}", s.solved, s.true, s.good, s.iterations, s.excess, 1e3 * s.seconds]
        for s in scores
    ]
    header = ("", "solved", "true", "good", "iterations", "excess cost", "ms")
    note = (
        f"of {scores[0].variants}. True: violation <= {setting_families.TRUE:g} when replayed on hard contact; good: "
    )
    note += f"within {100 * (setting_families.GOOD - 1):.0f} % of the best true plan of any setting, both "
    note += "by the cost of the replay. Medians; 100 iterations at most."
    return Table(f"Settings of the planner: {name}", header, rows, note)


def _numbers(plan: PlanOutcome, *, history: bool = True) -> dict[str, Any]:
    fields = plan._asdict()
    return fields if history else {name: value for name, value in fields.items() if name != "history"}
