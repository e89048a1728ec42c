"""Atlas: it can stand, its reference step is in balance, and gains that hold a plan hold it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import dojo_opt as dojo
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.feet import Feet


@pytest.fixture(scope="module")
def atlas():
    return dojo.Simulator(dojo.models.atlas(damper=5.0), time_step=0.05)


@pytest.mark.parametrize("kappa", [1e-6, 1e-4])
def test_equilibrium_on_rigid_feet(atlas, kappa):
    """Four balls under a rigid foot cannot float at any four heights; a step stays all the same."""
    sim = atlas.replace(kappa=kappa)
    x, u = dojo.equilibrium(sim)
    step = sim.step(x, u, throw=True)
    assert np.abs(step.x[sim.nq :]).max() < 1e-6


def balanced(sim, gait):
    """Asserts that the centre of mass is over the feet on the ground whenever one is in the air."""
    mass = np.array([body.mass for body in sim.mechanism.bodies])
    center = np.einsum("b,tbk->tk", mass / mass.sum(), sim.maximal(gait.x)[..., :2])
    swings = np.flatnonzero(~gait.contact.all(axis=1))
    assert len(swings)
    for t in swings:
        stance = gait.feet[t, gait.contact[t], :2]
        assert np.all(center[t] > stance.min(axis=0)) and np.all(center[t] < stance.max(axis=0))
    np.testing.assert_allclose(Feet(sim).positions(gait.x), gait.feet, atol=1e-7)


@pytest.mark.slow
def test_reference_step_is_in_balance(atlas):
    """The centre of mass goes over the other foot, and stays over it while one foot is in the air."""
    gait = dojo.gaits.step(atlas, length=0.15)
    balanced(atlas, gait)
    moved = gait.feet[-1] - gait.feet[0]
    np.testing.assert_allclose(moved[:4, 0], 0.15, atol=1e-12)
    np.testing.assert_allclose(moved[4:], 0.0, atol=1e-12)
    np.testing.assert_allclose(gait.x[-1, atlas.nq :], 0.0, atol=1e-6)


@pytest.mark.slow
def test_steps_in_a_row(atlas):
    """Left, right past it, left next to it: in balance, at rest between steps, and with velocities of its own path."""
    gait = None
    for foot, length in (("l_foot", 0.15), ("r_foot", 0.3), ("l_foot", 0.15)):
        gait = dojo.gaits.step(atlas, swinging=foot, length=length, lower=0.06, after=gait)
    balanced(atlas, gait)
    knots = (len(gait.x) - 1) // 3
    assert gait.x.shape == (3 * knots + 1, atlas.nx) and len(gait.feet) == len(gait.contact) == len(gait.time)
    np.testing.assert_allclose(np.diff(gait.time), 0.05, atol=1e-12)
    moved = gait.feet[::knots, :, 0] - gait.feet[0, :, 0]
    np.testing.assert_allclose(moved[:, 0], [0.0, 0.15, 0.15, 0.3], atol=1e-7)
    np.testing.assert_allclose(moved[:, 4], [0.0, 0.0, 0.3, 0.3], atol=1e-7)
    np.testing.assert_allclose(gait.x[knots::knots, atlas.nq :], 0.0, atol=1e-6)
    mean = atlas.difference(gait.x[1:], gait.x[:-1])[:, : atlas.nv] / atlas.time_step
    np.testing.assert_allclose(gait.x[1:, atlas.nq :], mean, atol=1e-4)


@pytest.mark.slow
def test_wrong_steps_are_named(atlas):
    with pytest.raises(ValueError, match=r"gaits\.step\(swinging=\.\.\.\): 'head' is not one of: l_foot, r_foot"):
        dojo.gaits.step(atlas, swinging="head")
    with pytest.raises(ValueError, match=r"gaits\.step\(quadruped\): expected two feet, got FR_calf"):
        dojo.gaits.step(dojo.Simulator(dojo.models.quadruped()))
    with pytest.raises(ValueError, match=r"gaits\.step\(swing=\.\.\.\)"):
        dojo.gaits.step(atlas, swing=0.0)
    with pytest.raises(TypeError, match=r"gaits\.step\(after=\.\.\.\): expected a Gait, got 3"):
        dojo.gaits.step(atlas, after=3)
    with pytest.raises(ValueError, match=r"expected a gait of 'atlas' with steps of 0\.05 s, got one of 'quadruped'"):
        dojo.gaits.step(atlas, after=dojo.gaits.stand(dojo.Simulator(dojo.models.quadruped())))
    with pytest.raises(ValueError, match=r"gaits\.step\(length=1, lower=0\.03\): .*'l_sole_\d' comes no nearer"):
        dojo.gaits.step(atlas, length=1.0)


def test_tracking_gains_agree_with_the_regulator():
    """Far from the end they solve the algebraic Riccati equation."""
    sim = dojo.Simulator(dojo.models.cartpole(), time_step=0.05, tolerance=1e-12)
    up = np.array([0.0, np.pi, 0.0, 0.0])
    cost = [Tracking(up, [1.0, 2.0, 0.1, 0.2]), Effort(0.5)]
    problem = dojo.Problem(sim, up, 200, cost=cost)
    plan = sim.rollout(up, np.zeros((200, 1)))
    K = dojo.tracking_gains(problem, plan)
    A, B = sim.linearize(up)
    Q, R = np.diag([1.0, 2.0, 0.1, 0.2]), np.array([[0.5]])
    P = solve_discrete_are(A, B, Q, R)
    np.testing.assert_allclose(K[0], -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A), rtol=1e-4)
    assert np.abs(np.linalg.eigvals(A + B @ K[0])).max() < 1.0


@pytest.mark.slow
def test_the_example_step_holds_at_a_fifth_of_the_time_step(atlas):
    """A shorter version of examples/atlas_step.py, under the plan's own gains and under gains from its costs alone."""
    gait = dojo.gaits.step(atlas, length=0.1)
    torques = gait.torques()
    weight = np.concatenate([np.full(3, 30.0), np.full(3, 10.0), np.full(30, 0.2), np.full(6, 0.01), np.full(30, 1e-3)])
    cost = [Tracking(gait.x, 0.05 * weight), Effort(0.05 * 1e-5, reference=torques)]
    goal = [dojo.constraint.Goal(gait.x[-1], components=np.arange(6))]
    problem = dojo.Problem(
        atlas, gait.x[0], len(torques), cost=cost, constraints=goal, controls0=torques, states0=gait.x
    )
    plan = dojo.ilqr(problem)
    assert plan.success, plan.message
    for K in (plan.K, dojo.tracking_gains(problem, plan)):
        replay = replace(plan, K=K).replay(time_step=0.01)
        assert replay.status == dojo.Status.SOLVED
        assert np.abs(Feet(atlas).positions(replay.x[-1]) - gait.feet[-1]).max() < 0.02
        assert 1.0 - 2.0 * (replay.x[:, 4] ** 2 + replay.x[:, 5] ** 2).max() > 0.99
