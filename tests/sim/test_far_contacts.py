"""Far contacts: impulses given for the whole step, with an error of derivatives of the size of the cutoff.

The bound is that of sim/contact/far_contacts.py with m W^2 of the links of the ant; joints with armature have less.
"""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import LAWS, block

CUTOFF = 0.1
BOUND = 2.0  # times the cutoff


@pytest.fixture(scope="module")
def full():
    return dojo.Simulator(dojo.models.ant(), time_step=0.02, kappa=1e-3)


@pytest.fixture(scope="module")
def rows(full):
    """States of ants that have fallen for a while under random inputs, and their next inputs."""
    rng = np.random.default_rng(3)
    X = np.array([full.integrate(full.neutral(), 0.2 * rng.standard_normal(full.ndx)) for _ in range(8)])
    X[:, 2] += 0.6
    for _ in range(12):
        X = full.step_batch(X, rng.standard_normal((8, full.nu))).x
    return X, rng.standard_normal((8, full.nu))


def relative(found, expected):
    return np.linalg.norm(found - expected, axis=(-2, -1)) / np.linalg.norm(expected, axis=(-2, -1))


def test_derivatives_are_those_with_all_contacts_to_the_size_of_the_cutoff(full, rows):
    X, U = rows
    expected = full.step_batch(X, U, derivatives=True)
    for cutoff in (0.01, CUTOFF, 0.5):
        found = full.replace(cutoff=cutoff).step_batch(X, U, derivatives=True)
        assert found.success
        assert 0.0 < relative(found.A, expected.A).max() < BOUND * cutoff
        assert relative(found.B, expected.B).max() < BOUND * cutoff
        change = np.linalg.norm((expected.x - X)[:, full.nq :], axis=1)
        assert np.all(np.linalg.norm((found.x - expected.x)[:, full.nq :], axis=1) < 0.5 * cutoff * change)


def test_derivatives_agree_with_central_differences_to_the_size_of_the_cutoff(full, rows):
    sim, (X, U) = full.replace(cutoff=CUTOFF), rows
    found, step = sim.step_batch(X, U, derivatives=True), 1e-6
    moves = step * np.eye(sim.ndx)
    for x, u, A in zip(X[:3], U[:3], found.A[:3], strict=True):
        ends = [
            sim.step_batch(np.array([sim.integrate(x, s * dx) for dx in moves]), np.tile(u, (sim.ndx, 1))).x
            for s in (1.0, -1.0)
        ]
        columns = [sim.difference(a, b) / (2.0 * step) for a, b in zip(*ends, strict=True)]
        assert relative(A, np.transpose(columns)) < BOUND * CUTOFF


def test_fewer_contacts_are_solved_for_and_all_report_their_impulses(full, rows):
    sim, (X, U) = full.replace(cutoff=CUTOFF), rows
    omitted = [len(sim.inactive_contacts(x, u)) for x, u in zip(X, U, strict=True)]
    assert min(omitted) > 0
    assert not any(len(full.inactive_contacts(x, u)) for x, u in zip(X, U, strict=True))
    found, expected = (s.step_batch(X, U, contacts=True).contacts for s in (sim, full))
    np.testing.assert_allclose(found.gap, expected.gap, rtol=0, atol=1e-3)
    np.testing.assert_allclose(found.impulse, expected.impulse, rtol=0, atol=0.02 * np.abs(expected.impulse).max())
    assert np.all(np.linalg.norm(found.impulse, axis=-1) > 0.0)


def test_a_tiny_cutoff_solves_for_no_more_contacts_than_none(full, rows):
    def unknown(sim, x, u):
        sim.step(x, u, throw=True)
        return int(sim._engine.last().active_count[0])

    small, (X, U) = full.replace(kappa=1e-6), rows
    for x, u in zip(X, U, strict=True):
        without = unknown(small, x, u)
        assert unknown(small.replace(cutoff=1e-5), x, u) <= without < len(full.mechanism.contacts)


def test_steps_rollouts_and_batches_agree(full, rows):
    sim, (X, U) = full.replace(cutoff=CUTOFF), rows
    expected = sim.step_batch(X, U, substeps=2).x
    for x, u, end in zip(X, U, expected, strict=True):
        np.testing.assert_array_equal(sim.rollout(x, np.tile(u, (2, 1))).x[-1], end)
    np.testing.assert_array_equal(sim.step(X[0], U[0]).x, sim.rollout(X[0], U[:1]).x[-1])


@pytest.mark.parametrize("law", LAWS)
def test_a_contact_that_comes_near_within_the_step_takes_part(law):
    """A block that stands still half a metre above the ground, and is pushed onto it in one step."""
    mech = block(law=law)
    sim = dojo.Simulator(mech, time_step=0.1, kappa=1e-4, cutoff=CUTOFF)
    x = np.r_[0.0, 0.0, 1.0, 1.0, np.zeros(9)]
    wrench = np.array([[0.0, 0.0, -200.0 * mech.bodies[0].mass, 0.0, 0.0, 0.0]])
    found = sim.step(x, wrenches=wrench)
    assert found.success
    assert found.contacts.gap.min() > 0.0
    near = [name for name, gap in zip(mech.contact_names, found.contacts.gap, strict=True) if gap < 0.1]
    assert near
    sim.rollout(x, np.zeros((1, sim.nu)), wrenches=wrench)
    assert not set(near) & set(np.array(mech.contact_names)[sim._engine.inactive()])
    expected = sim.replace(cutoff=0.0).step(x, wrenches=wrench)
    np.testing.assert_allclose(found.x, expected.x, atol=1e-3)


def test_steps_across_the_cutoff_are_continuous():
    """Where a contact becomes far, the velocity jumps by a tenth of the cutoff times the change of a step, or less."""
    sim = dojo.Simulator(block(), time_step=0.02, kappa=1e-3, cutoff=CUTOFF)
    X = np.array([np.r_[0.0, 0.0, z, 1.0, np.zeros(6), 1.0, 0.5, -0.2] for z in np.linspace(0.3, 1.5, 400)])
    U = np.zeros((len(X), sim.nu))
    found, expected = (s.step_batch(X, U).x[:, sim.nq :] for s in (sim, sim.replace(cutoff=0.0)))
    change = np.abs(expected - X[:, sim.nq :]).max()
    assert 0.0 < np.abs(np.diff(found - expected, axis=0)).max() < 0.1 * CUTOFF * change


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"order": 4, "cutoff": 0.1}, "expected steps of order 2"),
        ({"accuracy": 1e-3, "cutoff": 0.1}, "expected no accuracy"),
        ({"cutoff": -0.1}, "Simulator"),
    ],
)
def test_settings_without_far_contacts_are_named(settings, message):
    with pytest.raises(ValueError, match=message):
        dojo.Simulator(block(), **settings)


def test_a_simulator_keeps_its_cutoff(full):
    sim = full.replace(cutoff=CUTOFF)
    assert sim.cutoff == CUTOFF
    assert sim.replace(kappa=1e-4).cutoff == CUTOFF
    assert sim.with_parameters({"time_step": 0.01}).cutoff == CUTOFF
    assert "cutoff=0.1" in repr(sim)
    assert "cutoff" not in repr(full)
