"""Invariants along a motion of two bodies under their collision alone."""

from __future__ import annotations

import numpy as np

from sim.simulator.results import Trajectory
from sim.simulator.simulator import Simulator


def check_motion(sim: Simulator, t: Trajectory, seed: int) -> bool:
    """Momentum is kept, no energy is gained, the bodies stay apart; returns whether they hit each other."""
    for total in sim.momentum(t.x):
        assert np.ptp(total, axis=0).max() < 1e-9, seed
    assert np.diff(sim.energy(t.x)).max() < 1e-3, seed  # kappa pushes from afar
    assert t.contacts.gap.min() > 0.0
    return bool(np.abs(t.contacts.impulse).max() > 0.1)
