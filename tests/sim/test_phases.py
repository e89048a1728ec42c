"""Higher order in flight, order 2 in contact: laws across the handover, and derivatives through it."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.simulator.engines import phased_engine
from support.scenes import pendulum

H, KAPPA, TOLERANCE = 0.02, 1e-12, 1e-10
HOPPER = dojo.models.raiberthopper()


def simulator(order: int, mech: dojo.Mechanism = HOPPER, h: float = H, **settings: float) -> dojo.Simulator:
    return dojo.Simulator(mech, time_step=h, order=order, **{"kappa": KAPPA, "tolerance": TOLERANCE, **settings})


def thrown(sim: dojo.Simulator, height: float, up: float = 0.0) -> np.ndarray:
    """In flight: its foot so high above the ground, tumbling."""
    q, v = sim.neutral()[: sim.nq].copy(), np.zeros(sim.nv)
    q[2] += height
    v[:6] = 0.5, 0.1, up, 0.3, 0.5, 0.1
    return np.asarray(sim.state_from_velocity(q, v))


def inputs(sim: dojo.Simulator, steps: int) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(steps, sim.nu))


def near(sim: dojo.Simulator, x: np.ndarray, us: np.ndarray) -> np.ndarray:
    """Which steps are of order 2."""
    return np.asarray(sim._engine.march(x, us).near)


@pytest.mark.slow
def test_flight_has_the_higher_order_and_lands() -> None:
    """0.6 s of flight against order 8 with a tenth of the time step; it ends on the ground."""
    q = thrown(simulator(4), 1.0, 2.0)
    exact = simulator(8, replace(HOPPER, contacts=()), 2e-3).rollout(q, np.zeros((300, 3)), throw=True).x[-1]
    errors = []
    for h in (0.02, 0.01):
        sim = simulator(4, h=h)
        t = sim.rollout(q, np.zeros((round(1.5 / h), 3)), throw=True)
        order2 = near(sim, q, np.zeros((round(1.5 / h), 3)))
        assert not order2[: round(0.6 / h)].any() and order2[-round(0.3 / h) :].all()
        assert -1e-9 < t.contacts.gap[-1].min() < 1e-6
        errors.append(np.abs(sim.difference(t.x[round(0.6 / h)], exact)).max())
    second = simulator(2)
    x2 = second.rollout(second.state_from_velocity(q[: second.nq], q[second.nq :]), np.zeros((30, 3)), throw=True).x[-1]
    of_order_2 = np.abs(second.difference(np.r_[x2[: second.nq], second.velocity(x2)], exact)).max()
    assert errors[0] < 0.5 * of_order_2, (errors, of_order_2)  # which has a step half as long, and dampers of order 2
    assert errors[1] < errors[0] / 12.0


def test_momentum_and_energy_across_the_handover() -> None:
    """p+ - p = h (m g + f) + impulses of the ground, in every step; energy and angular momentum do not jump."""
    mech = dojo.models.block()
    sim, second = simulator(4, mech), simulator(2, mech)
    x, us = thrown(sim, 0.5), np.zeros((60, 3))
    us[40:, 2] = 20.0  # it leaves the ground again
    t = sim.rollout(x, us, throw=True)
    changes = np.diff(near(sim, x, us).astype(int))
    landing, leaving = (int(np.flatnonzero(changes == sign)[0]) + 1 for sign in (1, -1))
    assert 5 < landing < 40 < leaving
    p = np.array([sim.momentum(y)[0] for y in t.x])
    gained = np.diff(p, axis=0) - H * (us + np.array([0.0, 0.0, -9.81]))
    np.testing.assert_allclose(gained, t.contacts.impulse.sum(axis=1), atol=TOLERANCE)
    for x in t.x[[landing, leaving]]:
        mean = second.state_from_velocity(x[: sim.nq], x[sim.nq :])
        np.testing.assert_allclose(second.energy(mean), sim.energy(x), rtol=1e-12)
        np.testing.assert_allclose(np.hstack(second.momentum(mean)), np.hstack(sim.momentum(x)), atol=1e-12)


def test_contact_agrees_with_order_two() -> None:
    sim, second = simulator(4), simulator(2)
    x, us = thrown(sim, 0.15), np.zeros((60, 3))
    t = sim.rollout(x, us, throw=True)
    order2 = near(sim, x, us)
    k = int(np.flatnonzero(order2)[0])
    assert order2[k:].all() and len(us) - k > 20
    s = second.rollout(second.state_from_velocity(t.x[k, : sim.nq], t.x[k, sim.nq :]), us[k:], throw=True)
    np.testing.assert_allclose(t.x[k:, : sim.nq], s.x[:, : sim.nq], atol=1e-9)
    np.testing.assert_allclose(t.x[k:, sim.nq :], second.velocity(s.x), atol=1e-7)
    np.testing.assert_allclose(t.contacts.impulse[k:], s.contacts.impulse, atol=1e-8)


def test_all_calls_take_the_same_steps_in_flight() -> None:
    """Single steps, batches, policies, knots and copies take the same steps."""
    sim = simulator(4)
    x, us = thrown(sim, 0.1), inputs(sim, 12)
    t = sim.rollout(x, us, throw=True)
    one = x
    for u in us:
        one = sim.step(one, u, throw=True).x
    np.testing.assert_allclose(one, t.x[-1], atol=1e-7)
    np.testing.assert_array_equal(sim.rollout_batch(x[None], us[None]).x[0], t.x)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(sim)).rollout(x, us).x, t.x)
    np.testing.assert_allclose(sim.rollout_feedback(x, us).x, t.x, atol=1e-7)
    assert set(sim.inactive_contacts(t.x[0])) == set(sim.mechanism.contact_names)
    assert "foot" not in sim.inactive_contacts(t.x[-1])
    foot = next(c for c in sim.mechanism.contacts if c.name == "foot")
    clear = foot.gap(sim.maximal(t.x[1])[sim.mechanism.body_names.index("foot"), :3])
    np.testing.assert_allclose(t.contacts.gap[0].min(), clear, atol=1e-12)
    assert not t.contacts.impulse[0].any()


@pytest.mark.sweep(3)
@pytest.mark.parametrize(
    ("height", "up"), [(1.0, 0.0), (0.08, -1.0), (0.03, -1.0)], ids=["flying", "handover", "landing"]
)
def test_derivatives_through_the_handover(height: float, up: float) -> None:
    """Of three steps, against central differences."""
    sim = simulator(4, kappa=1e-9, tolerance=1e-9)
    x, us = thrown(sim, height, up), inputs(sim, 3)
    expected = {1.0: 0, 0.08: 1, 0.03: 2}[height]
    assert near(sim, x, us).sum() >= expected
    A, B = derivatives_of_knot(sim, x, us[0], 3)

    def end(dx: np.ndarray, du: np.ndarray) -> np.ndarray:
        return np.asarray(sim.rollout(sim.integrate(x, dx), np.tile(us[0] + du, (3, 1)), throw=True).x[-1])

    check(sim, A, B, end)


def derivatives_of_knot(sim: dojo.Simulator, x: np.ndarray, u: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    line = sim.linearize_trajectory(x[None], u[None], substeps=steps)
    assert not line.status.any()
    return line.A[0], line.B[0]


def check(sim: dojo.Simulator, A: np.ndarray, B: np.ndarray, end) -> None:  # type: ignore[no-untyped-def]
    size, eps = np.abs(A).max(), 1e-6
    for k, column in enumerate(eps * np.eye(sim.ndx)):
        found = sim.difference(end(column, np.zeros(sim.nu)), end(-column, np.zeros(sim.nu))) / (2.0 * eps)
        np.testing.assert_allclose(A[:, k], found, atol=1e-6 * size, rtol=0)
    for k, column in enumerate(eps * np.eye(sim.nu)):
        found = sim.difference(end(np.zeros(sim.ndx), column), end(np.zeros(sim.ndx), -column)) / (2.0 * eps)
        np.testing.assert_allclose(B[:, k], found, atol=1e-6 * size, rtol=0)


@pytest.mark.parametrize("spring", [0.0, 30.0])
def test_derivatives_in_contact_agree_with_order_two_in_other_coordinates(spring: float) -> None:
    """Smooth contact is never far: order 2 throughout; springs of all joints, one of them a ball joint's."""
    mech = dojo.models.raiberthopper(spring=spring)
    ball = dojo.Body("tail", 0.3, (2e-3, 3e-3, 4e-3))
    joint = dojo.Joint(
        "spherical", "body", "tail", parent_point=(0.1, 0.0, 0.1), child_point=(0.0, 0.1, 0.2), spring=spring
    )
    mech = replace(mech, bodies=[*mech.bodies, ball], joints=[*mech.joints, joint], neutral=None)
    sim = simulator(4, mech, kappa=1e-4, tolerance=1e-13)
    x = thrown(sim, 0.02, -1.0)
    us = inputs(sim, 3)
    assert near(sim, x, us).all()
    A, B = sim.linearize(x, us[0])
    check(sim, A, B, lambda dx, du: sim.step(sim.integrate(x, dx), us[0] + du, throw=True).x)


def test_gradients_of_rollouts() -> None:
    sim = simulator(4)
    x, us = thrown(sim, 0.1), inputs(sim, 10)
    xs, line = sim.linearize_rollout(x, us)
    loss = np.random.default_rng(1).normal(size=(11, sim.ndx))
    costate, by_input = loss[-1], np.zeros_like(us)
    for t in range(9, -1, -1):
        by_input[t], costate = line.B[t].T @ costate, line.A[t].T @ costate + loss[t]
    found = sim.vjp((xs, us), loss)
    np.testing.assert_allclose(found["state"], costate, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found["input"], by_input, rtol=1e-9, atol=1e-9)


def test_limits_are_met_and_left() -> None:
    """A pendulum swings freely at order 4, and bounces off its stop at order 2; nothing passes it."""
    mech = pendulum(1, limits=(-0.6, 3.0))
    sim = simulator(4, mech, h=0.01)
    x, us = sim.state_from_velocity([1.0], [0.0]), np.zeros((300, sim.nu))
    t = sim.rollout(x, us, throw=True)
    order2 = near(sim, x, us)
    assert order2.any() and not order2.all()
    assert t.x[:, 0].min() > -0.6
    first = int(np.flatnonzero(order2)[0])
    assert np.abs(sim.energy(t.x[: first + 1]) - sim.energy(x)).max() < 1e-6


def test_a_step_that_fails_says_so() -> None:
    sim = simulator(4, max_iterations=1)
    t = sim.rollout(thrown(sim, 0.05), np.zeros((40, 3)))
    assert not t.success and 0 < t.solved_steps < 40
    assert f"step {t.solved_steps}" in t.message and t.status == dojo.Status.MAX_ITERATIONS
    assert len(t.x) == t.solved_steps + 1 and np.isfinite(t.x).all()


def test_steps_of_both_orders_are_one_call_of_a_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = simulator(4)
    x, us = thrown(sim, 0.1), np.zeros((30, 3))
    sim.rollout(x, us)
    calls: list[int] = []
    kernel = phased_engine.roll_phases
    monkeypatch.setattr(phased_engine, "roll_phases", lambda *arguments: calls.append(0) or kernel(*arguments))
    order2 = near(sim, x, us)
    assert len(calls) == 1 and order2.any() and not order2.all()


def test_a_step_that_has_no_mean_velocity_says_so() -> None:
    """At the ground, and so fast that poses an interval apart cannot tell how far it turns."""
    sim = simulator(4, dojo.models.block(), divide=False)
    x = sim.neutral()
    x[sim.nq + 3 :] = 0.0, 0.0, 200.0
    step = sim.step(x)
    assert step.status == dojo.Status.TURN_TOO_LARGE and not step.success
    np.testing.assert_array_equal(step.x, x)


def test_a_hopper_that_pushes_off_is_exact_with_an_accuracy_only() -> None:
    """Steps of order 2 among those of higher order take the impulse of inputs at their beginning (limitations.md)."""
    hopper, pushes = dojo.models.raiberthopper(), np.array([0.0, 0.0, 60.0])

    def height(time_step: float, **settings: float) -> float:
        sim = dojo.Simulator(hopper, time_step, **settings)
        x, steps = sim.neutral(), round(0.4 / time_step)
        x[2] += 0.03
        path = sim.rollout(x, np.tile(pushes, (steps, 1)))
        assert path.success
        return float(path.x[-1, 2])

    exact = height(0.01, accuracy=1e-3)
    fine, plain, high, half = height(2e-4), height(0.01), height(0.01, order=4), height(0.005, order=4)
    assert abs(exact - fine) < 3e-4
    assert abs(high - exact) > 2.0 * abs(plain - exact) and 1.8 < (high - exact) / (half - exact) < 2.2
