"""Without outside forces, linear and angular momentum stay: for every joint, with springs, dampers and inner inputs."""

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import KINDS, chain, free_body, random_state, run


def rest(kind):
    """A rest position that is not the neutral one."""
    joint = chain(kind, 1).joints[-1]
    ntrans, nrot = joint.ntrans, joint.nrot
    return [0.1, -0.05, 0.07][:ntrans] + [0.3, -0.2, 0.1][:nrot]


@pytest.mark.parametrize("links", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_momentum_is_conserved(kind, links, rng):
    sim = dojo.Simulator(chain(kind, links, spring=3.0, damper=0.2, rest=rest(kind)), time_step=0.02, tolerance=1e-12)
    x = random_state(sim, rng, speed=2.0)
    linear, angular = sim.momentum(x)
    trajectory = sim.rollout(x, rng.normal(size=(20, sim.nu)))
    assert trajectory.status == 0
    after = [sim.momentum(state) for state in trajectory.x]
    np.testing.assert_allclose([p for p, _ in after], np.tile(linear, (21, 1)), rtol=0, atol=1e-10)
    np.testing.assert_allclose([L for _, L in after], np.tile(angular, (21, 1)), rtol=0, atol=1e-10)


@pytest.mark.parametrize("time_step", [1e-3, 1e-2, 1e-1])
def test_spinning_body_keeps_its_angular_momentum(time_step):
    """Also at 30 rad/s and a tenth of a second: close to a half turn per step."""
    sim = dojo.Simulator(free_body(), time_step=time_step, tolerance=1e-12)
    x = sim.state_from_velocity(sim.neutral()[:7], np.array([1.0, 2.0, 3.0, 1.0, 20.0, 2.0]))
    _, angular = sim.momentum(x)
    for state in run(sim, x, 50):
        np.testing.assert_allclose(sim.momentum(state)[1], angular, rtol=0, atol=1e-10)


@pytest.mark.parametrize("tolerance", [1e-13, 1e-8])
@pytest.mark.parametrize("kind", ["revolute", "spherical", "free_orbital", "planar", "screw"])
def test_neither_rounding_nor_tolerance_add_up(kind, tolerance, rng):
    """Five thousand steps of 0.1 ms, ten metres from the origin: momentum as good as one step is solved."""
    sim = dojo.Simulator(chain(kind, 2), time_step=1e-4, tolerance=tolerance)
    x = random_state(sim, rng, speed=2.0)
    x[:3] += 10.0
    linear, angular = sim.momentum(run(sim, x, 5000))
    scale = np.linalg.norm(linear[0])
    assert np.abs(linear - linear[0]).max() < max(1e-13, 10.0 * tolerance) * (1.0 + scale)
    assert np.abs(angular - angular[0]).max() < max(1e-13, 10.0 * tolerance) * (1.0 + 10.0 * scale)


def test_a_force_changes_momentum_by_its_impulse():
    sim = dojo.Simulator(chain("revolute", 2, gravity=(1.0, 2.0, -3.0)), time_step=0.02, tolerance=1e-12)
    x = random_state(sim, np.random.default_rng(1))
    mass = sum(body.mass for body in sim.mechanism.bodies)
    linear, _ = sim.momentum(x)
    after, _ = sim.momentum(run(sim, x, 10)[-1])
    np.testing.assert_allclose(after - linear, 0.2 * mass * np.array([1.0, 2.0, -3.0]), atol=1e-10)
