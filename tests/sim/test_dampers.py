"""Dampers: of second order where they are not stiff, stable where they are, and never a source of energy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import dojo_opt as dojo
from dojo_opt.report.accuracy.reference import TreeReference
from sim.dynamics.joints.damper import damper_impulse, damper_lag, lag_rates, node_damping
from support.jacobians import check_jacobian
from support.scenes import chain, pendulum, slider

Floats = NDArray[np.float64]
STIFFNESS = (1e-2, 1.0, 1e2, 1e4)


def thrown(mech: dojo.Mechanism, h: float, seconds: float) -> Floats:
    """Error of a motion over the seconds: of coordinates at its end, and of velocities at the node there."""
    rng = np.random.default_rng(7)
    sim = dojo.Simulator(mech, time_step=h, tolerance=1e-12)
    q, v = sim.neutral()[: sim.nq], rng.normal(size=sim.nv)
    found = sim.rollout(sim.state_from_velocity(q, v), steps=round(seconds / h), throw=True).x[-1]
    exact_q, exact_v = (end[-1] for end in TreeReference(sim.model).run(q, v, np.array([0.0, seconds])))
    moved = sim.difference(np.r_[exact_q, 0.0 * v], np.r_[found[: sim.nq], 0.0 * v])[: sim.nv]
    return np.array([np.abs(moved).max(), np.abs(sim.velocity(found) - exact_v).max()])


@pytest.mark.parametrize(
    "mech",
    [pendulum(2, damper=0.3, spring=2.0), chain("spherical", 1, damper=0.2), chain("cylindrical", 1, damper=0.2)],
    ids=["hinges and springs", "ball in space", "cylinder in space"],
)
def test_second_order(mech: dojo.Mechanism) -> None:
    """A quarter of the error at half the step, where a damper on the velocity at the end leaves half of it."""
    coarse, fine = thrown(mech, 0.01, 0.4), thrown(mech, 0.005, 0.4)
    assert np.all(fine > 1e-8)
    assert np.all(np.log2(coarse / fine) > 1.8), (coarse, fine)


@pytest.mark.parametrize("damper", [1e-1, 1e1, 1e3, 1e5])
def test_it_stops_after_its_momentum_over_the_damper(damper: float) -> None:
    sim = dojo.Simulator(slider(mass=2.0, damper=damper), time_step=0.05, tolerance=1e-13)
    steps = 100 + round(80.0 / (0.05 * damper))
    xs = sim.rollout(sim.state_from_velocity(np.zeros(1), np.array([3.0])), steps=steps, throw=True).x
    np.testing.assert_allclose(xs[-1, 0], 2.0 * 3.0 / damper, rtol=1e-6)
    assert np.diff(xs[:, 0]).min() >= -1e-12


@pytest.mark.slow
def test_properties_of_the_weights() -> None:
    """0 <= lag <= h d/2; the impulse does no work but on a rotor h d/2 - lag; rates against differences."""
    model, rng = dojo.Simulator(slider(), time_step=0.01).model, np.random.default_rng(1)

    def lag(d: float, seen: float) -> float:
        model.dof_damper[0], model.dof_seen[0] = d, seen
        return float(damper_lag(model, 0.01, 0))

    for z in 10.0 ** rng.uniform(-6.0, 12.0, size=200):
        seen, (v, nu) = 10.0 ** rng.uniform(-6.0, 6.0), rng.normal(size=2)
        d = z * seen / 0.01
        size, impulse = lag(d, seen), damper_impulse(model, 0.01, 0, nu, v)
        rotor = 0.5 * 0.01 * d - size
        assert 0.0 <= size <= 0.5 * 0.01 * d * (1.0 + 1e-15)
        momentum = (seen - size) / seen * (seen + node_damping(model, 0.01, 0))
        np.testing.assert_allclose(momentum, seen, rtol=1e-12)  # of the node: of a body with nothing but the damper
        work = 0.5 * impulse * (v + nu) + 0.5 * rotor * (v * v - nu * nu)
        np.testing.assert_allclose(work, 0.25 * 0.01 * d * (v + nu) ** 2, rtol=1e-9, atol=1e-12 * 0.01 * d)
        by_damper, by_seen = lag_rates(model, 0.01, 0)
        few = (lag(d * 1.0001, seen) - lag(d * 0.9999, seen)) / (0.0002 * d * 0.01)
        assert abs(by_damper - few) < 1e-6 * (1.0 + abs(few))
        few = (lag(d, seen * 1.0001) - lag(d, seen * 0.9999)) / (0.0002 * seen)
        assert abs(by_seen + few) < 1e-6 * (1.0 + abs(few))


@pytest.mark.parametrize("kind", ["revolute", "spherical", "orbital"])
def test_no_energy_in_passive_motion(kind: str) -> None:
    """Chains in space: energy falls, momentum stays."""
    rng = np.random.default_rng(2)
    for h in (0.005, 0.05):
        for strength in STIFFNESS:
            sim = dojo.Simulator(chain(kind, 2, damper=strength), time_step=h, tolerance=1e-12)
            x = sim.state_from_velocity(sim.neutral()[: sim.nq], rng.normal(size=sim.nv))
            xs = sim.rollout(x, steps=40, throw=True).x
            energy = sim.kinetic_energy(xs)
            assert np.diff(energy).max() < 1e-4 * energy[0], (h, strength)
            for momentum in sim.momentum(xs):
                np.testing.assert_allclose(momentum, np.tile(momentum[0], (len(xs), 1)), atol=1e-10)


@pytest.mark.sweep(3)
@pytest.mark.parametrize("strength", STIFFNESS)
def test_derivatives_from_loose_to_stiff(strength: float) -> None:
    """By state, input and all that the weights depend on: dampers, masses, geometry, the time step."""
    rng = np.random.default_rng(3)
    mech = chain("screw", 2, gravity=(0.0, 0.0, -9.81), base=None, damper=strength, spring=3.0)
    sim = dojo.Simulator(mech, time_step=0.02, tolerance=1e-13)
    x = sim.integrate(sim.neutral(), np.r_[0.3 * rng.normal(size=sim.nv), rng.normal(size=sim.nv)])
    u = rng.normal(size=sim.nu)
    names = ("damper", "mass", "inertia", "com", "child_point", "orientation", "axis", "pitch", "time_step")
    blocks, here = sim.linearize(x, u, wrt=("state", "input", *names)), sim.step(x, u, throw=True).x

    def moved(values: dict[str, Floats]) -> Floats:
        return np.asarray(sim.difference(sim.with_parameters(values).step(x, u, throw=True).x, here))

    check_jacobian(
        lambda y: np.asarray(sim.difference(sim.step(y, u, throw=True).x, here)), blocks["state"], x, sim.integrate
    )
    for name in names:
        values = sim.parameters((name,)).values
        direction = rng.uniform(0.5, 1.0, size=len(values)) * np.maximum(np.abs(values), 0.1)
        rate, size = blocks[name] @ direction, 1e-3
        a, b, c, d = (moved({name: values + k * size * direction}) for k in (-2, -1, 1, 2))
        slope = (a - 8.0 * b + 8.0 * c - d) / (12.0 * size)
        assert np.abs(slope - rate).max() < 1e-6 * np.abs(rate).max() + 1e-10, name
