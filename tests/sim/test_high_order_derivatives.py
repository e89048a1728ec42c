"""Derivatives, policies and plans with steps of order 4 and 6."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from support.mechanisms import random_state
from support.smooth_mechanisms import branch


@pytest.mark.parametrize(
    "kind", ["floating", "spherical", "revolute", "cylindrical_free", "planar_axis", "prismatic", "fixed", "screw"]
)
@pytest.mark.parametrize("on_world", [True, False])
def test_derivatives_agree_with_central_differences(kind: str, on_world: bool) -> None:
    mech = branch(kind, on_world, damper=0.1)
    sim = dojo.Simulator(mech, time_step=0.05, order=4)
    x = sim.state_from_velocity(*random_state(np.random.default_rng(3), mech, speed=1.0))
    u = np.array([0.5, 0.3, -0.7])
    A, B = sim.linearize(x, u)

    def difference(dx: np.ndarray, du: np.ndarray) -> np.ndarray:
        ends = (sim.step(sim.integrate(x, s * dx), u + s * du, throw=True).x for s in (1e-5, -1e-5))
        return np.asarray(sim.difference(*ends)) / 2e-5

    for k, column in enumerate(np.eye(sim.ndx)):
        np.testing.assert_allclose(A[:, k], difference(column, 0.0 * u), atol=1e-8 * np.abs(A).max(), rtol=0)
    for k, column in enumerate(np.eye(sim.nu)):
        np.testing.assert_allclose(B[:, k], difference(np.zeros(sim.ndx), column), atol=1e-8, rtol=0)


def test_knots_of_several_steps_are_products_and_policies_follow_trajectories() -> None:
    mech = branch("spherical", False)
    sim = dojo.Simulator(mech, time_step=0.02, order=6)
    x0 = sim.state_from_velocity(*random_state(np.random.default_rng(3), mech, speed=1.0))
    us = np.random.default_rng(1).normal(size=(4, sim.nu))
    fine = sim.rollout(x0, np.repeat(us, 2, axis=0), throw=True).x
    line = sim.linearize_trajectory(fine[::2], us, substeps=2)
    np.testing.assert_allclose(line.x_next, fine[2::2], atol=1e-12)
    (A1, B1), (A2, B2) = (sim.linearize(x, us[0]) for x in fine[:2])
    np.testing.assert_allclose(line.A[0], A2 @ A1, atol=1e-10)
    np.testing.assert_allclose(line.B[0], A2 @ B1 + B2, atol=1e-10)
    xs, rolled = sim.linearize_rollout(x0, us[:2])
    np.testing.assert_allclose(xs, sim.rollout(x0, us[:2]).x, atol=1e-12)
    np.testing.assert_allclose(rolled.A[0], A1, atol=1e-10)
    Ks = np.random.default_rng(2).normal(size=(4, sim.nu, sim.ndx))
    shot = sim.rollout_feedback(x0, us, fine[::2], Ks=Ks, substeps=2)
    np.testing.assert_allclose(shot.x, fine[::2], atol=1e-10)
    dx = 1e-6 * np.random.default_rng(4).normal(size=sim.ndx)
    shot = sim.rollout_feedback(sim.integrate(x0, dx), us, fine[::2], Ks=Ks, substeps=2)
    np.testing.assert_allclose(sim.difference(shot.x[1], fine[2]), (line.A[0] + line.B[0] @ Ks[0]) @ dx, atol=1e-9)


def test_a_swing_up_is_planned() -> None:
    problem = dojo.problems.swingup("cartpole")
    costs, constraints = problem.specs
    sim = problem.sim.replace(order=4)
    plan = dojo.ilqr(
        dojo.Problem(
            sim, problem.start, problem.horizon, cost=costs, constraints=constraints, controls0=problem.controls0
        )
    )
    assert plan.success, plan.message
