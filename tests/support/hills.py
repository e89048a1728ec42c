"""Smooth ground for the tests, and the derivatives of a step against differences."""

from __future__ import annotations

import numpy as np

import dojo_opt as dojo
from support.jacobians import check_step

H = 0.01
GRID = np.linspace(-2.0, 2.0, 41)


def waves(X, Y):
    """A smooth ground, slopes up to 17 degrees."""
    return 0.1 * np.sin(2.0 * X) * np.cos(1.5 * Y) + 0.1 * X


WAVES = dojo.Terrain.from_function(waves, GRID, GRID)


def derivatives_of(mech, x, kappa):
    """A and B of a step against central differences of the solver."""
    sim = dojo.Simulator(mech, time_step=H, kappa=kappa, tolerance=3e-14)
    u = 0.3 * np.arange(1.0, sim.nu + 1.0)
    return check_step(sim, x, u)
