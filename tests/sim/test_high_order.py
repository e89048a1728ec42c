"""Simulators of order 4, 6, 8 reach their order, keep momentum, and refuse unsupported features."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.integrators.tableau import stable
from support.mechanisms import random_state
from support.smooth_mechanisms import ORDERS, apart, branch, end


@pytest.mark.parametrize(
    "kind", ["floating", "spherical", "cylindrical_free", "planar_axis", "prismatic", "fixed", "screw"]
)
@pytest.mark.parametrize("on_world", [True, False])
def test_fourth_order_with_springs_dampers_and_inputs(kind: str, on_world: bool) -> None:
    mech = branch(kind, on_world, damper=0.1)
    u = np.array([0.5, 0.3, -0.7])
    exact = end(mech, 8, 0.01, 0.4, u)
    errors = [apart(mech, end(mech, 4, h, 0.4, u), exact) for h in (0.04, 0.02)]
    assert errors[1] > 1e-9
    assert abs(np.log2(errors[0] / errors[1]) - 4.0) < 0.5, errors


@pytest.mark.parametrize(("order", "h"), [(6, 0.05), (8, 0.1)])
def test_higher_orders(order: int, h: float) -> None:
    mech = branch("spherical", False)
    exact = end(mech, 8, 0.01, 0.8)
    errors = [apart(mech, end(mech, order, step, 0.8), exact) for step in (h, h / 2)]
    assert errors[1] > 1e-11
    assert np.log2(errors[0] / errors[1]) > order - 1.0, errors


@pytest.mark.parametrize("kind", ["spherical", "orbital", "planar_axis", "screw"])
@pytest.mark.parametrize("on_world", [True, False])
def test_it_is_the_same_motion_as_that_of_second_order(kind: str, on_world: bool) -> None:
    mech = branch(kind, on_world, damper=0.1)
    exact = end(mech, 8, 0.01, 0.2)
    sim = dojo.Simulator(mech, time_step=1e-3)
    q, v = random_state(np.random.default_rng(3), mech)
    coarse, fine = (
        dojo.Simulator(mech, time_step=h).rollout(
            dojo.Simulator(mech, time_step=h).state_from_velocity(q, v), np.zeros((round(0.2 / h), sim.nu))
        ).x[-1][: sim.nq]
        for h in (5e-4, 2.5e-4)
    )  # fmt: skip
    np.testing.assert_allclose((4.0 * fine - coarse) / 3.0, exact[: sim.nq], atol=1e-7)


@pytest.mark.parametrize("kind", ["spherical", "revolute", "prismatic", "screw"])
def test_momentum_stays_to_rounding(kind: str) -> None:
    mech = replace(branch(kind, False, spring=2.0), gravity=(0.0, 0.0, 0.0))
    sim = dojo.Simulator(mech, time_step=0.02, order=6)
    q, v = random_state(np.random.default_rng(1), mech)
    x = sim.rollout(sim.state_from_velocity(q, v), np.zeros((200, sim.nu)), throw=True).x
    for part in sim.momentum(x):
        assert np.abs(part - part[0]).max() < 1e-12 * max(1.0, np.abs(part[0]).max())


@pytest.mark.parametrize(("order", "h", "bound"), [(4, 0.005, 1e-6), (6, 0.01, 1e-7), (8, 0.02, 1e-9)])
def test_energy_over_a_hundred_seconds(order: int, h: float, bound: float) -> None:
    sim = dojo.Simulator(dojo.models.npendulum(2), time_step=h, order=order)
    x = sim.rollout(sim.state_from_velocity([0.4, 0.3], [0.0, 0.0]), np.zeros((round(100.0 / h), sim.nu)), throw=True).x
    assert np.abs(sim.energy(x) - sim.energy(x[0])).max() < bound


def test_armature_is_in_the_motion_and_in_the_energy() -> None:
    mech = dojo.models.npendulum(2)
    mech = replace(mech, joints=[replace(j, armature=0.3) for j in mech.joints])
    sim, second = dojo.Simulator(mech, time_step=0.01, order=8), dojo.Simulator(mech, time_step=2e-4)
    x = sim.rollout(sim.state_from_velocity([1.0, 0.3], [0.0, 0.5]), np.zeros((50, sim.nu)), throw=True).x
    y = second.rollout(second.state_from_velocity([1.0, 0.3], [0.0, 0.5]), np.zeros((2500, sim.nu)), throw=True).x
    np.testing.assert_allclose(x[-1, :2], y[-1, :2], atol=1e-6)
    assert np.abs(sim.energy(x) - sim.energy(x[0])).max() < 1e-10


def test_states_have_the_velocity_of_the_node() -> None:
    mech = branch("cylindrical_free", False)
    sim, second = dojo.Simulator(mech, time_step=0.02, order=4), dojo.Simulator(mech, time_step=0.02)
    q, v = random_state(np.random.default_rng(5), mech)
    x, y = sim.state_from_velocity(q, v), second.state_from_velocity(q, v)
    np.testing.assert_array_equal(x, np.r_[q, v])
    np.testing.assert_array_equal(sim.velocity(x), v)
    assert abs(sim.energy(x) - second.energy(y)) < 1e-9
    np.testing.assert_allclose(np.hstack(sim.momentum(x)), np.hstack(second.momentum(y)), atol=1e-10)
    z = sim.maximal(x)
    np.testing.assert_allclose(z, second.body_states(q, v), atol=1e-12)
    assert np.abs(sim.difference(sim.minimal(z), x)).max() < 1e-10
    assert np.abs(second.maximal(y) - z).max() > 1e-4
    slow = sim.minimal(z + np.r_[0, 0, 0, 1e-3, np.zeros(9)], joint_tolerance=np.inf)
    assert 1e-5 < np.abs(sim.difference(slow, x)).max() < 1e-1


def test_batches_steps_and_copies_agree_with_rollouts() -> None:
    mech = branch("revolute", False)
    sim = dojo.Simulator(mech, time_step=0.01, order=4)
    q, v = random_state(np.random.default_rng(6), mech)
    us = np.random.default_rng(7).normal(size=(2, 5, sim.nu))
    x = sim.state_from_velocity(q, v)
    batch = sim.rollout_batch(np.tile(x, (2, 1)), us)
    copies = [pickle.loads(pickle.dumps(sim)), sim.replace(order=6).replace(order=4)]
    for run in (sim, *copies):
        np.testing.assert_array_equal(run.rollout(x, us[1]).x, batch.x[1])
    rows = sim.step_batch(np.tile(x, (2, 1)), us[:, 0], derivatives=True)
    np.testing.assert_array_equal(rows.x, batch.x[:, 1])
    np.testing.assert_array_equal(sim.stepper().step(x[None], us[0, :1]).x, batch.x[:1, 1])
    A, B = sim.linearize(x, us[1, 0])
    np.testing.assert_array_equal(rows.A[1], A)
    np.testing.assert_array_equal(rows.B[1], B)
    one = sim.step(x, us[0, 0])
    assert one.success and one.iterations == 4
    np.testing.assert_allclose(one.x, batch.x[0, 1], atol=1e-12)
    assert "order 4" in sim.describe()


def test_a_scene_without_contacts_has_no_forces_of_them() -> None:
    sim = dojo.Simulator(dojo.models.npendulum(2), time_step=0.01, order=4)
    contacts = sim.rollout(sim.neutral(), np.zeros((3, sim.nu))).contacts
    assert contacts.normal_force.shape == contacts.gap.shape == (3, 0) and contacts.friction_force.shape == (3, 0)


def test_a_body_that_turns_too_far_is_reported() -> None:
    sim = dojo.Simulator(dojo.models.npendulum(1), time_step=0.1, order=4)
    result = sim.step(sim.state_from_velocity([0.0], [300.0]))
    assert not result.success
    assert result.status in (dojo.Status.TURN_TOO_LARGE, dojo.Status.NO_PROGRESS)


@pytest.mark.parametrize("order", ORDERS)
def test_springs_and_dampers_have_steps_of_order_two_where_they_would_be_unstable(order: int) -> None:
    bodies = [dojo.Body("cart", 2.0, (0.1, 0.1, 0.1))]
    for field, rate in (("spring", np.sqrt(500.0 / 2.0)), ("damper", 500.0 / 2.0)):
        joint = dojo.Joint("prismatic", None, "cart", axis=(1, 0, 0), **{field: 500.0})
        mech = dojo.Mechanism(bodies, [joint], gravity=(0, 0, 0))
        stiff = dojo.Simulator(mech, time_step=1.02 * stable(order) / rate, order=order)
        assert re.search(rf"order 2: joint .*: its {field} acts at .* use a time step below", stiff.describe())
        sim = dojo.Simulator(mech, time_step=0.98 * stable(order) / rate, order=order)
        x = sim.rollout(sim.state_from_velocity([0.1], [0.1]), np.zeros((2000, sim.nu)), throw=True).x
        assert np.abs(x).max() < 10.0 and np.abs(x[-1]).max() < 2.0


def test_closed_loops_are_for_order_two_alone() -> None:
    with pytest.raises(
        ValueError, match=r"'minitaur_leg' has the loop joint '.*'; steps of higher order are for trees"
    ):
        dojo.Simulator(dojo.models.minitaur_leg(), time_step=0.01, order=4)


def test_methods_of_order_two_alone_and_unknown_orders_are_refused() -> None:
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01, order=4)
    x = sim.neutral()
    for call in (lambda: sim.maximal_jacobian(x), lambda: sim.minimal_jacobian(sim.maximal(x))):
        with pytest.raises(ValueError, match=r"order 4: .* those of order 2; use replace\(order=2\)"):
            call()
    swing = dojo.Simulator(branch("orbital", True), time_step=0.01, order=4)
    with pytest.raises(ValueError, match=r"derivatives through joint 0, with two rotations"):
        swing.linearize(swing.neutral())
    with pytest.raises(ValueError, match=r"expected one of \(2, 4, 6, 8\), got 3"):
        dojo.Simulator(dojo.models.pendulum(), order=3)


@pytest.mark.slow
def test_second_order_does_not_know_of_the_others() -> None:
    program = (
        "import sys, numpy as np, dojo_opt as dojo; sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01); "
        "sim.rollout(sim.neutral(), np.zeros((2, 1))); print([m for m in sys.modules if m in ('sim.simulator.engines.high_order_engine', 'sim.integrators.runge_kutta', 'sim.integrators.hamilton')])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
