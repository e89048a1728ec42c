"""Derivatives of one step of a robot: error and cost of every method, and the kappa that its contacts need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dojo_opt.report.gradients import one_step
from dojo_opt.report.gradients.resting import ALLOWED, STEPS, resting_kappa
from dojo_opt.report.gradients.step_figure import step_figure, step_table
from dojo_opt.report.result import Report, Row
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from solvers.compiler import threads

EXACT = 1e-6  # bar of one step, relative


@dataclass(frozen=True)
class RobotGradients:
    """One step of a robot, half a second after it was let go; quick: fewer rounds; peers: other engines."""

    mechanism: Mechanism
    quick: bool = False
    peers: Sequence[one_step.Peer] = ()

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report(f"Derivatives of {self.mechanism.name}: error and cost")
        report.summary = (
            "Every Jacobian of one step is compared with the extrapolated differences of the very same step. Times are "
            "processor time on one core."
        )
        with threads(1):
            for scene in progress([("one step", one_step.scene_of(self.mechanism))], "gradients"):
                measured = add_steps(report, [scene], 3 if self.quick else 20, self.peers)
                report.notes += _advice(scene)
                report.figure = step_figure(measured)
        return report


def add_steps(
    report: Report, scenes: Sequence[one_step.StepScene], rounds: int, peers: Sequence[one_step.Peer]
) -> dict[str, Any]:
    """Rows and a table of every scene; returns its points and the bias of the smoothing, by the name of the scene."""
    measured: dict[str, Any] = {}
    for scene in scenes:
        points, notes = one_step.measure(scene, rounds, peers)
        bias = one_step.smoothed(scene)
        report.notes += notes
        report.rows += _exactness(scene.name, points)
        report.tables.append(step_table(scene.name, points, bias))
        measured[scene.name] = {"points": points, "bias": bias}
    report.details["one_step"] = {
        name: {"points": [p._asdict() for p in m["points"]], "kappas": one_step.KAPPAS, "bias": m["bias"]}
        for name, m in measured.items()
    }
    return measured


def _exactness(name: str, points: list[one_step.JacobianPoint]) -> list[Row]:
    """Worst errors of ours; judged where the reference is good enough to do so."""
    rows = []
    for method, bar in ((one_step.TIGHTLY, EXACT), (one_step.IMPLICIT, None)):
        own = [p for p in points if p.method == method]
        known = [p for p in own if p.doubt <= EXACT]
        vague = ", ".join(f"{p.kappa:g}" for p in own if p.doubt > EXACT)
        note = f"but for kappa {vague}, where differences do not agree to {EXACT:g}" if vague else "any kappa"
        worst = max((p.error for p in known), default=np.nan)
        rows.append(Row(f"{name}: {method}, error of (A, B)", worst, "", bar if known else None, note=note))
    return rows


def _advice(scene: one_step.StepScene) -> list[str]:
    """kappa for a mechanism, from the loads of its contacts."""
    loads = one_step.loads(scene)
    if not len(loads):
        return ["no contact carries a load here, which would tell the kappa that its derivatives need"]
    gravity = float(np.linalg.norm(scene.sim.model.gravity))
    carried = float(np.median(loads)) / gravity
    needed = [f"{resting_kappa(carried, h, gravity):.1g} at {1e3 * h:g} ms" for h in STEPS]
    return [
        f"{len(loads)} contacts are loaded, half of them by less than {carried:.2g} kg: derivatives of one that "
        f"carries so much are within {100 * ALLOWED:g} % of hard contact up to a kappa of " + ", ".join(needed)
    ]
