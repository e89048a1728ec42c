"""Inputs that hold an arm against gravity: the guess of its motions, and the reference and unit of their efforts."""

from __future__ import annotations

import numpy as np

from dojo_opt.cost import Effort
from dojo_opt.gaits.equilibrium import potential_gradient
from dojo_opt.gaits.static_motions import input_map
from sim.simulator.simulator import Simulator
from solvers.types import Floats

_EFFORT = 0.01  # weight of squares of a torque, in units of the largest that holds the arm, beside rates in rad/s
_LEAST = 1e-3  # of that unit [N m]


def holding_inputs(sim: Simulator, q: Floats) -> Floats:
    """(n, nu) inputs that come nearest to holding the arm at coordinates (n, nq), their limits aside [N, N m]."""
    resting = np.concatenate([q, np.zeros((len(q), sim.nv))], axis=1)
    held = np.linalg.lstsq(input_map(sim), potential_gradient(sim, resting).T, rcond=None)[0].T
    return np.asarray(held, dtype=np.float64)


def effort(sim: Simulator, held: Floats, knot: float) -> Effort:
    """The cost of differences from inputs (n, nu) that hold the arm, within their limits, for knots [s]."""
    reference = np.clip(held, *(np.asarray(bound, dtype=float) for bound in sim.mechanism.input_limits))
    unit = max(float(np.abs(reference).max(initial=0.0)), _LEAST)
    return Effort(knot * _EFFORT / unit**2, reference=reference)
