"""Steps of independent rows: each as if alone, with its own derivatives, parameters and smoothing."""

from __future__ import annotations

import re

import numpy as np
import pytest

import dojo_opt as dojo
from sim.simulator.contact_groups import ContactGroups
from solvers.compiler import threads


def _rows(sim, n=7):
    rng = np.random.default_rng(3)
    X = np.array([sim.integrate(sim.neutral(), 0.2 * rng.standard_normal(sim.ndx)) for _ in range(n)])
    X[:, 2] += 0.6  # some touch the ground, some fly
    return X, rng.standard_normal((n, sim.nu))


@pytest.fixture(scope="module")
def sim():
    return dojo.Simulator(dojo.models.ant(), time_step=0.02, kappa=1e-4)


def test_a_row_is_the_rollout_of_its_state_whatever_its_neighbors(sim):
    X, U = _rows(sim)
    found = sim.step_batch(X, U, substeps=3, derivatives=True)
    assert found.success
    for x, u, end in zip(X, U, found.x, strict=True):
        np.testing.assert_array_equal(end, sim.rollout(x, np.tile(u, (3, 1))).x[-1])
    order = np.array([6, 2, 4, 0])
    again = sim.step_batch(X[order], U[order], substeps=3, derivatives=True)
    np.testing.assert_array_equal(again.A, found.A[order])
    np.testing.assert_array_equal(sim.step_batch(X, U, substeps=3).x, found.x)
    with threads(1):
        np.testing.assert_array_equal(sim.step_batch(X, U, substeps=3, derivatives=True).B, found.B)


def test_contacts_are_those_of_the_last_step_of_every_row(sim):
    X, U = _rows(sim)
    X[:, 2] -= np.linspace(0.0, 0.6, len(X))
    found = sim.step_batch(X, U, substeps=6, contacts=True)
    np.testing.assert_array_equal(found.x, sim.step_batch(X, U, substeps=6).x)
    groups = [sim.mechanism.contact_names[:2], sim.mechanism.contact_names[-1:]]
    wrenches = ContactGroups(sim, groups).wrenches(found.x, found.contacts)
    touched = 0
    for i, (x, u) in enumerate(zip(X, U, strict=True)):
        path = sim.rollout(x, np.tile(u, (6, 1)))
        alone = sim.step_batch(x[None], u[None], substeps=6, contacts=True).contacts  # in buffers of its own
        for ours in (found.contacts.impulse[i], alone.impulse[0]):
            np.testing.assert_array_equal(ours, path.contacts.impulse[-1])
        force, point = path.contacts.force[-1], path.contacts.point[-1]
        arms = point - dojo.Kinematics(sim).center_of_mass(found.x[i, : sim.nq])
        own = np.concatenate([force, np.cross(arms, force)], axis=1)
        np.testing.assert_allclose(wrenches[i], [own[:2].sum(axis=0), own[-1]], rtol=1e-12, atol=1e-12)
        touched += int(np.abs(force).max() > 1.0)
    assert 0 < touched < len(X), touched


def test_derivatives_agree_with_central_differences(sim):
    """Differences of steps that end early are off by the root of their tolerance: these are exact."""
    sim = sim.replace(tolerance=1e-13)
    X, U = _rows(sim)
    X, U, kappa, eps = X[:2], U[:2], np.array([1e-3, 3e-4]), 1e-5
    found = sim.step_batch(X, U, 2, True, kappa)

    def end(dx, du):
        moved = np.array([sim.integrate(x, dx) for x in X])
        ends = sim.step_batch(moved, U + du, 2, kappa=kappa).x
        return np.array([sim.difference(b, a) for a, b in zip(found.x, ends, strict=True)])

    for j in range(sim.ndx):
        e = eps * np.eye(sim.ndx)[j]
        slope = (end(e, 0.0) - end(-e, 0.0)) / (2 * eps)
        np.testing.assert_allclose(found.A[:, :, j], slope, atol=1e-6 * max(1.0, np.abs(slope).max()))
    for j in range(sim.nu):
        e = eps * np.eye(sim.nu)[j]
        slope = (end(np.zeros(sim.ndx), e) - end(np.zeros(sim.ndx), -e)) / (2 * eps)
        np.testing.assert_allclose(found.B[:, :, j], slope, atol=1e-7)


def test_rows_have_their_own_parameters(sim):
    X, U = _rows(sim, 4)
    values = {"friction:*": np.array([0.1, 0.9, 0.1, 0.5]), "time_step": np.array([0.02, 0.01, 0.01, 0.02])}
    found = sim.step_batch(X, U, 2, parameters=values)
    for i in range(4):
        alone = sim.with_parameters({name: value[i] for name, value in values.items()})
        np.testing.assert_array_equal(found.x[i], alone.rollout(X[i], np.tile(U[i], (2, 1))).x[-1])
    one = sim.step_batch(X, U, 2, parameters={"friction:*": [[0.1]], "mass": sim.parameters(("mass",)).values[None]})
    every = sim.step_batch(X, U, 2, parameters={"friction:*": np.full(4, 0.1)})
    np.testing.assert_array_equal(one.x, every.x)
    mixed = sim.step_batch(X, U, 2, parameters={"friction:*": values["friction:*"], "time_step": 0.02})
    np.testing.assert_array_equal(mixed.x[[0, 3]], found.x[[0, 3]])
    values["friction:*"][:] = values["friction:*"][::-1].copy()  # in place, between two calls
    turned = sim.step_batch(X, U, 2, parameters=values)
    again = sim.step_batch(X, U, 2, parameters={name: value.copy() for name, value in values.items()})
    np.testing.assert_array_equal(turned.x, again.x)
    assert not np.array_equal(turned.x, found.x)


def _motion(sim, X, U, impulses, substeps=1):
    """States and iterations of four knots, of rows in the order of X."""
    states, iterations = [], []
    for U_t in U:
        found = sim.step_batch(X, U_t, substeps, impulses=impulses)
        assert found.success
        X = found.x
        states.append(X)
        iterations.append(found.iterations)
    return np.array(states), np.array(iterations)


def test_rows_start_from_their_own_impulses(sim):
    X, U = _rows(sim)
    U = np.array([U, U + 0.1, U - 0.1, U])
    states, iterations = _motion(sim, X, U, sim.row_impulses(7))
    alone, cold = _motion(sim, X, U, None)
    np.testing.assert_allclose(states, alone, atol=1e-4)  # the same solutions, up to the tolerance of a step
    np.testing.assert_array_equal(states[0], alone[0])  # before any impulses are known
    assert iterations[1:].sum() < 0.7 * cold[1:].sum()
    order = np.array([6, 2, 4, 0])
    np.testing.assert_array_equal(_motion(sim, X[order], U[:, order], sim.row_impulses(4))[0], states[:, order])
    with threads(1):
        np.testing.assert_array_equal(_motion(sim, X, U, sim.row_impulses(7))[0], states)
    kept = sim.row_impulses(7)
    for x, U_t, end in zip([X, *states], U, states, strict=False):
        found = sim.step_batch(x, U_t, derivatives=True, impulses=kept)
        np.testing.assert_array_equal(found.x, end)  # derivatives change nothing


def test_impulses_are_forgotten_and_taken_along(sim):
    X, U = _rows(sim)
    kept = sim.row_impulses(7)
    X = sim.step_batch(X, U, impulses=kept).x
    assert kept.known.all()
    some = np.array([1, 5])
    part = kept.of_rows(some)
    known = sim.step_batch(X[some], U[some], impulses=part).x
    kept.forget([0, 2])
    found = sim.step_batch(X, U, impulses=kept).x
    np.testing.assert_array_equal(found[some], known)
    np.testing.assert_array_equal(found[[0, 2]], sim.step_batch(X, U).x[[0, 2]])
    assert not np.array_equal(found[some], sim.step_batch(X, U).x[some])


def test_an_unsolved_row_has_no_impulses():
    sim = dojo.Simulator(dojo.models.sphere(), time_step=0.05, max_iterations=1, divide=False)
    X = np.tile(sim.neutral(), (2, 1))
    X[:, 2] += 2.0
    X[1, 2] = 0.4  # below the ground
    kept = sim.row_impulses(2)
    found = sim.step_batch(X, np.zeros((2, sim.nu)), impulses=kept)
    np.testing.assert_array_equal(kept.known, found.status == dojo.Status.SOLVED)
    assert kept.known[0] and not kept.known[1]


def test_wrong_impulses_are_named(sim):
    X, U = _rows(sim)
    other = dojo.Simulator(dojo.models.sphere(), time_step=0.05)
    for impulses, kind in ((sim.row_impulses(6), ValueError), (other.row_impulses(7), ValueError), (True, TypeError)):
        with pytest.raises(kind, match=r"step_batch\(impulses=...\)"):
            sim.step_batch(X, U, impulses=impulses)
    with pytest.raises(ValueError, match="row_impulses"):
        sim.row_impulses(-1)


def test_an_unsolved_row_stands_still_and_is_named():
    sim = dojo.Simulator(dojo.models.sphere(), time_step=0.05, max_iterations=1, divide=False)
    X = np.tile(sim.neutral(), (3, 1))
    X[:, 2] += 2.0
    X[1, 2] = 0.4  # below the ground
    found = sim.step_batch(X, np.zeros((3, sim.nu)), derivatives=True)
    assert found.unsolved.tolist() == [1] and not found.A[1].any() and found.A[0].any()
    np.testing.assert_array_equal(found.x[1], X[1])
    alone = sim.step_batch(X[1:2], np.zeros((1, sim.nu)))  # in buffers of its own
    for message in (found.message, alone.message):
        assert re.search(r"row [01]: .*Residual .* after 1 iterations \(tolerance 1e-08\)", message), message
    with pytest.raises(dojo.SimulationError, match="row 1"):
        sim.step_batch(X, np.zeros((3, sim.nu)), throw=True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kappa": [1.0, 1.0]}, r"step_batch\(kappa=\.\.\.\): expected shape \(3,\)"),
        ({"kappa": -1.0}, r"kappa=\.\.\.\): expected numbers above 0"),
        ({"parameters": {"friction:*": [1.0, 2.0]}}, r"'friction:\*': expected shape \(3, 1\)"),
        ({"contacts": True, "derivatives": True}, r"contacts=True\): expected no derivatives"),
        ({"substeps": 0}, r"substeps=\.\.\.\)"),
    ],
)
def test_bad_arguments_are_named(sim, change, message):
    X, U = _rows(sim, 3)
    with pytest.raises(ValueError, match=message):
        sim.step_batch(X, U, **change)


@pytest.mark.parametrize(
    ("setting", "kind"),
    [({"order": 4}, r"order 4; use replace\(order=2\)"), ({"accuracy": 1e-3}, "accuracy 0.001; use")],
)
def test_steps_of_other_kinds_have_no_contacts_in_batches(setting, kind):
    """Nor tasks that need them, which say so at once."""
    other = dojo.Simulator(dojo.models.raiberthopper(), 0.01, **setting)
    for call in (lambda: other.step_batch(*_rows(other, 2), contacts=True), lambda: other.stepper(contacts=True)):
        with pytest.raises(ValueError, match=rf"expected a simulator of order 2.*, got {kind}"):
            call()
    with pytest.raises(ValueError, match=r"Task\(touch=\.\.\.\): expected a simulator of order 2"):
        dojo.learn.Task(other, 1, print, 1, print, -np.ones(3), np.ones(3), print, touch=(("foot",),))


def test_a_collision_that_moved_beyond_its_reach_keeps_nothing_of_the_step_before() -> None:
    bodies = [dojo.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in "ab"]
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    pair = dojo.Collision("a", "b", dojo.Sphere(0.1), dojo.Sphere(0.1), reach=0.1)
    sim = dojo.Simulator(dojo.Mechanism(bodies, joints, collisions=[pair], gravity=(0.0, 0.0, 0.0)), 0.01)
    near, far = sim.neutral(), sim.neutral()
    near[7], far[7] = 0.21, 2.0
    assert sim.step(near).contacts.impulse.any()
    found = sim.step(far).contacts
    assert not found.impulse.any() and np.isinf(found.gap).all()
