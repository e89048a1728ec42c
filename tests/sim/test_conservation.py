"""Conservation of energy and momentum at the nodes over a motion, for every joint kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.mechanism.joint import KINDS
from sim.simulator.simulator import Simulator
from support.mechanisms import CASES, chain_with, random_state


@pytest.mark.parametrize("kind", KINDS)
def test_momentum_of_a_free_chain(kind: str) -> None:
    """Springs and dampers between bodies leave the total momentum alone."""
    mech = replace(chain_with(kind, on_world=False), contacts=(), gravity=(0, 0, 0))
    mech = replace(
        mech,
        joints=[replace(j, damper=0.0) if j.kind == "floating" and j.parent == "world" else j for j in mech.joints],
    )
    sim = Simulator(mech, time_step=0.01, tolerance=1e-10)
    q, v = random_state(np.random.default_rng(2), mech)
    t = sim.rollout(np.concatenate([q, v]), np.zeros((50, sim.nu)), throw=True)
    linear, angular = sim.momentum(t.x)
    np.testing.assert_allclose(linear, np.tile(linear[0], (51, 1)), atol=1e-9)
    np.testing.assert_allclose(angular, np.tile(angular[0], (51, 1)), atol=1e-9)


@pytest.mark.sweep(5)
@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_energy_error_is_of_second_order(kind: str, on_world: bool) -> None:
    mech = chain_with(kind, on_world)
    mech = replace(mech, contacts=(), joints=[replace(j, damper=0.0) for j in mech.joints])
    q, v = random_state(np.random.default_rng(4), mech, speed=0.5)
    error = []
    for h in (0.01, 0.005):
        sim = Simulator(mech, time_step=h, tolerance=1e-10)
        t = sim.rollout(sim.state_from_velocity(q, v), np.zeros((round(0.5 / h), sim.nu)), throw=True)
        energy = sim.energy(t.x)
        error.append(np.abs(energy - energy[0]).max())
    assert error[0] < 0.02 * (1 + abs(energy[0]))
    assert error[1] < 0.35 * error[0] or error[1] < 1e-9
