"""Measures of a run for studies, by one formula for every engine."""

from __future__ import annotations

import numpy as np

from dojo_opt.report.engine import Run
from sim.mechanism.mechanism import Mechanism
from solvers.types import Floats


def gaps(mechanism: Mechanism, run: Run) -> Floats:
    """Distance of every contact to its ground, (n, ncontact) [m]; negative is penetration."""
    bodies = [mechanism.body_names.index(contact.body) for contact in mechanism.contacts]
    out = np.empty((len(run.time), len(bodies)))
    for c, (body, contact) in enumerate(zip(bodies, mechanism.contacts, strict=True)):
        arm = _rotated(run.quaternion[:, body], np.asarray(contact.point))
        out[:, c] = contact.gap(run.position[:, body] + arm)
    return out


def _rotated(quaternion: Floats, vector: Floats) -> Floats:
    """R(q) v for every quaternion (n, 4)."""
    w, u = quaternion[:, :1], quaternion[:, 1:]
    return np.asarray(vector + 2.0 * np.cross(u, np.cross(u, vector) + w * vector))


def penetration(mechanism: Mechanism, run: Run) -> float:
    """Deepest penetration of any contact at any sample [m]; below zero when nothing was even touched."""
    return float(-gaps(mechanism, run).min())


def energy_change(run: Run) -> tuple[float, float]:
    """(smallest, largest) energy minus that of the start [J]."""
    change = run.energy - run.energy[0]
    return float(change.min()), float(change.max())


def momentum_drift(run: Run) -> float:
    """Largest change of the angular momentum about the origin, over its size."""
    angular = run.momentum[:, 3:]
    return float(np.linalg.norm(angular - angular[0], axis=1).max() / np.linalg.norm(angular[0]))


def complete(run: Run) -> bool:
    """Whether the engine went through to the end, with finite numbers."""
    return not run.message and bool(np.isfinite(run.energy).all())
