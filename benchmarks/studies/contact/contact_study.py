"""The contact study: every engine on the same scenes, rows for ours at the kappa recommended for simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.engines import Ours, PhysicsEngine, installed
from benchmarks.studies.contact import contact_measures as measure
from benchmarks.studies.contact import contact_scenes as scenes
from benchmarks.studies.contact import simbenchmark
from benchmarks.studies.contact.contact_figure import picture
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.stability.judging import KAPPA
from dojo_opt.report.study import Progress

KAPPAS = (1e-6, 1e-8, KAPPA, 1e-11)
CURVE = tuple(10.0 ** -np.arange(4.0, 13.5))  # of creep against kappa
RATES = (20, 50, 100, 200, 500)  # [Hz]
RATE_REFERENCE = 5e-4  # [s] of every engine for itself
TOSS_STEPS = (1e-2, 5e-3, 2e-3, 1e-3)  # [s]
TOSS_REFERENCE = 1e-4  # [s]
_LEFT_OUT = ("MuJoCo implicit", "Drake RK3")  # as implicitfast here; an explicit method for stiff contacts
Results = dict[str, dict[str, Any]]

SUMMARY = (
    "Blocks, a ball and a quadruped against a half-space: friction, rest and impact in each engine, compared with "
    "Coulomb's law in closed form. A sliding block stops after v^2/(2 mu g) in every direction and does not rise, a "
    "block on a slope below the friction angle does not move, nothing sinks in at any speed, and a growing push moves "
    "a cube as the integral says. Where there is no closed form, an engine is compared with itself at a much smaller "
    "time step."
)
NOTES = [
    f"Simulate these scenes with kappa {KAPPA:g}: creep and the gap at rest are proportional to kappa, run time is "
    "not. The gap is kappa over the impulse m g h, so light bodies and small time steps need a smaller kappa: the "
    "default is 1e-9 m/s * m g h. With the kappa of plans, 1e-6, the block of 1 kg floats at 0.4 mm and creeps at "
    "1.3 mm/s at 1 ms.",
    "MuJoCo: elliptic cones, its defaults otherwise; 'stiff contacts' are solref .001 1, solimp .99 .999 .0001. Drake: "
    "point contact, 1 mm penetration allowance. PyBullet: 50 iterations. Points are balls of a tenth of a millimetre "
    "there. The sliding block starts from where it rests in each engine.",
]


@dataclass(frozen=True)
class ContactStudy:
    """Sliding, sticking, impact, rate and self-consistency; quick takes one time step and fewer directions."""

    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure every engine."""
        report = Report("Contact: sliding, rest and impact", summary=SUMMARY)
        report.notes += NOTES
        steps = (1e-2,) if self.quick else (1e-3, 1e-2)
        engines: list[tuple[str, PhysicsEngine]] = [
            (f"dojo-opt, kappa {kappa:g}", Ours(kappa=kappa, rounds=1)) for kappa in KAPPAS
        ]
        engines += [(peer.name, peer) for peer in _peers(self.quick)]
        results: Results = {}
        for name, engine in progress([(name, (name, engine)) for name, engine in engines], "contact"):
            results[name] = {f"{h:g}": self._at(engine, h) for h in steps}
            results[name]["rates"] = self._rates(engine)
            results[name]["toss"] = self._toss(engine)
        curve = self._curve()
        report.tables += _tables(results, [f"{h:g}" for h in steps])
        report.rows += _rows(results, [f"{h:g}" for h in steps], curve)
        report.details |= {"engines": results, "curve": curve}
        rows, table, numbers = simbenchmark.measured(self.quick)
        report.rows += rows
        report.tables.append(table)
        report.details["simbenchmark"] = numbers
        report.figure = picture(results, curve, f"{steps[-1]:g}")
        return report

    def _at(self, engine: PhysicsEngine, time_step: float) -> dict[str, Any]:
        """All scenes at one time step."""
        directions = measure.DIRECTIONS[[0, 1, 3, 6]] if self.quick else measure.DIRECTIONS
        return {
            "sliding": measure.sliding(engine, time_step, directions),
            "creep": measure.creep(engine, time_step, 2.0 if self.quick else 10.0),
            "pushed": measure.pushed(engine, time_step),
            "ball drop": measure.ball_drop(engine, time_step),
            "box drop": measure.box_drop(engine, time_step),
            "ball 100 m/s": measure.ball_impact(engine, time_step),
            "box 100 m/s": measure.box_impact(engine, time_step),
        }

    def _rates(self, engine: PhysicsEngine) -> dict[str, float]:
        """Largest distance of the trunk's height from that at the reference step, per rate [m]."""
        rates = (20, 100) if self.quick else RATES
        exact = measure.torso(engine, RATE_REFERENCE)
        return {str(r): float(np.abs(measure.torso(engine, 1.0 / r) - exact).max()) for r in rates}

    def _toss(self, engine: PhysicsEngine) -> dict[str, float]:
        """Mean distance of the tossed cube from the same engine at the reference step, per time step [m]."""
        steps = list(TOSS_STEPS[:2] if self.quick else TOSS_STEPS)
        found = measure.inconsistency(engine, steps, 1e-3 if self.quick else TOSS_REFERENCE)
        return {f"{h:g}": value for h, value in zip(steps, found, strict=True)}

    def _curve(self) -> dict[str, list[float]]:
        """Creep of ours and its run time against kappa, at 10 ms."""
        kappas = CURVE[::3] if self.quick else CURVE
        creeps = [measure.creep(Ours(kappa=k), 1e-2) for k in kappas]
        slides = [measure.sliding(Ours(kappa=k, rounds=9), 1e-2, measure.DIRECTIONS[:1]) for k in kappas]
        return {
            "kappa": list(kappas),
            "drift": [c["drift"] for c in creeps],
            "us_per_step": [s["us_per_step"] for s in slides],
        }


def _peers(quick: bool) -> list[PhysicsEngine]:
    """The installed engines, and MuJoCo with the hardest contacts that hold."""
    peers = [engine for engine in installed() if engine.name not in _LEFT_OUT]
    if find_spec("mujoco") is not None:
        from benchmarks.engines.mujoco import stiff

        peers.append(stiff())
    return peers[::3] if quick else peers


def _tables(results: Results, steps: Sequence[str]) -> list[Table]:
    """Engines down, numbers across; two time steps share a cell."""

    def cells(names: Sequence[tuple[str, str, float]]) -> list[list[Cell]]:
        return [[engine, *(_pair(found, steps, name) for name in names)] for engine, found in results.items()]

    at = " / ".join(f"{float(h) * 1e3:g} ms" for h in steps)
    sliding = [("sliding", key, scale) for key, scale in (("stop", 1.0), ("spread", 1.0), ("lateral", 1.0))]
    sliding += [("sliding", "lift", 1e3), ("sliding", "us_per_step", 1.0)]
    sticking = [("creep", "drift", 1e3), ("creep", "speed", 1e3), ("pushed", "", 1e3)]
    falls = [(scene, "depth", 1e3) for scene in ("ball drop", "box drop", "ball 100 m/s", "box 100 m/s")]
    falls += [("ball drop", "rest", 1e3), ("ball drop", "rebound", 1.0), ("ball 100 m/s", "rebound", 1.0)]
    rates = list(next(iter(results.values()))["rates"])
    tosses = list(next(iter(results.values()))["toss"])
    return [
        Table(
            f"A block slides at 3 m/s on friction 0.3, at {at}",
            ("", "stop", "spread", "lateral", "lift [mm]", "us per step"),
            cells(sliding),
            "stop: worst relative error of v^2/(2 mu g) over the directions; spread: longest minus shortest; "
            "lateral: off the line; lift: highest position of the lowest corner",
        ),
        Table(
            f"A block on a slope of 20 degrees with friction 0.5, and one pushed by a ramp of force, at {at}",
            ("", "drift [mm]", "creep [mm/s]", "pushed, error [mm]"),
            cells(sticking),
            f"drift over the whole run; pushed: a ramp of 20 N/s for 1 s, {scenes.ramp_displacement():.3f} m exactly",
        ),
        Table(
            f"Deepest penetration, at {at}; then the rest of the dropped ball, and rebounds",
            ("", "ball [mm]", "box [mm]", "ball, 100 m/s", "box, 100 m/s", "rest [mm]", "rebound [m/s]", "at 100 m/s"),
            cells(falls),
            "below zero: a gap",
        ),
        Table(
            "A quadruped dropped from 0.1 m: trunk height against the same engine at 2 kHz, largest distance [mm]",
            ("", *(f"{rate} Hz" for rate in rates)),
            [[engine, *(_millimeters(found["rates"][r]) for r in rates)] for engine, found in results.items()],
        ),
        Table(
            "A tossed cube: mean distance from the same engine at a fine step [mm]",
            ("", *(f"{float(h) * 1e3:g} ms" for h in tosses)),
            [[engine, *(_millimeters(found["toss"][h]) for h in tosses)] for engine, found in results.items()],
        ),
    ]


def _millimeters(value: float) -> Cell:
    """A length [mm], 'failed' where the engine stopped."""
    return "failed" if np.isnan(value) else 1e3 * value


def _pair(found: dict[str, Any], steps: Sequence[str], name: tuple[str, str, float]) -> str:
    """The number at every time step, 'failed' where the engine stopped."""
    scene, key, scale = name
    values = [found[h][scene][key] if key else found[h][scene] for h in steps]
    return " / ".join("failed" if np.isnan(value) else f"{scale * value:.2g}" for value in values)


def _rows(results: Results, steps: Sequence[str], curve: dict[str, list[float]]) -> list[Row]:
    """Ours at the recommended kappa, the worst of the time steps."""
    ours = results[f"dojo-opt, kappa {KAPPA:g}"]

    def worst(scene: str, key: str) -> float:
        return float(np.max([abs(ours[h][scene][key]) for h in steps]))

    def deepest(scene: str) -> float:
        return float(np.max([ours[h][scene]["depth"] for h in steps]))

    late = [abs(ours[h]["sliding"]["stop"]) * scenes.STOP / (0.5 * float(h) * scenes.SPEED) for h in steps]
    rates, pushed = ours["rates"], float(np.max([abs(ours[h]["pushed"]) / float(h) for h in steps]))
    hardest = float(np.max([abs(results["dojo-opt, kappa 1e-11"][h]["creep"]["drift"]) for h in steps]))
    seconds = "10 s; 2 s when quick"
    order = np.polyfit(np.log(curve["kappa"]), np.log(curve["drift"]), 1)[0]
    return [
        Row("stopping distance, error over h v/2, worst direction", float(np.max(late)), "", 1.0),
        Row("stopping distance, longest minus shortest direction", worst("sliding", "spread"), "", 1e-6),
        Row("distance off the line, worst direction", worst("sliding", "lateral"), "", 1e-6),
        Row("lift-off while sliding", worst("sliding", "lift"), "m", 1e-7),
        Row("creep below the cone, whole run", worst("creep", "drift"), "m", 1e-5, note=seconds),
        Row("the same at kappa 1e-11", hardest, "m", 1e-6, note=seconds),
        Row("creep proportional to kappa: slope", float(order), "", 1.05, note="log-log, 1e-4 to 1e-13"),
        Row("pushed by a ramp of force, error over h", pushed, "m/s", 0.1, note="analytic"),
        Row("penetration, ball and box dropped", max(deepest("ball drop"), deepest("box drop")), "m", 1e-8),
        Row("penetration at 100 m/s", max(deepest("ball 100 m/s"), deepest("box 100 m/s")), "m", 1e-8),
        Row("gap or penetration at rest", worst("ball drop", "rest"), "m", 1e-7),
        Row("dropped quadruped, 20 Hz against 2 kHz", rates["20"], "m", 0.02),
    ]
