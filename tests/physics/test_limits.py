"""Joint limits are never passed, and do not bounce."""

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import pendulum, run, slider


@pytest.mark.parametrize("time_step", [1e-3, 1e-2, 5e-2])
def test_limit_of_a_falling_pendulum(time_step):
    sim = dojo.Simulator(pendulum(1, limits=(0.3, 2.0)), time_step=time_step, kappa=1e-8, tolerance=1e-10)
    theta = run(sim, np.array([1.5, 0.0]), round(2.0 / time_step))[:, 0]
    assert theta.min() > 0.3 - 1e-9 and theta[-1] < 0.3 + 1e-3


@pytest.mark.parametrize("speed", [-100.0, 100.0])
def test_limits_stop_a_fast_slider(speed):
    sim = dojo.Simulator(slider(limits=(-0.5, 0.5)), time_step=0.01, kappa=1e-8, tolerance=1e-10)
    xs = run(sim, np.array([0.0, speed]), 30)
    assert np.abs(xs[:, 0]).max() < 0.5 + 1e-9
    assert np.abs(xs[5:, 1]).max() < 1e-2, "no rebound"


def test_limits_in_a_chain_with_strong_inputs(rng):
    sim = dojo.Simulator(pendulum(3, limits=(-0.4, 0.4)), time_step=0.02, kappa=1e-6, tolerance=1e-9)
    trajectory = sim.rollout(np.zeros(6), 50.0 * rng.normal(size=(100, 3)))
    assert trajectory.status == 0
    assert np.abs(trajectory.x[:, :3]).max() < 0.4 + 1e-9


def test_static_load_on_a_limit():
    """At rest against a limit the slack is kappa over the impulse h u."""
    sim = dojo.Simulator(slider(damper=5.0, limits=(-0.5, 0.5)), time_step=0.01, kappa=1e-6, tolerance=1e-12)
    x = run(sim, np.array([0.4, 0.0]), 600, [3.0])[-1]
    np.testing.assert_allclose(0.5 - x[0], 1e-6 / 0.03, rtol=1e-4)
