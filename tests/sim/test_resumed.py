"""Steps that begin with the impulses of the step before, and the law of a contact that sticks."""

import numpy as np
import pytest

import dojo_opt as dojo
from sim.contact.cone import condense_sliding, condense_sticking

B, KAPPA = 0.3, 1e-7  # mu gamma [N s], central path [N s m]
FRICTION = np.array([0.1, -0.2])


def condensed(condense, slip):
    """d(beta)/d(slip), d(beta)/d(mu gamma) and the residual, of one of the two forms."""
    z = np.array([1.0, 1.0, *FRICTION, *np.zeros(8)])
    k = np.array([0.0, *slip, *np.zeros(24)])
    W, q = np.full(9, np.nan), np.full(8, np.nan)
    condense(z, k, B, KAPPA, 1.0, W, q)
    return W[[4, 5, 7, 8]].reshape(2, 2), q[:2], q[2:4]


def slip_on_path():
    return -KAPPA * FRICTION / (B**2 - FRICTION @ FRICTION)


def test_both_forms_have_the_same_derivative_on_the_path():
    for ours, other in zip(
        condensed(condense_sticking, slip_on_path()), condensed(condense_sliding, slip_on_path()), strict=True
    ):
        np.testing.assert_allclose(ours, other, rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("times", [0.1, 3.0])
def test_the_slip_at_a_given_friction_takes_one_step(times):
    slip = times * slip_on_path()
    W, _, residual = condensed(condense_sticking, slip)
    np.testing.assert_allclose(slip + np.linalg.solve(W, residual), slip_on_path(), rtol=1e-9)


def test_a_motion_takes_fewer_iterations_than_its_steps_one_by_one():
    sim = dojo.Simulator(dojo.models.quadruped(contacts="all"), time_step=0.01)
    us = np.random.default_rng(5).uniform(-10.0, 10.0, (60, sim.nu))
    motion = sim.rollout(sim.neutral(), us, throw=True)
    steps = [sim.step(x, u, throw=True) for x, u in zip(motion.x[:-1], us, strict=True)]
    np.testing.assert_allclose([s.x for s in steps], motion.x[1:], atol=1e-6)
    assert sum(motion.iterations) < 0.93 * sum(s.iterations for s in steps)
