"""Accuracy: every engine on every scene, from large time steps to small ones, against references in continuous time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.engines import PhysicsEngine, installed
from benchmarks.studies.accuracy import accuracy_scenes as scenes
from benchmarks.studies.accuracy import robot_settings as robots
from benchmarks.studies.accuracy.damped_motions import dampers
from dojo_opt.report.accuracy import RobotAccuracy
from dojo_opt.report.accuracy import error_curves as curves
from dojo_opt.report.accuracy import error_figure as drawing
from dojo_opt.report.accuracy.error_curves import Curves
from dojo_opt.report.accuracy.smooth_scene import SmoothScene
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from solvers.compiler import threads

_PEER = "MuJoCo RK4"  # the one to beat
_MOMENTUM = 1e-12


@dataclass(frozen=True)
class AccuracyStudy:
    """The reference scenes; or one mechanism, and which time step, kappa and tolerance it needs."""

    quick: bool = False
    mechanism: Mechanism | None = None

    def run(self, progress: Progress) -> Report:
        """Measure."""
        with threads(1):
            if self.mechanism is not None:
                return RobotAccuracy(self.mechanism, self.quick, installed()).run(progress)
            return self._scenes(progress)

    def _scenes(self, progress: Progress) -> Report:
        report = Report(
            "Error against run time, without contact",
            summary=_SUMMARY,
        )
        everyone = curves.engines(1 if self.quick else 3, installed())
        measured: dict[str, Curves] = {}
        for make in progress(self._makers(), "accuracy"):
            scene = make()
            steps = (0.1, 0.05, 0.01, 0.002) if self.quick else curves.STEPS
            measured[scene.name] = curves.measure(scene, everyone, steps, 0.02 if self.quick else 0.2)
            _compare(report, scene, measured[scene.name])
            _tabulate(report, scene, measured[scene.name])
            report.details[scene.name] = {name: [p._asdict() for p in ps] for name, ps in measured[scene.name].items()}
        _ratio_table(report)
        for part in progress([("dampers", dampers), ("short pieces", _pieces), ("long runs", _long_runs)], "accuracy"):
            part(report, everyone, self.quick)
        for advice in progress([("robots", robots.recommendations)], "accuracy"):
            advice(report, self.quick)
        report.figure = drawing.figure(measured)
        report.notes.append(
            "processor time counts the steps only: the time of an empty call from Python is subtracted for every "
            "engine; ours is one rollout, MuJoCo's mj_step with a number of steps per sample; an engine counts as "
            "lost when its energy error exceeds the total energy"
        )
        report.notes.append(
            f"errors count as equal below {curves.FLOOR:g}, or below the change of the reference after a change of the "
            "start by one rounding, if that is more (5e-10 rad after 10 s for the free body, which turns about its "
            "unstable axis); steps are omitted when their run would take longer than "
            f"{'0.02' if self.quick else '0.2'} s, except ours of order 2 where momentum is conserved; "
            "inf: the engine was lost on the way"
        )
        return report

    def _makers(self) -> list[tuple[str, Callable[[], SmoothScene]]]:
        """Scenes by name."""
        seconds = 2.0 if self.quick else 10.0
        links = (2, 5) if self.quick else (2, 5, 10, 50, 100)
        chains = [(f"pendulum of {n}", lambda n=n: scenes.chain(n)) for n in links]
        return [
            ("free body", lambda: scenes.free_body(seconds)),
            ("tree", lambda: scenes.tree(seconds)),
            *chains,
        ]


_SUMMARY = (
    "Smooth motion in every engine with time steps from 0.1 s to 0.1 ms, errors at ten samples against equations of "
    "motion in continuous time (DOP853, relative tolerance 1e-12; bodies by Newton and Euler, pendulums in absolute "
    "angles), which share no code with the simulator. Processor time covers the stepping alone. Ratios compare the "
    "best of our orders with MuJoCo's RK4 at the same processor time, for every step of RK4: below 1, ours is better."
)


def _compare(report: Report, scene: SmoothScene, measured: Curves) -> None:
    """Rows: ratios to the peer at equal processor time, and momentum of ours."""
    if _PEER in measured:
        attitude = "attitude" if scene.name == "free body" else "position"
        floors = curves.floors(scene)
        for quantity, at_least in (("energy", 0.0), ("angular", 0.0), (attitude, 1e-3)):
            if quantity == "angular" and not scene.floating:
                continue
            over = curves.ratios(measured, _PEER, quantity, floors[quantity])
            value, note = curves.worst(over, at_least)
            name = {"angular": "angular momentum"}.get(quantity, quantity)
            report.rows.append(Row(f"{scene.name}: {name}, ours / RK4 at equal time", value, "", 1.0, note=note))
            report.details.setdefault("ours / RK4", {})[f"{scene.name}, {quantity}"] = over
    if scene.floating:
        for name, points in measured.items():
            if name.startswith("dojo-opt"):
                good = [p.errors for p in points if np.isfinite(p.errors["energy"])]
                drift = max(max(errors["momentum"], errors["angular"]) for errors in good)
                note = f"steps of {1e3 * points[0].time_step:g} to {1e3 * points[-1].time_step:g} ms"
                report.rows.append(Row(f"{scene.name}: drift of momentum, {name}", drift, "", _MOMENTUM, note=note))


def _ratio_table(report: Report) -> None:
    """Ratios at equal processor time, one column per time step of the peer."""
    over: dict[str, dict[float, float]] = report.details.get("ours / RK4", {})
    steps = sorted({h for ratio in over.values() for h in ratio}, reverse=True)
    if steps:
        rows: list[list[Cell]] = [[name, *(ratio.get(h) for h in steps)] for name, ratio in over.items()]
        header = ["", *(f"RK4 at {1e3 * h:g} ms" for h in steps)]
        note = "below 1: ours is more exact in the time that RK4 takes; inf: ours takes longer with every step"
        report.tables.append(Table("Error of ours over that of RK4 at equal processor time", header, rows, note))


def _tabulate(report: Report, scene: SmoothScene, measured: Curves) -> None:
    """One row per engine and step."""
    whats = list(next(iter(measured.values()))[0].errors)
    rows: list[list[Cell]] = [
        [name, 1e3 * p.time_step, 1e6 * p.seconds / max(p.steps, 1), 1e3 * p.seconds, *(p.errors[w] for w in whats)]
        for name, points in measured.items()
        for p in points
    ]
    header = ["engine", "step, ms", "us per step", "ms in all", *whats]
    report.tables.append(Table(f"{scene.name}, {scene.duration:g} s", header, rows))


def _pieces(report: Report, everyone: list[PhysicsEngine], quick: bool) -> None:
    """Short pieces restarted from the reference."""
    cut = curves.cut(scenes.tree(1.0), 3 if quick else 10, 0.1)
    steps = (0.05, 0.01) if quick else (0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
    rows: list[list[Cell]] = [[engine.name, *(cut.error(_once(engine), h) for h in steps)] for engine in everyone]
    title = "Consistency: position error after pieces of 0.1 s restarted from the reference, tree [m]"
    report.tables.append(Table(title, ["engine", *(f"{1e3 * h:g} ms" for h in steps)], rows))


def _long_runs(report: Report, everyone: list[PhysicsEngine], quick: bool) -> None:
    """Largest energy error of pendulums over 100 s, relative to M g L."""
    rows: list[list[Cell]] = []
    seconds = 10.0 if quick else 100.0
    cases = [(2, 0.01), (2, 0.001)] if quick else [(n, h) for n in (2, 5, 10) for h in (0.01, 0.001)]
    for n, h in cases:
        scene = scenes.chain(n)
        for engine in everyone:
            if h < 0.01 and engine.name in ("dojo-opt order 6", "dojo-opt order 8"):
                continue  # ten times the time, where a larger step is exact enough
            args: dict[str, Any] = {"time_step": h, "q": scene.q, "v": scene.v, "duration": seconds, "samples": 100}
            run = _once(engine).simulate(scene.mechanism, **args)
            drift = np.abs(run.energy - run.energy[0]).max() / scene.scale
            late = np.abs(run.energy[-20:] - run.energy[0]).max() / scene.scale
            end = "" if not run.message else f"{run.message}"[:60]
            rows.append([n, 1e3 * h, engine.name, run.seconds, drift, late, end])
    header = ["links", "step, ms", "engine", "seconds", "energy error", "in the last fifth", "ended early"]
    report.tables.append(Table(f"Energy over {seconds:g} s, in units of M g L", header, rows))


def _once(engine: PhysicsEngine) -> PhysicsEngine:
    """The same engine, clocked once: for long runs."""
    from dataclasses import fields, is_dataclass, replace

    if is_dataclass(engine) and not isinstance(engine, type) and "rounds" in {f.name for f in fields(engine)}:
        return replace(engine, rounds=0)
    return engine
