"""Springs keep their amplitude at any stiffness, dampers are stable at any strength."""

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import pendulum, run, slider


@pytest.mark.parametrize("time_step", [1e-3, 1e-2])
@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e6, 1e8])
def test_amplitude_is_kept(stiffness, time_step):
    """sqrt(2 E / k) after a second is the starting deflection."""
    sim = dojo.Simulator(slider(spring=stiffness), time_step=time_step, tolerance=1e-9)
    xs = run(sim, sim.state_from_velocity(np.array([0.1]), np.zeros(1)), round(1.0 / time_step))
    amplitude = np.sqrt(2.0 * sim.energy(xs) / stiffness)
    np.testing.assert_allclose(amplitude, 0.1, rtol=1e-6)
    assert np.abs(xs[:, 0]).max() < 0.1 * (1.0 + 1e-6)


@pytest.mark.parametrize("damper", [1.0, 1e2, 1e4, 1e6])
def test_damper_follows_its_recursion(damper):
    """v+ = v (6 - 2 z + z^2)/(6 + 4 z + 2 z^2 + z^3), z = h d / m: monotone, and stable for any d."""
    sim = dojo.Simulator(slider(mass=2.0, damper=damper), time_step=0.02, tolerance=1e-12)
    v = run(sim, np.array([0.0, 3.0]), 20)[:, 1]
    z = 0.02 * damper / 2.0
    slower = (6.0 + 4.0 * z + 2.0 * z**2 + z**3) / (6.0 - 2.0 * z + z**2)
    np.testing.assert_allclose(v, 3.0 / slower ** np.arange(21.0), rtol=1e-8, atol=1e-12)


def test_strong_damper_in_a_chain():
    sim = dojo.Simulator(pendulum(3, damper=1e6), time_step=0.02)
    xs = run(sim, np.r_[1.0, 0.5, -0.5, 5.0, -5.0, 5.0], 50)
    assert np.abs(xs[-1, 3:]).max() < 1e-4
    np.testing.assert_allclose(xs[-1, :3], xs[1, :3], atol=1e-3)


def test_stiff_rotational_spring_keeps_energy():
    sim = dojo.Simulator(pendulum(2, spring=1e6), time_step=0.01, tolerance=1e-9)
    energy = sim.energy(run(sim, sim.state_from_velocity(np.array([0.01, -0.02]), np.zeros(2)), 200))
    assert np.ptp(energy) < 0.05 * 0.5e6 * 0.02**2


def test_rest_position_of_a_spring():
    """Static balance k (x - rest) = u, reached with a damper."""
    sim = dojo.Simulator(slider(spring=50.0, damper=20.0, rest=0.2), time_step=0.05)
    x = run(sim, np.zeros(2), 400, [5.0])[-1]
    np.testing.assert_allclose(x, [0.3, 0.0], atol=1e-8)
