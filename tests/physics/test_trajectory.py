"""Jointed mechanisms follow their ordinary differential equations to second order."""

import numpy as np
from scipy.integrate import solve_ivp

import dojo_opt as dojo
from support.scenes import order, pendulum, run, slider


def test_double_pendulum():
    """Two thin rods, absolute angles a, b: Lagrange's equations solved by DOP853."""
    inertia, g = 1.0 / 12.0, 9.81

    def rates(_, y):
        a, b, da, db = y
        c, s = 0.5 * np.cos(a - b), 0.5 * np.sin(a - b)
        mass = np.array([[inertia + 0.25 + 1.0, c], [c, inertia + 0.25]])
        force = [-s * db**2 - 1.5 * g * np.sin(a), s * da**2 - 0.5 * g * np.sin(b)]
        return np.r_[da, db, np.linalg.solve(mass, force)]

    y = solve_ivp(rates, (0.0, 1.0), [1.0, 1.5, 0.5, -0.5], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    errors = []
    for h in (0.01, 0.005, 0.0025):
        sim = dojo.Simulator(pendulum(2), time_step=h, tolerance=1e-12)
        q = run(sim, sim.state_from_velocity(np.array([1.0, 0.5]), np.array([0.5, -1.0])), round(1.0 / h))[-1][:2]
        errors.append(np.linalg.norm(q - [y[0], y[1] - y[0]]))
    assert np.all(np.abs(order(errors) - 2.0) < 0.2), (errors, order(errors))


def test_damped_driven_slider():
    """m x'' = -k (x - x0) - d x' + u."""
    m, k, d, x0, u = 2.0, 30.0, 0.8, 0.1, 1.5

    def rates(_, y):
        return [y[1], (u - k * (y[0] - x0) - d * y[1]) / m]

    exact = solve_ivp(rates, (0.0, 1.0), [0.3, 1.0], "DOP853", rtol=1e-12, atol=1e-12).y[0, -1]
    errors = []
    for h in (0.01, 0.005, 0.0025):
        sim = dojo.Simulator(slider(mass=m, spring=k, damper=d, rest=x0), time_step=h, tolerance=1e-12)
        errors.append(
            abs(run(sim, sim.state_from_velocity(np.array([0.3]), np.array([1.0])), round(1.0 / h), [u])[-1][0] - exact)
        )
    # a damper acts with the velocity at the end of the step (stable at any strength): first order
    assert np.all(order(errors) > 0.8), (errors, order(errors))
