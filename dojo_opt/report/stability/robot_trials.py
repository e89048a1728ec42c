"""Trials of a mechanism of the user's: dropped and pushed, at time steps of 1 to 50 ms."""

from __future__ import annotations

import numpy as np

from dojo_opt.report.stability import measures
from dojo_opt.report.stability.trial import StabilityTrial
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

TIME_STEPS = (1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)  # [s]
RAISED = 0.1  # [m] above where it stands
SPEED = 1.0  # [m/s, rad/s] of its random start


def robot_trials(mechanism: Mechanism) -> list[StabilityTrial]:
    """Its neutral pose, a floating base raised by 0.1 m, with random velocities; one second without inputs."""
    sim = Simulator(mechanism)
    q = sim.neutral()[: sim.nq].copy()
    if mechanism.joints[0].ntrans == 3:
        q[2] += RAISED
    v = SPEED * np.random.default_rng(0).uniform(-1.0, 1.0, sim.nv)
    mass = sum(body.mass for body in mechanism.bodies)
    size = float(np.ptp(sim.maximal(sim.neutral())[:, :3], axis=0).max()) + RAISED
    scale = mass * (np.linalg.norm(np.asarray(mechanism.gravity)) * size + 0.5 * SPEED**2)
    rule = "every step solved, no gain of energy (2 %)"
    if mechanism.contacts:
        measure, rule = measures.growth_and_penetration(0.02 * float(scale), 1e-6), rule + ", no penetration (1e-6 m)"
    else:
        measure = measures.energy_growth(0.02 * float(scale))
    return [
        StabilityTrial(
            mechanism.name, f"1 s at {1e3 * h:g} ms", rule, mechanism, q, v, h, 1.0, measure, 1.0, samples=20
        )
        for h in TIME_STEPS
    ]
