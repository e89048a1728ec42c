"""start turns a velocity at a node into a state with the momentum of that velocity."""

from __future__ import annotations

import numpy as np
import pytest

from dojo_opt import models
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.simulator.results import SimulationError
from sim.simulator.simulator import Simulator
from solvers.status import Status
from support.mechanisms import CASES, chain_with, random_state


@pytest.mark.sweep(7)
@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_node_has_the_energy_of_the_velocity(kind: str, on_world: bool) -> None:
    mech = chain_with(kind, on_world)
    q, v = random_state(np.random.default_rng(7), mech, speed=3.0)
    exact = Simulator(mech, time_step=1e-8).kinetic_energy(np.concatenate([q, v]))
    x = Simulator(mech, time_step=0.02).state_from_velocity(q, v)
    np.testing.assert_allclose(Simulator(mech, time_step=0.02).kinetic_energy(x), exact, rtol=1e-6)
    np.testing.assert_array_equal(x[: mech.nq], q)


def test_mean_velocity_converges_to_that_of_the_node() -> None:
    mech = models.quadruped()
    q, v = random_state(np.random.default_rng(1), mech, speed=2.0)
    error = [
        np.abs(Simulator(mech, time_step=h).state_from_velocity(q, v)[mech.nq :] - v).max() for h in (0.02, 0.01, 0.005)
    ]
    np.testing.assert_allclose(np.log2(np.divide(error[:-1], error[1:])), 1.0, atol=0.2)


def test_fast_spin() -> None:
    sim = Simulator(models.block(), time_step=0.05)
    v = np.array([0.0, 0.0, 0.0, 30.0, -20.0, 25.0])
    x = sim.state_from_velocity(sim.neutral()[:7], v)
    np.testing.assert_allclose(sim.momentum(x)[1], 1.0 / 24.0 * v[3:], rtol=1e-10)


def test_too_fast_a_spin_is_refused() -> None:
    sim = Simulator(models.quadruped(), time_step=0.1, divide=False)
    v = np.zeros(sim.nv)
    v[3] = 40.0
    with pytest.raises(SimulationError, match=r"Simulator.state_from_velocity: .*half a turn") as error:
        sim.state_from_velocity(sim.neutral()[: sim.nq], v)
    assert error.value.status == Status.TURN_TOO_LARGE


def test_stiff_springs_and_tonnes_are_started_to_their_rounding() -> None:
    """The half impulse of a spring, and momenta from differences of positions, are rounded by more than 1e-11."""
    body = Body("mass", 1.0, (0.1, 0.1, 0.1))
    stiff = Mechanism([body], [Joint("prismatic", None, "mass", axis=(1, 0, 0), spring=1e10)], gravity=(0.0, 0.0, 0.0))
    sim = Simulator(stiff, time_step=0.1)
    np.testing.assert_allclose(sim.energy(sim.state_from_velocity([0.1], [0.0])), 0.5e8, rtol=1e-9)
    heavy = Mechanism([Body("load", 1e6, (1e5, 1e5, 1e5))], [Joint("floating", None, "load")])
    sim = Simulator(heavy, time_step=1e-3)
    x = sim.state_from_velocity([0.3, 0.2, 0.4, 1, 0, 0, 0], np.zeros(6))
    np.testing.assert_allclose(sim.kinetic_energy(x), 0.0, atol=1e-6)


def test_a_step_of_tonnes_in_microseconds_ends_at_its_rounding() -> None:
    """1e4 kg 2 m from the origin at 20 us: momenta are rounded by 2e-7 N s, above the tolerance of 1e-8."""
    bodies = [Body("rod", 0.2, (1e-3, 1e-3, 1e-5)), Body("tip", 1e4, (50.0, 50.0, 50.0))]
    joints = [
        Joint("revolute", None, "rod", axis=(0, 1, 0), child_point=(0, 0, 1.0)),
        Joint("revolute", "rod", "tip", axis=(0, 1, 0), parent_point=(0, 0, -1.0)),
    ]
    sim = Simulator(Mechanism(bodies, joints), time_step=2e-5)
    trajectory = sim.rollout(sim.state_from_velocity([0.5, 0.0], [0.0, 0.0]), np.zeros((500, 2)))
    assert trajectory.success, trajectory.message
    energy = sim.energy(trajectory.x)
    assert np.ptp(energy) < 1e-6 * 1e4 * 9.81 * 2.0
