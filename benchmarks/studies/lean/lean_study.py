"""The study `lean`: the terms that a scene omits, and the time that this saves.

A pendulum gets limits, a spring, a contact, friction, and a hundred contacts more, inactive and active. All run on one
core, in interleaved rounds; a separate process compiles the kernels of each scene.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from benchmarks.studies.lean import lean_figure
from benchmarks.studies.lean.lean_scenes import (
    DISTANCES,
    FAR,
    KAPPAS,
    MANY,
    absent,
    along,
    features,
    pendulum_scene,
)
from benchmarks.studies.lean.new_process import HEAVY, new_process
from dojo_opt.report.interleaved_rounds import ratio
from dojo_opt.report.lean import OmittedTerms
from dojo_opt.report.lean.cold_starts import add_cold_starts
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.step_cost import COST_HEADER, cost_row, costs, median_us, raw_cost
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from sim.simulator.omitted_contacts import reach
from solvers.compiler import threads

ABSENT = 1.05  # times a model that never had the feature: two runs of the same model differ by this much
SHARE = 0.03  # of a near contact


@dataclass(frozen=True)
class LeanStudy:
    """The pendulum, or a mechanism with the cost of each of its features."""

    quick: bool = False
    mechanism: Mechanism | None = None
    cold: bool = False  # whether to measure cold starts by feature, too

    def run(self, progress: Progress) -> Report:
        """Measure."""
        if self.mechanism is not None:
            return OmittedTerms(self.mechanism, self.quick, cold=self.cold).run(progress)
        rounds = 15 if self.quick else 100
        report = Report("Omitted terms")
        report.summary = (
            "A pendulum of one link gets features one by one, each compared with the scene that never had it; then "
            f"{MANY} contacts that face a wall {FAR:g} m away are compared with {MANY} contacts above the floor. "
            "Times are processor time on one core, medians over interleaved rounds; ratios are taken round by round."
        )
        with threads(1):
            for measure in progress([("features", _features), ("absent", _absent), ("distance", _distance)], "lean"):
                measure(report, rounds)
        _processes(report, progress, cold=not self.quick)
        report.figure = lean_figure.pendulum(report.details)
        if self.cold:
            add_cold_starts(report, progress, quick=self.quick)
        return report


def _features(report: Report, rounds: int) -> None:
    """The pendulum with one feature more in every row, and the cost of a far contact relative to a near one."""
    measured = costs([pendulum_scene(name, mechanism) for name, mechanism in features()], rounds)
    report.tables.append(
        Table(
            "One feature more in every row",
            COST_HEADER,
            [cost_row(cost) for cost in measured],
            "Variables: of the interior-point problem. Left out: far contacts; their forces are given, not "
            "solved for. Gradient: all of d(next state)/d(state, input), without its step. In the last row the "
            "contacts of the row before are above the floor instead.",
        )
    )
    report.details["features"] = [raw_cost(cost) for cost in measured]
    base, far, near = measured[-3:]
    for time_of in ("step", "gradient", "total"):
        t0, t1, t2 = (np.asarray(getattr(cost, time_of)) for cost in (base, far, near))
        share = float(np.median((t1 - t0) / (t2 - t0)))
        note = f"{median_us(t1 - t0) / MANY * 1e3:.3g} of {median_us(t2 - t0) / MANY * 1e3:.3g} ns per contact"
        name = {"total": "step and gradient"}.get(time_of, time_of)
        report.rows.append(Row(f"far contact / near contact: {name}", share, "", SHARE, note=note))
    report.rows.append(Row(f"{MANY} far contacts / none: step", ratio(far.step, base.step), "", note="the whole step"))


def _absent(report: Report, rounds: int) -> None:
    """Features that a model mentions and does not have, against one that never had them; and a model against itself."""
    cases = absent()
    scenes = [pendulum_scene(feature, mechanism) for feature, *both in cases for mechanism in both]
    measured = costs([*scenes, scenes[0]], rounds)
    for k, (feature, *_) in enumerate(cases):
        never, absent_here = measured[2 * k : 2 * k + 2]
        value = ratio(absent_here.total, never.total)
        note = "bytes and unknowns equal" if absent_here[1:5] == never[1:5] else "bytes or unknowns DIFFER"
        report.rows.append(Row(f"absent {feature}: step and gradient / never had it", value, "", ABSENT, note=note))
        same = float(absent_here[1:5] != never[1:5])
        report.rows.append(Row(f"absent {feature}: sizes that differ", same, "", 0.0))
    noise = ratio(measured[-1].total, measured[0].total)
    report.rows.append(Row("the same model twice: step and gradient", noise, "", note="the noise of the rows above"))
    report.details["absent"] = [raw_cost(cost) for cost in measured]


def _distance(report: Report, rounds: int) -> None:
    """A step with the wall at many distances, at several kappa; and the distance beyond which its contacts are far."""
    cone = dict(features())["+ cone"]
    grid = [(kappa, distance) for kappa in KAPPAS for distance in DISTANCES]
    scenes = [
        pendulum_scene(f"{kappa:g} {distance:g}", along(cone, MANY, friction=0.5, distance=distance), kappa)
        for kappa, distance in grid
    ]
    measured = costs([*scenes, pendulum_scene("none", cone)], max(3, rounds // 6))
    report.details["distance"] = [
        {"kappa": kappa, "distance": distance, **raw_cost(cost)}
        for (kappa, distance), cost in zip(grid, measured, strict=False)
    ]
    report.details["none"] = raw_cost(measured[-1])
    lines: list[list[Cell]] = []
    for k, distance in enumerate(DISTANCES):
        line = measured[k : len(grid) : len(DISTANCES)]
        cells = (f"{median_us(cost.step):.3g} us, {cost.far - measured[-1].far} far" for cost in line)
        lines.append([distance, *cells])
    sims = [scenes[k * len(DISTANCES)].simulator for k in range(len(KAPPAS))]
    edges = [reach(sim.model, sim.time_step, sim.kappa, sim.tolerance)[-1] for sim in sims]
    lines.append(["far from", *(f"{edge:.3g} m" for edge in edges)])
    report.tables.append(
        Table(
            f"{MANY} contacts that face a wall, by its distance [m]",
            ("", *(f"kappa {kappa:g}" for kappa in KAPPAS)),
            lines,
            "A contact pushes with kappa/gap at every distance. It is far where the stiffness of all together cannot "
            "be seen at the tolerance of the step; the push stays.",
        )
    )


def _processes(report: Report, progress: Progress, *, cold: bool) -> None:
    """Modules that new processes import, and code that they compile from an empty cache: with and without a contact."""
    names = ["pendulum", "+ cone"]
    runs = {name: new_process(name, cold=cold) for name in progress([(n, n) for n in names], "new process")}
    heavy = sum(len(run["modules"]) for run in runs.values())
    report.rows.append(
        Row("heavy libraries imported by a simulation", float(heavy), "", 0.0, note="none of " + ", ".join(HEAVY))
    )
    report.details["processes"] = {"cold": cold, **runs}
    if not cold:
        report.notes.append("quick: no kernels are counted, since nothing is compiled in a separate process")
        return
    plain, full = runs.values()
    unwanted = [name for name in plain["kernels"] if name.startswith(CONTACT_KERNELS)]
    saved = plain["seconds"] / full["seconds"]
    report.rows += [
        Row("kernels of contacts and limits compiled for a pendulum", float(len(unwanted)), "", 0.0),
        Row("kernels: pendulum / with a contact", len(plain["kernels"]) / len(full["kernels"]), ""),
        Row("CPU seconds to compile: pendulum / with a contact", saved, "", note="of steps and derivatives"),
    ]
    report.tables.append(
        Table(
            "Steps and derivatives in a new process with an empty cache",
            ("", "CPU seconds", "kernels", "by module"),
            [
                [name, run["seconds"], str(len(run["kernels"])), _by_module(run["kernels"])]
                for name, run in runs.items()
            ],
            "Limits, and contacts of every law, share one interior point: with any of them, all of it is compiled.",
        )
    )


def _by_module(kernels: list[str]) -> str:
    """Numbers of kernels, by the module they are in."""
    modules = Counter(name.split(".")[-2] for name in kernels)
    return ", ".join(f"{module} {count}" for module, count in modules.items())


CONTACT_KERNELS = tuple(
    f"sim.{name}." for name in ("contact", "dynamics.joints.limits", "solve.interior_point", "solve.inequalities")
) + ("sim.solve.globalization.", "sim.solve.known_start.", "solvers.cones.")
