"""start turns a velocity at a node into a state with the momentum of that velocity."""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import CASES, chain_with, random_state

from dojo_opt import models
from sim.results import SimulationError
from sim.simulator import Simulator
from solvers.status import Status


@pytest.mark.parametrize(("kind", "on_world"), CASES)
def test_node_has_the_energy_of_the_velocity(kind: str, on_world: bool) -> None:
    mech = chain_with(kind, on_world)
    q, v = random_state(np.random.default_rng(7), mech, speed=3.0)
    exact = Simulator(mech, time_step=1e-8).kinetic_energy(np.concatenate([q, v]))
    x = Simulator(mech, time_step=0.02).start(q, v)
    np.testing.assert_allclose(Simulator(mech, time_step=0.02).kinetic_energy(x), exact, rtol=1e-6)
    np.testing.assert_array_equal(x[: mech.nq], q)


def test_mean_velocity_converges_to_that_of_the_node() -> None:
    mech = models.quadruped()
    q, v = random_state(np.random.default_rng(1), mech, speed=2.0)
    error = [np.abs(Simulator(mech, time_step=h).start(q, v)[mech.nq :] - v).max() for h in (0.02, 0.01, 0.005)]
    np.testing.assert_allclose(np.log2(np.divide(error[:-1], error[1:])), 1.0, atol=0.2)


def test_fast_spin() -> None:
    sim = Simulator(models.block(), time_step=0.05)
    v = np.array([0.0, 0.0, 0.0, 30.0, -20.0, 25.0])
    x = sim.start(sim.neutral()[:7], v)
    np.testing.assert_allclose(sim.momentum(x)[1], 1.0 / 24.0 * v[3:], rtol=1e-10)


def test_too_fast_a_spin_is_refused() -> None:
    sim = Simulator(models.quadruped(), time_step=0.1)
    v = np.zeros(sim.nv)
    v[3] = 40.0
    with pytest.raises(SimulationError, match=r"Simulator.start: .*half a turn") as error:
        sim.start(sim.neutral()[: sim.nq], v)
    assert error.value.status == Status.ANGULAR_STEP
