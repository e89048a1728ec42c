"""Every ready-made mechanism moves as it should: it steps, conserves, and its gradients match its steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dojo_opt import models
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from support.jacobians import check_step

H = 0.01
HEAVY = {"atlas", "humanoid", "quadruped", "youbot"}
NAMES = [pytest.param(name, marks=pytest.mark.slow) if name in HEAVY else name for name in models.__all__]


def free(mech: Mechanism) -> Mechanism:
    """The mechanism in space: no contacts, limits, dampers, or gravity."""
    joints = [replace(j, damper=0.0, limits=None, cone=None) for j in mech.joints]
    return replace(mech, contacts=(), joints=joints, gravity=(0.0, 0.0, 0.0))


def excited(sim: Simulator, seed: int, speed: float, spread: float = 0.0) -> np.ndarray:
    """A state near the neutral one, on the move."""
    rng = np.random.default_rng(seed)
    dx = np.concatenate([spread * rng.normal(size=sim.nv), speed * rng.normal(size=sim.nv)])
    return sim.close(sim.integrate(sim.neutral(), dx))


@pytest.mark.parametrize("name", NAMES)
def test_one_second(name: str) -> None:
    """Left alone it moves for a second, gains no energy, and enters nothing."""
    mech = getattr(models, name)()
    sim = Simulator(mech, time_step=H, kappa=1e-8)
    t = sim.rollout(excited(sim, 1, 0.2), np.zeros((100, sim.nu)), throw=True)
    energy = sim.energy(t.x)
    # of a bounded error of second order, and the central path's push over the ground
    assert energy.max() < energy[0] + 5e-3 * (abs(energy[0]) + sim.kinetic_energy(t.x).max() + 1.0)
    if mech.contacts:
        assert t.contacts.gap.min() > -1e-7


@pytest.mark.sweep(4)
@pytest.mark.parametrize("name", NAMES)
def test_conservation_in_free_flight(name: str) -> None:
    """Momentum to rounding where nothing holds it, energy with a bounded error of second order."""
    mech = free(getattr(models, name)())
    error = []
    for h in (H, H / 2):
        sim = Simulator(mech, time_step=h, tolerance=1e-11)
        x = excited(sim, 2, 0.5)
        t = sim.rollout(
            sim.state_from_velocity(x[: sim.nq], x[sim.nq :]), np.zeros((round(0.5 / h), sim.nu)), throw=True
        )
        energy = sim.energy(t.x)
        error.append(np.abs(energy - energy[0]).max() / (abs(energy[0]) + 1e-3))
        if mech.joints[0].kind == "floating":
            for p in sim.momentum(t.x):
                np.testing.assert_allclose(p, np.tile(p[0], (len(p), 1)), atol=1e-9 * (1.0 + np.abs(p).max()))
    assert error[0] < 0.02
    assert error[1] < 0.35 * error[0] or error[1] < 3e-8  # closed loops to their tolerance


@pytest.mark.sweep(3)
@pytest.mark.parametrize("name", NAMES)
def test_gradients(name: str) -> None:
    """A and B against central differences of the step at the same kappa."""
    mech = getattr(models, name)()
    hard = mech.contacts or any(np.isfinite(j.limits).any() for j in mech.joints)
    sim = Simulator(mech, time_step=H, kappa=1e-3, tolerance=3e-13 if hard else 1e-12)
    x = excited(sim, 3, 0.3, 0.02)
    check_step(sim, x, 0.1 * np.random.default_rng(4).normal(size=sim.nu))
