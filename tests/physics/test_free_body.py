"""A free spinning body follows Euler's equations to second order."""

import numpy as np
import pytest
from naive import rotation as rot
from scipy.integrate import solve_ivp

import dojo_opt as dojo
from support.scenes import free_body, order, run

INERTIA = np.array([0.1, 0.2, 0.3])


def euler(seconds, omega):
    """Attitude by DOP853."""

    def rates(_, y):
        return np.r_[0.5 * rot.mul(y[:4], np.r_[0.0, y[4:]]), np.cross(INERTIA * y[4:], y[4:]) / INERTIA]

    out = solve_ivp(rates, (0.0, seconds), np.r_[1.0, 0.0, 0.0, 0.0, omega], "DOP853", rtol=1e-12, atol=1e-13)
    return out.y[:4, -1]


@pytest.mark.parametrize("omega", [(2.0, 3.0, -2.0), (0.01, 5.0, 0.01), (8.0, 1.0, 8.0)])
def test_attitude_error_is_of_second_order(omega):
    exact, errors = euler(2.0, np.array(omega)), []
    for h in (0.01, 0.005, 0.0025):
        sim = dojo.Simulator(free_body(INERTIA), time_step=h, tolerance=1e-12)
        x = sim.state_from_velocity(sim.neutral()[:7], np.r_[0.0, 0.0, 0.0, omega])
        attitude = run(sim, x, round(2.0 / h))[-1][3:7]
        errors.append(np.linalg.norm(rot.log(rot.mul(rot.conj(exact), attitude))))
    assert np.all(np.abs(order(errors) - 2.0) < 0.2), (errors, order(errors))


def test_rotation_about_a_principal_axis_is_uniform_and_exact_to_fourth_order():
    """The blended energy: momentum J omega at rate omega (1 + 7/15 (h omega/2)^4 + ...)."""
    errors = []
    for h in (0.1, 0.05, 0.025):
        sim = dojo.Simulator(free_body(INERTIA), time_step=h, tolerance=1e-12)
        x = sim.state_from_velocity(sim.neutral()[:7], np.array([0.0, 0.0, 0.0, 0.0, 0.0, 7.0]))
        v = run(sim, x, 50)[:, 7:]
        np.testing.assert_allclose(v, np.tile(v[0], (51, 1)), atol=1e-9)
        errors.append(1.0 - v[0, 5] / 7.0)
    np.testing.assert_allclose(errors[2], 7.0 / 15.0 * (0.025 * 7.0 / 2.0) ** 4, rtol=0.05)
    assert np.all(np.abs(order(errors) - 4.0) < 0.3), (errors, order(errors))


def test_fast_spin_keeps_energy():
    """1000 rad/s, a sixth of a turn per step of 1 ms: peers lose half the energy or diverge."""
    sim = dojo.Simulator(free_body(INERTIA), time_step=1e-3, tolerance=1e-12)
    x = sim.state_from_velocity(sim.neutral()[:7], np.array([0.0, 0.0, 0.0, 2.0, 1000.0, 2.0]))
    values = sim.energy(run(sim, x, 1000)[::10])
    assert np.ptp(values) < 0.1 * values[0]
