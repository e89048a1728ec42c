"""Energy of a conservative mechanism: its error is of second order in the time step and does not grow."""

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import chain, free_body, order, pendulum, random_state, run, slider

MECHANISMS = {
    "pendulum": (pendulum(1), [1.0], [0.5]),
    "double pendulum": (pendulum(2), [1.0, 0.5], [0.5, -1.0]),
    "spring pendulum": (pendulum(2, spring=5.0), [1.0, 0.5], [0.5, -1.0]),
}


def energies(mech, q, v, h, seconds):
    """Energy at every node."""
    sim = dojo.Simulator(mech, time_step=h, tolerance=1e-12)
    xs = run(sim, sim.state_from_velocity(np.array(q), np.array(v)), round(seconds / h))
    return sim.energy(xs)


@pytest.mark.parametrize("name", MECHANISMS)
def test_error_is_of_second_order(name):
    errors = [np.ptp(energies(*MECHANISMS[name], h, 2.0)) for h in (0.02, 0.01, 0.005)]
    assert np.all(order(errors) > 1.9), (errors, order(errors))


def test_start_has_the_energy_of_its_velocity():
    """M(q) v is the momentum of the state that start gives, so its energy is the continuous one exactly."""
    v, mech = np.array([0.5]), pendulum(1)
    sim = dojo.Simulator(mech, time_step=0.05)
    x = sim.state_from_velocity(np.array([1.0]), v)
    inertia = np.asarray(mech.bodies[0].inertia)[0][0] + 0.25
    assert abs(sim.energy(x) - (0.5 * inertia * 0.25 - 9.81 * 0.5 * np.cos(1.0))) < 1e-10


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "spherical", "planar_axis", "cylindrical_free", "screw"])
def test_error_is_of_second_order_for_floating_chains(kind, rng):
    mech, errors = chain(kind, 2, spring=4.0), []
    state = random_state(dojo.Simulator(mech, time_step=0.01), rng, spread=0.3)
    for h in (0.01, 0.005):
        nq = dojo.Simulator(mech, time_step=h).nq
        errors.append(np.ptp(energies(mech, state[:nq], state[nq:], h, 0.5)))
    assert 1.8 < order(errors)[0] < 2.4, errors


def test_linear_spring_keeps_its_energy_exactly():
    """The midpoint rule conserves quadratic energies."""
    values = energies(slider(spring=100.0), [0.3], [1.0], 0.05, 20.0)
    np.testing.assert_allclose(values, values[0], rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
def test_energy_is_bounded_over_long_times(name):
    """No drift in 1e5 steps: the last tenth lies in the band of the first tenth, widened by half."""
    values = energies(*MECHANISMS[name], 0.01, 1000.0)
    first, last = values[:10_000], values[-10_000:]
    width = np.ptp(first)
    assert first.min() - 0.5 * width < last.min() and last.max() < first.max() + 0.5 * width


@pytest.mark.slow
def test_energy_of_a_tumbling_body_is_bounded_over_long_times():
    values = energies(free_body(), [0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 0.01, 5, 0.01], 0.01, 1000.0)
    assert np.ptp(values[-10_000:]) < 1.5 * np.ptp(values[:10_000])
    assert abs(values[-10_000:].mean() - values[:10_000].mean()) < 0.1 * np.ptp(values)
