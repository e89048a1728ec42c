"""A rollout hands its configurations on from step to step: the same motion as steps that each begin anew."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism


def ball_chain() -> Mechanism:
    """A floating body, a ball joint with a spring, and a joint with two rotations: all kinds of columns."""
    bodies = [Body(f"b{k}", 1.0 + k, (0.1, 0.2, 0.25)) for k in range(4)]
    joints = [
        Joint("floating", None, "b0"),
        Joint("spherical", "b0", "b1", parent_point=(0.5, 0, 0), child_point=(-0.4, 0, 0), spring=3.0, damper=0.1),
        Joint("orbital", "b1", "b2", parent_point=(0.4, 0, 0), child_point=(0, 0.3, 0)),
        Joint("cylindrical", "b2", "b3", parent_point=(0, 0.2, 0), axis=(0, 0.6, 0.8)),
    ]
    return Mechanism(bodies, joints)


@pytest.mark.parametrize("mechanism", [ball_chain(), dojo.models.raiberthopper(), dojo.models.npendulum(3)])
def test_a_rollout_is_its_steps(mechanism: Mechanism) -> None:
    sim = dojo.Simulator(mechanism, time_step=0.02, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(2).normal(size=sim.nv)
    us = 0.1 * np.random.default_rng(3).normal(size=(25, sim.nu))
    t = sim.rollout(x, us)
    assert t.success, t.message
    for k in range(25):
        x = sim.step(x, us[k]).x
        np.testing.assert_allclose(t.x[k + 1], x, atol=2e-9)
    A, B = sim.linearize(t.x[9], us[9])
    line = sim.linearize_trajectory(t.x, us)
    np.testing.assert_allclose(line.A[9], A, atol=1e-6)
    np.testing.assert_allclose(line.B[9], B, atol=1e-6)
