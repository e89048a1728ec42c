"""Steps of higher order while bodies that may collide are apart, and of order 2 with joints that are too stiff."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from support.two_bodies import two

H = 0.02
BOX = dojo.Box(0.3, 0.2, 0.25)


def simulator(order: int, b: dojo.Shape = BOX, h: float = H, **settings: float) -> dojo.Simulator:
    return dojo.Simulator(
        two(dojo.Sphere(0.1), b), time_step=h, order=order, **{"kappa": 1e-12, "tolerance": 1e-10, **settings}
    )


def thrown(sim: dojo.Simulator, apart: float, speed: float = 1.0) -> np.ndarray:
    """Two tumbling bodies in free flight, the first above the second, coming closer."""
    q, v = sim.neutral()[: sim.nq].copy(), np.zeros(sim.nv)
    q[:3], q[7:10] = (0.03, -0.02, apart), 0.0
    v[:6], v[6:] = (0.1, 0.0, -speed, 0.3, 0.5, 0.1), (0.0, 0.1, 0.0, 1.0, -0.7, 2.0)
    return np.asarray(sim.state_from_velocity(q, v))


def near(sim: dojo.Simulator, x: np.ndarray, us: np.ndarray) -> np.ndarray:
    """Which steps are of order 2."""
    return np.asarray(sim._engine.march(x, us).near)


@pytest.mark.parametrize("b", [BOX, dojo.Sphere(0.15)], ids=["box", "ball"])
def test_bodies_fly_collide_and_part(b: dojo.Shape) -> None:
    """Momentum is kept throughout; before the impact the motion is that of bodies without collision."""
    sim, us = simulator(4, b), np.zeros((100, 0))
    free = dojo.Simulator(replace(sim.mechanism, collisions=()), time_step=H, order=4)
    x = thrown(sim, 0.8)
    t = sim.rollout(x, us, throw=True)
    order2 = near(sim, x, us)
    first = int(np.flatnonzero(order2)[0])
    assert 5 < first < 40 and not order2[-5:].any()
    np.testing.assert_allclose(t.x[: first + 1], free.rollout(x, us[:first], throw=True).x, atol=1e-12)
    momenta = np.array([np.hstack(sim.momentum(y)) for y in t.x])
    np.testing.assert_allclose(momenta, np.tile(momenta[0], (101, 1)), atol=1e-9)
    energies = np.array([np.sum(sim.energy(y)) for y in t.x])
    assert (np.diff(energies) < 1e-6 * energies[0]).all() and energies[-1] < 0.99 * energies[0]
    assert t.contacts.gap.min() > -1e-9 and not t.contacts.impulse[:first].any()


def test_contact_is_that_of_order_two() -> None:
    sim, second, us = simulator(4), simulator(2), np.zeros((100, 0))
    x = thrown(sim, 0.8)
    t = sim.rollout(x, us, throw=True)
    order2 = np.flatnonzero(near(sim, x, us))
    k, end = int(order2[0]), int(order2[-1]) + 1
    assert (np.diff(order2) == 1).all()
    s = second.rollout(second.state_from_velocity(t.x[k, : sim.nq], t.x[k, sim.nq :]), us[k:end], throw=True)
    np.testing.assert_allclose(t.x[k : end + 1, : sim.nq], s.x[:, : sim.nq], atol=1e-9)
    np.testing.assert_allclose(t.contacts.impulse[k:end], s.contacts.impulse, atol=1e-8)
    assert s.contacts.impulse.any()


def test_gaps_in_flight_are_those_of_the_shapes() -> None:
    sim, us = simulator(4, dojo.Sphere(0.15)), np.zeros((4, 0))
    x = thrown(sim, 0.8)
    t = sim.rollout(x, us, throw=True)
    z = np.array([sim.maximal(y) for y in t.x[1:]])
    distance = np.linalg.norm(z[:, 0, :3] - z[:, 1, :3], axis=1) - 0.25
    np.testing.assert_allclose(t.contacts.gap[:, 0], distance, atol=1e-12)
    assert not near(sim, x, us).any()


@pytest.mark.sweep(3)
@pytest.mark.parametrize("apart", [0.8, 0.32], ids=["flying", "landing"])
def test_derivatives_across_the_handover(apart: float) -> None:
    """Of three steps, against central differences."""
    sim = simulator(4, kappa=1e-10, tolerance=1e-9)
    x, u = thrown(sim, apart), np.zeros(0)
    us = np.tile(u, (3, 1))
    assert near(sim, x, us).any() == (apart < 0.5)
    line = sim.linearize_trajectory(x[None], u[None], substeps=3)
    assert not line.status.any()
    for k, column in enumerate(1e-6 * np.eye(sim.ndx)):
        ends = [sim.rollout(sim.integrate(x, s * column), us, throw=True).x[-1] for s in (1.0, -1.0)]
        np.testing.assert_allclose(line.A[0][:, k], sim.difference(*ends) / 2e-6, atol=2e-6 * np.abs(line.A[0]).max())


@pytest.mark.parametrize("field", ["spring", "damper"])
def test_joints_too_stiff_for_an_explicit_step_have_steps_of_order_two(field: str) -> None:
    """The motion is that of order 2, described as such."""
    joint = dojo.Joint("prismatic", None, "cart", axis=(1, 0, 0), **{field: 1e6})
    mech = dojo.Mechanism([dojo.Body("cart", 2.0, (0.1, 0.1, 0.1))], [joint], gravity=(0, 0, 0))
    sim, second = (dojo.Simulator(mech, time_step=0.01, order=order) for order in (4, 2))
    assert re.search(f"all steps are of order 2: joint .*: its {field} acts at", sim.describe())
    us = np.ones((50, sim.nu))
    t, s = (
        sim.rollout(sim.state_from_velocity([0.1], [0.1]), us, throw=True),
        second.rollout(second.state_from_velocity([0.1], [0.1]), us, throw=True),
    )
    np.testing.assert_allclose(t.x[:, 0], s.x[:, 0], atol=1e-10)
    np.testing.assert_allclose(t.x[:, 1], second.velocity(s.x)[:, 0], atol=1e-9)
    A, B = sim.linearize(t.x[3], us[0])
    up, down = (sim.step(t.x[3] + e * np.eye(2)[1], us[0], throw=True).x for e in (1e-6, -1e-6))
    np.testing.assert_allclose(A[:, 1], (up - down) / 2e-6, atol=1e-7)
