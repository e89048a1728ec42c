"""Measures of trials on a run; smaller is better."""

from __future__ import annotations

from dojo_opt.report import run_measures
from dojo_opt.report.engine import Run
from dojo_opt.report.stability.trial import Measure
from sim.mechanism.mechanism import Mechanism


def energy_growth(scale: float) -> Measure:
    """Largest E - E0 over `scale` [J]: contacts, friction and dampers may only take."""

    def measure(_: Mechanism, run: Run) -> float:
        return run_measures.energy_change(run)[1] / scale

    return measure


def growth_and_penetration(energy: float, depth: float) -> Measure:
    """The larger of the growth of energy over `energy` [J] and the penetration over `depth` [m]."""

    def measure(mechanism: Mechanism, run: Run) -> float:
        return max(run_measures.penetration(mechanism, run) / depth, run_measures.energy_change(run)[1] / energy)

    return measure
