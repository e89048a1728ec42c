"""Gradients: derivatives of one step and of whole motions, ours and others', against reference values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.engines import PhysicsEngine, installed
from benchmarks.studies.gradients import drake_motion, drake_step, peer_steps, sliding, smoothing, touchdown
from benchmarks.studies.gradients.gradients_figure import draw
from benchmarks.studies.gradients.gradients_tables import motion_table, resting_table, smoothing_table
from dojo_opt.report.gradients import RobotGradients
from dojo_opt.report.gradients.resting import ALLOWED, STEPS, resting_kappa
from dojo_opt.report.gradients.robot_gradients import EXACT, add_steps
from dojo_opt.report.interleaved_rounds import slope
from dojo_opt.report.result import Report, Row
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from solvers.compiler import threads

KAPPAS = (1e-6, 1e-8, 1e-10)  # of whole motions
JUDGED = 1e-8  # the bars apply to this kappa
TIME_STEPS = (1e-3, 2e-3, 5e-3, 1e-2, 2e-2)  # [s]
BARRED = (1e-3, 1e-2)
EPS = (1e-5, 1e-2)  # of differenced motions: the usual choice, and a wide one that averages
CHAINED = ("implicitfast", "discrete")  # MuJoCo's integrators with Jacobians
AHEAD = 5e-3  # [m] above the height from which a step reaches the ground
_LEFT_OUT = ("MuJoCo implicit", "Drake RK3")  # of a block as implicitfast; explicit, for stiff contacts
_NO_MUJOCO = 'without MuJoCo; pip install "dojo-opt[bench]" for its rows'


@dataclass(frozen=True)
class GradientsStudy:
    """The reference scenes; with a mechanism: one step of it, half a second after it was let go.

    quick: one time step, fewer rounds, engines and points.
    """

    quick: bool = False
    mechanism: Mechanism | None = None

    def run(self, progress: Progress) -> Report:
        """Measure."""
        if self.mechanism is not None:
            return self._robot(self.mechanism, progress)
        report = Report("Derivatives: error and cost")
        parts: dict[str, Callable[[Report], Any]] = {
            "one step": self._one_step,
            "motions": self._motions,
            "touch-down": self._touchdown,
            "smoothing": _smoothing,
        }
        results: dict[str, Any] = {}
        with threads(1):
            for name, part in progress([(name, (name, part)) for name, part in parts.items()], "gradients"):
                results[name] = part(report)
        report.summary = (
            "Every Jacobian of one step is compared with the extrapolated differences of the very same step. "
            "Jacobians of whole motions are compared with Coulomb's law, touch-down and smoothing with hard "
            "contact. Times are processor time on one core."
        )
        report.figure = draw(results)
        if find_spec("mujoco") is None:
            report.notes.append(_NO_MUJOCO)
        return report

    def _robot(self, mechanism: Mechanism, progress: Progress) -> Report:
        """One step of a mechanism, by ours and by the engines that are installed."""
        report = RobotGradients(mechanism, self.quick, peer_steps.installed_steps()).run(progress)
        report.notes += [] if find_spec("mujoco") else [_NO_MUJOCO]
        return report

    def _one_step(self, report: Report) -> dict[str, Any]:
        """Error and cost of (A, B)."""
        given = peer_steps.scenes()
        rounds = 3 if self.quick else 20
        return add_steps(report, given[-1:] if self.quick else given, rounds, peer_steps.installed_steps())

    def _motions(self, report: Report) -> list[sliding.Derivative]:
        """Derivatives of whole motions."""
        engines = _able(report, self.quick)
        steps = BARRED[-1:] if self.quick else TIME_STEPS
        found: list[sliding.Derivative] = []
        for motion in sliding.motions():
            for h in steps:
                found += [sliding.chained(motion, h, kappa) for kappa in KAPPAS]
                found.append(sliding.ours_differenced(motion, h, EPS[0], JUDGED))
                found += [
                    sliding.differenced(engine, motion, h, eps)
                    for engine in engines
                    if h in BARRED or engine.name.startswith("MuJoCo")  # the others are slower
                    for eps in EPS
                ]
                if h in BARRED:
                    found += [drake_motion.carried(motion, h, name) for name in _drakes(self.quick)]
                if find_spec("mujoco") is not None:
                    found += [sliding.mujoco_chained(motion, h, name) for name in CHAINED[: 1 if self.quick else 2]]
        for h in (h for h in BARRED if h in steps):
            report.tables.append(motion_table(found, h))
            for d in found:
                if (d.time_step, d.kappa, d.how) == (h, JUDGED, sliding.CHAINED):
                    name = f"{d.motion}, steps of {1e3 * h:g} ms: error"
                    report.rows.append(Row(name, d.error, "", 2.0 * h, note=f"{d.value:.5g}, exact {d.exact:.5g}"))
        report.details["motions"] = [d._asdict() for d in found]
        return found

    def _touchdown(self, report: Report) -> tuple[Any, list[touchdown.Curve]]:
        """Gradient against height."""
        heights = np.linspace(-0.01, 0.05, 61 if self.quick else 361)  # 0, where MuJoCo's contact begins, among them
        curves = [touchdown.ours(heights, kappa) for kappa in touchdown.KAPPAS]
        if find_spec("mujoco") is not None:
            curves += [touchdown.mujoco_ball(heights, label) for label in touchdown.MUJOCO]
        curves += [drake_motion.touchdown(heights, name) for name in _drakes(self.quick)[:1]]
        h = touchdown.H
        at = {k: touchdown.ours(np.array([touchdown.TOUCH, touchdown.TOUCH + AHEAD]), k) for k in touchdown.KAPPAS}
        off = max(abs(curve.gradient[0] + 0.5 / h) * h for curve in at.values())
        steepest = max(float(np.abs(curve.gradient).max()) for curve in curves if curve.kappa is not None)
        report.rows += [
            Row("touch-down: h times the steepest gradient", h * steepest, "", 1.0 + EXACT, note="any kappa; hard: 1"),
            Row("touch-down: at the touch, off -1/2h", off, "", EXACT, note="any kappa, times h"),
            Row(
                "touch-down: h times the gradient 5 mm ahead of it, kappa 1e-3",
                -h * float(at[1e-3].gradient[1]),
                "",
                0.05,
                at_least=True,
                note="hard contact, MuJoCo and Drake: 0",
            ),
        ]
        for curve in curves:
            if curve.kappa is None:
                value = h * float(np.abs(curve.gradient).max())
                report.rows.append(Row(f"touch-down: h times the steepest gradient, {curve.label}", value, ""))
        report.details["touchdown"] = {"heights": heights, **{c.label: c._asdict() for c in curves}}
        return heights, curves


def _drakes(quick: bool) -> tuple[str, ...]:
    """Contact approximations of Drake, where it is installed."""
    if find_spec("pydrake") is None:
        return ()
    return drake_step.APPROXIMATIONS[: 1 if quick else None]


def _able(report: Report, quick: bool) -> list[PhysicsEngine]:
    """Engines that can simulate the block; a note for those that cannot."""
    engines = []
    for engine in installed():
        if engine.name in _LEFT_OUT or (quick and engine.name != "MuJoCo implicitfast"):
            continue
        try:
            sliding.differenced(engine, sliding.motions()[0], BARRED[-1], EPS[0])
        except (ValueError, RuntimeError) as error:
            report.notes.append(f"motions: without {engine.name}: {error}")
        else:
            engines.append(engine)
    return engines


def _smoothing(report: Report) -> dict[str, Any]:
    """Bias and reach against kappa."""
    bias = {regime.name: smoothing.bias(regime) for regime in smoothing.regimes()}
    reach = np.array([smoothing.reach(kappa) for kappa in smoothing.KAPPAS])
    felt = [smoothing.gradient_at(kappa, d) for kappa, d in zip(smoothing.KAPPAS, reach, strict=True)]
    kappas = np.array(smoothing.KAPPAS)
    default = int(np.argmin(np.abs(np.log(kappas / 1e-6))))
    small = kappas < 1.1e-6
    for name, errors in bias.items():
        note = "of hard contact, 1 kg, 20 ms"
        report.rows.append(Row(f"bias at kappa 1e-6, {name}", errors[default], "", 1e-2, note=note))
        if name != "touching":
            report.rows.append(Row(f"bias by kappa: slope, {name}", slope(kappas[small], errors[small]), "", 1.05))
    off = float(np.abs(np.array(felt) / smoothing.FELT - 1.0).max())
    note = "where the gradient is 1 % of a contact's"
    report.rows.append(Row("reach sqrt(kappa h / m): off the formula", off, "", 1e-4, note=note))
    needed = np.array([resting_kappa(1.0, h) for h in STEPS])
    resting = np.array([smoothing.resting_bias(kappa, h) for kappa, h in zip(needed, STEPS, strict=True)])
    usual = np.array([smoothing.resting_bias(1e-6, h) for h in STEPS])
    off = float(np.abs(resting - ALLOWED / (1.0 + ALLOWED)).max())
    report.rows.append(Row("bias of a resting contact: off kappa / m g^2 h^3", off, "", EXACT, note="1 to 50 ms"))
    report.tables += [smoothing_table(kappas, bias, reach), resting_table(needed, usual)]
    report.details["smoothing"] = {"kappas": kappas, "reach": reach, **bias}
    report.details["resting"] = {"time_steps": STEPS, "kappa_needed": needed, "bias_at_1e-6": usual}
    return {"kappas": kappas, "reach": reach, "bias": bias}
