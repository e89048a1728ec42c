"""Impacts: nothing penetrates at any time step or speed, nothing bounces, a body rests where it should."""

import numpy as np
import pytest
from naive import rotation as rot

import dojo_opt as dojo
from support.scenes import LAWS, ball, block, gaps, run


@pytest.mark.sweep(4)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("time_step", [1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1])
def test_no_penetration_at_any_time_step(time_step, law):
    """A tumbling cube dropped from a metre, thrown sideways."""
    sim = dojo.Simulator(block(law=law), time_step=time_step, kappa=1e-6, tolerance=1e-9)
    q = np.r_[0.0, 0.0, 1.0, rot.exp(np.array([0.4, -0.3, 0.8]))]
    xs = run(sim, np.r_[q, 2.0, 1.0, -1.0, 3.0, -2.0, 1.0], round(1.0 / time_step))
    assert gaps(sim, xs).min() > -1e-8


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("time_step", [1e-3, 1e-2, 5e-2])
def test_impact_at_100_meters_per_second(time_step, law):
    sim = dojo.Simulator(ball(law=law), time_step=time_step, kappa=1e-6, tolerance=1e-9)
    x = np.r_[0.0, 0.0, 0.1 + 3.3 * 100.0 * time_step, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -100.0, np.zeros(3)]
    xs = run(sim, x, 20)
    assert gaps(sim, xs).min() > -1e-8
    hop = np.sqrt(1e-6 / time_step)  # the central path lifts a ball that was pressed to gap 0: m v = kappa / (h v)
    assert np.abs(xs[8:, 7:10]).max() < 1.1 * hop, "no rebound"
    assert gaps(sim, xs[8:]).max() < hop**2 / 9.81 + 2e-4


@pytest.mark.parametrize("time_step", [1e-3, 1e-2])
def test_block_at_100_meters_per_second(time_step):
    """A corner first, with spin and sideways speed."""
    sim = dojo.Simulator(block(), time_step=time_step, kappa=1e-6, tolerance=1e-9)
    q = np.r_[0.0, 0.0, 0.6 + 1.5 * 100.0 * time_step, rot.exp(np.array([0.4, -0.3, 0.8]))]
    xs = run(sim, np.r_[q, 30.0, 0.0, -100.0, 5.0, -5.0, 5.0], 20)
    assert gaps(sim, xs).min() > -1e-8


def test_restitution_is_zero():
    """A dropped ball stays down: its speed after the step of the impact is at most gap / h."""
    sim = dojo.Simulator(ball(friction=0.0), time_step=0.01, kappa=1e-8, tolerance=1e-10)
    xs = run(sim, np.r_[0.0, 0.0, 1.1, 1.0, np.zeros(9)], 100)
    hit = int(np.argmax(gaps(sim, xs)[:, 0] < 1e-4))
    assert 40 < hit < 50
    assert np.abs(xs[hit + 1 :, 9]).max() < 1e-4
    assert gaps(sim, xs)[hit:].max() < 1e-4


@pytest.mark.parametrize("kappa", [1e-4, 1e-6, 1e-8])
def test_resting_height(kappa):
    """On the central path the gap is kappa over the impulse, m g h."""
    sim = dojo.Simulator(ball(), time_step=0.01, kappa=kappa, tolerance=1e-12)
    x = run(sim, np.r_[0.0, 0.0, 0.1 + kappa / 0.0981, 1.0, np.zeros(9)], 50)[-1]
    np.testing.assert_allclose(gaps(sim, x)[0], kappa / 0.0981, rtol=1e-6)
    np.testing.assert_allclose(x[7:], 0.0, atol=1e-9)


def test_resting_block_carries_its_weight():
    """The impulses of the corners add up to m g h, the mean forces to m g."""
    sim = dojo.Simulator(block(mass=3.0), time_step=0.01, kappa=1e-8, tolerance=1e-12)
    result = sim.step(run(sim, np.r_[0.0, 0.0, 0.25 + 1e-7, 1.0, np.zeros(9)], 50)[-1], np.zeros(sim.nu))
    np.testing.assert_allclose(np.sum(result.contacts.impulse, axis=0), [0.0, 0.0, 3.0 * 9.81 * 0.01], atol=1e-8)
    np.testing.assert_allclose(np.sum(result.contacts.force, axis=0), [0.0, 0.0, 3.0 * 9.81], atol=1e-6)


def test_impulses_lie_in_the_friction_cone_against_the_slip(rng):
    sim = dojo.Simulator(block(friction=0.7), time_step=0.02, kappa=1e-7, tolerance=1e-11)
    for _ in range(20):
        q = np.r_[0.0, 0.0, rng.uniform(0.4, 0.6), rot.exp(rng.normal(size=3))]
        result = sim.step(np.r_[q, 3.0 * rng.normal(size=3), 3.0 * rng.normal(size=3)], np.zeros(0))
        impulse = np.asarray(result.contacts.impulse)
        tangential = np.linalg.norm(impulse[:, :2], axis=1)
        assert np.all(impulse[:, 2] > 0.0) and np.all(tangential <= 0.7 * impulse[:, 2] * (1.0 + 1e-9))
