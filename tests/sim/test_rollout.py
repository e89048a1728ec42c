"""Steps, rollouts, batches and their derivatives agree with one another."""

from __future__ import annotations

import numpy as np
import pytest

from dojo_opt import models
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.status import Status
from support.scenes import block
from support.two_bodies import SHAPES, approaching, two

PENDULUM = Simulator(models.double_pendulum(), time_step=0.01)


def above(mech: Mechanism, height: float) -> tuple[Simulator, np.ndarray, float]:
    """A robot so high above where it stands."""
    sim = Simulator(mech, time_step=0.01)
    x = sim.neutral()
    x[2] += height
    return sim, x, height


def test_step_and_rollout_agree() -> None:
    x0, us = np.array([1.0, -0.5, 0.2, 0.1]), np.full((5, 2), 0.3)
    t = PENDULUM.rollout(x0, us)
    assert t.success and t.solved_steps == 5 and t.x.shape == (6, 4) and t.u.shape == (5, 2)
    np.testing.assert_allclose(t.time, 0.01 * np.arange(6))
    x = x0
    for expected in t.x[1:]:
        r = PENDULUM.step(x, us[0])
        assert r.success and r.status == Status.SOLVED
        np.testing.assert_allclose(r.x, expected, rtol=0, atol=1e-8)  # a rollout passes on errors within the tolerance
        x = r.x
    assert t.contacts.impulse.shape == (5, 0, 3) and t.contacts.normal_force.shape == (5, 0)


def test_rollout_of_no_steps() -> None:
    t = PENDULUM.rollout(np.zeros(4), np.zeros((0, 2)))
    assert t.success and t.x.shape == (1, 4) and t.solved_steps == 0


def test_unsolved_step_is_not_used() -> None:
    sim = PENDULUM.replace(max_iterations=1, tolerance=1e-15)
    x0 = np.array([1.0, -0.5, 3.0, 8.0])
    r = sim.step(x0)
    assert not r.success and r.status == Status.MAX_ITERATIONS
    np.testing.assert_array_equal(r.x, x0)
    t = sim.rollout(x0, np.zeros((3, 2)))
    assert (t.solved_steps, len(t.x), len(t.u), len(t.contacts.gap)) == (0, 1, 0, 0)
    assert t.message.startswith("Simulator.rollout: step 0: The iteration limit") and "Residual" in t.message
    with pytest.raises(RuntimeError, match=r"Simulator.rollout: step 0: The iteration limit"):
        sim.rollout(x0, np.zeros((3, 2)), throw=True)
    with pytest.raises(RuntimeError, match=r"Simulator.step: The iteration limit"):
        sim.step(x0, throw=True)


def test_batch_equals_single_rollouts() -> None:
    rng = np.random.default_rng(0)
    x0s, us = rng.normal(size=(6, 4)), rng.normal(size=(6, 5, 2))
    batch = PENDULUM.rollout_batch(x0s, us)
    assert np.all(batch.status == 0) and np.all(batch.solved_steps == 5)
    for k in range(6):
        np.testing.assert_array_equal(batch.x[k], PENDULUM.rollout(x0s[k], us[k]).x)


COLLISION = Simulator(two(SHAPES["box"], SHAPES["capsule"]), time_step=0.01)
ALONE = {  # simulator, where a motion starts, and how far above the start of another one
    "thrown": above(models.quadruped(contacts="all"), 0.0),
    "dropped": above(models.quadruped(contacts="all"), 0.5),
    "limited": above(models.raiberthopper(limits=(0.2, 0.8)), 0.1),
    "pyramids": above(block(law="linear"), 0.5),
    "collision": (COLLISION, approaching(COLLISION, 2, 1.0), 0.1),
}


@pytest.mark.parametrize("name", ALONE)
def test_a_rollout_does_not_depend_on_the_one_before(name: str) -> None:
    """To the last bit, iterations too: contacts that come near begin with impulses of this motion."""
    sim, x, height = ALONE[name]
    us, others = np.random.default_rng(3).uniform(-10.0, 10.0, (2, 60, sim.nu))
    first = sim.rollout(x, us, throw=True)
    lower = x.copy()
    lower[2] -= height
    sim.rollout(lower, others)
    again, fresh = sim.rollout(x, us, throw=True), sim.replace().rollout(x, us, throw=True)
    assert np.abs(first.contacts.impulse).max() > 1e-2
    for t in (again, fresh):
        np.testing.assert_array_equal(t.x, first.x)
        np.testing.assert_array_equal(t.iterations, first.iterations)


def test_linearize_against_differences() -> None:
    x, u = np.array([1.0, -0.5, 2.0, -1.0]), np.array([0.3, -0.2])
    A, B = PENDULUM.replace(tolerance=1e-12).linearize(x, u)
    e = 1e-6
    for k, d in enumerate(e * np.eye(4)):
        np.testing.assert_allclose(
            A[:, k], (PENDULUM.step(x + d, u).x - PENDULUM.step(x - d, u).x) / (2 * e), atol=1e-6
        )
    for k, d in enumerate(e * np.eye(2)):
        np.testing.assert_allclose(
            B[:, k], (PENDULUM.step(x, u + d).x - PENDULUM.step(x, u - d).x) / (2 * e), atol=1e-6
        )
    knots = PENDULUM.linearize_trajectory([x] * 3, [u] * 2, substeps=2)
    A2, B2 = PENDULUM.linearize(PENDULUM.step(x, u).x, u)
    np.testing.assert_allclose(knots.A[1], A2 @ A, atol=1e-7)
    np.testing.assert_allclose(knots.B[1], A2 @ B + B2, atol=1e-7)
    np.testing.assert_array_equal(knots.x_next[0], PENDULUM.rollout(x, [u] * 2).x[-1])


def test_closed_loop_follows_its_policy() -> None:
    rng = np.random.default_rng(3)
    x0, us, xs = rng.normal(size=4), rng.normal(size=(3, 2)), rng.normal(size=(4, 4))
    ks, Ks, gaps = rng.normal(size=(3, 2)), rng.normal(size=(3, 2, 4)), rng.normal(size=(4, 4))
    shot = PENDULUM.rollout_feedback(
        x0, us, xs, ks=ks, Ks=Ks, gaps=gaps, alpha=0.25, limits=(-1.0, [0.5, np.inf]), substeps=2
    )
    x = x0
    for t in range(3):
        u = np.clip(us[t] + 0.25 * ks[t] + Ks[t] @ (x - xs[t]), -1.0, [0.5, np.inf])
        np.testing.assert_allclose(shot.u[t], u, rtol=1e-12)
        x = PENDULUM.rollout(x, [u, u]).x[-1] - 0.75 * gaps[t + 1]
        np.testing.assert_allclose(shot.x[t + 1], x, atol=1e-12)
    assert (shot.status, shot.solved_knots) == (Status.SOLVED, 3)
    # under a policy, the guess for the next velocity is the policy's velocity: equal to the tolerance of a step
    np.testing.assert_allclose(PENDULUM.rollout_feedback(x0, us).x, PENDULUM.rollout(x0, us).x, atol=1e-7)
