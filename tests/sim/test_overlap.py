"""Starts in which bodies overlap are solved, not refused."""

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import block, run


def test_deep_overlap_at_the_start_is_solved():
    """A state below the ground is not an error: the step pushes it out."""
    sim = dojo.Simulator(block(), time_step=0.01)
    xs = run(sim, np.r_[0.0, 0.0, -0.5, 1.0, np.zeros(9)], 3)
    assert xs[1][2] > 0.25


def pair_of_boxes(distance, **settings):
    box = dojo.Box(0.4, 0.4, 0.4)
    bodies = [dojo.Body(n, 1.0, shape=box) for n in "ab"]
    joints = [dojo.Joint("floating", None, n) for n in "ab"]
    mech = dojo.Mechanism(bodies, joints, collisions=[dojo.Collision("a", "b")], gravity=(0, 0, 0))
    sim = dojo.Simulator(mech, time_step=0.01, **settings)
    x = sim.neutral()
    x[0] = distance
    return sim, x


@pytest.mark.parametrize("depth", [1e-3, 0.05, 0.2])
def test_a_start_in_overlap_is_moved_apart_in_the_first_step(depth):
    """As documented by Collision: at the speed of the overlap over the time step; momentum is kept."""
    sim, x = pair_of_boxes(0.4 - depth, kappa=1e-9)
    t = sim.rollout(x, np.zeros((3, 0)))
    assert t.success, t.message
    assert t.contacts.gap.min() > 0.0
    speeds = t.x[1, [sim.nq, sim.nq + 6]]
    np.testing.assert_allclose(speeds, np.array([0.5, -0.5]) * depth / 0.01, rtol=1e-2)
    np.testing.assert_allclose(sim.momentum(t.x)[0], 0.0, atol=1e-6)
