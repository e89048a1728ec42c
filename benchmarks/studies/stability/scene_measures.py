"""Measures of trials on a run of a given scene; smaller is better."""

from __future__ import annotations

import numpy as np

from dojo_opt.report import run_measures
from dojo_opt.report.engine import Run
from dojo_opt.report.stability.trial import Measure
from sim.mechanism.mechanism import Mechanism


def energy_error(scale: float) -> Measure:
    """Largest |E - E0| over `scale` [J]."""

    def measure(_: Mechanism, run: Run) -> float:
        return float(np.abs(run.energy - run.energy[0]).max() / scale)

    return measure


def amplitude_error(_: Mechanism, run: Run) -> float:
    """Largest |sqrt(E/E0) - 1|: the amplitude of a vibration, sqrt(x^2 + (v/omega)^2) over its first value."""
    return float(np.abs(np.sqrt(np.maximum(run.energy, 0.0) / run.energy[0]) - 1.0).max())


def angular_momentum(_: Mechanism, run: Run) -> float:
    """Largest change of the angular momentum, over its size."""
    return run_measures.momentum_drift(run)


def penetration(mechanism: Mechanism, run: Run) -> float:
    """Deepest penetration [m]."""
    return run_measures.penetration(mechanism, run)


def resting(mechanism: Mechanism, run: Run) -> float:
    """The larger of the penetration at any time, and of the motion of a body in the last tenth of the time [m]."""
    last = run.position[-max(2, len(run.time) // 10) :]
    return max(run_measures.penetration(mechanism, run), float(np.abs(last[-1] - last[0]).max()))


def standing_at(body: int, height: float) -> Measure:
    """Penetration, and the error of the height of a body at the end [m]."""

    def measure(mechanism: Mechanism, run: Run) -> float:
        return max(run_measures.penetration(mechanism, run), abs(float(run.position[-1, body, 2]) - height))

    return measure


def traveled(body: int, axis: int, distance: float) -> Measure:
    """Error of the displacement along an axis, over `distance` [m]; one more for every motion back."""

    def measure(_: Mechanism, run: Run) -> float:
        path = run.position[:, body, axis] - run.position[0, body, axis]
        back = float(np.maximum(-np.diff(path), 0.0).sum())
        return abs(float(path[-1]) - distance) / abs(distance) + back / abs(distance)

    return measure


def beyond(body: int, axis: int, low: float, high: float) -> Measure:
    """The largest violation of the limits of a body [m]."""

    def measure(_: Mechanism, run: Run) -> float:
        path = run.position[:, body, axis]
        return float(max((low - path).max(), (path - high).max()))

    return measure


def late_penetration(after: float) -> Measure:
    """Deepest penetration [m] later than `after` [s]."""

    def measure(mechanism: Mechanism, run: Run) -> float:
        return float(-run_measures.gaps(mechanism, run)[run.time > after].min())

    return measure
