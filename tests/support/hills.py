"""Smooth ground for the tests, and the derivatives of a step against differences."""

from __future__ import annotations

import numpy as np

import dojo_opt as dojo
from support.jacobians import check_jacobian

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
    result = sim.step(x, u)
    assert result.status == 0
    A, B = sim.linearize(x, u)

    def step(state, control):
        stepped = sim.step(state, control)
        return sim.difference(x1=stepped.x, x0=result.x) if stepped.status == 0 else np.full(sim.ndx, np.nan)

    check_jacobian(lambda state: step(state, u), A, x, sim.integrate)
    if sim.nu:
        check_jacobian(lambda control: step(x, control), B, u, np.add)
    return result
