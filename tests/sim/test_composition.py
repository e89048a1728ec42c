"""Simulators of order 4, 6, 8: the order is there, momentum stays, and what they cannot do is refused."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import random_body, random_state, unit_quaternion

import dojo_opt as dojo
from sim.composed import COMPOSITIONS
from sim.mechanism import Mechanism
from sim.parts import KINDS, Input, Joint

ORDERS = (4, 6, 8)


def branch(kind: str, on_world: bool, *, spring: float = 3.0, damper: float = 0.0, free: bool = False) -> Mechanism:
    """A joint of one kind with a branch behind it, every frame skewed, pushed by inputs of every sort."""
    rng = np.random.default_rng(4)
    names = ["a", "b", "c"]
    kinds = [kind, "revolute", "spherical"] if on_world else ["floating", kind, "revolute"]

    def joint(k: int) -> Joint:
        n = sum(KINDS[kinds[k]])
        loose = free or kinds[k] == "floating"
        return Joint(
            kinds[k], None if k == 0 else "a", names[k], parent_point=0.3 * rng.normal(size=3),
            child_point=0.3 * rng.normal(size=3), axis=rng.normal(size=3), orientation=unit_quaternion(rng),
            spring=0.0 if loose else spring, damper=0.0 if loose else damper, rest=0.2 * rng.normal(size=n),
        )  # fmt: skip

    inputs = [
        Input("joint1", dof=0) if sum(KINDS[kinds[1]]) else Input(body="b", force=(0, 1, 0)),
        Input(body="c", force=(1.0, 0.5, -2.0), torque=(0.1, 0.2, 0.3), frame="body"),
        Input(body="b", force=(0.3, 0.1, -0.4), torque=(0.3, -0.2, 0.1), frame="world"),
    ]
    joints = [replace(joint(k), name=f"joint{k}") for k in range(3)]
    return Mechanism([random_body(rng, n) for n in names], joints, inputs=inputs)


def end(mech: Mechanism, order: int, h: float, duration: float, u: np.ndarray | None = None) -> np.ndarray:
    sim = dojo.Simulator(mech, time_step=h, order=order, tolerance=1e-13)
    q, v = random_state(np.random.default_rng(3), mech, speed=1.0)
    steps = round(duration / h)
    us = np.zeros((steps, sim.nu)) if u is None else np.tile(u, (steps, 1))
    return np.asarray(sim.rollout(sim.start(q, v), us, throw=True).x[-1])


def apart(mech: Mechanism, a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(dojo.Simulator(mech, time_step=1.0).difference(a, b)).max())


@pytest.mark.parametrize("order", ORDERS)
def test_coefficients_meet_the_order_conditions(order: int) -> None:
    g = np.array(COMPOSITIONS[order])
    assert abs(g.sum() - 1.0) < 1e-14
    np.testing.assert_array_equal(g, g[::-1])
    for power in range(3, order, 2):
        assert abs(np.sum(g**power)) < 1e-13


@pytest.mark.parametrize("kind", ["floating", "spherical", "cylindrical_free", "planar_axis", "prismatic", "fixed"])
@pytest.mark.parametrize("on_world", [True, False])
def test_fourth_order_with_springs_dampers_and_inputs(kind: str, on_world: bool) -> None:
    mech = branch(kind, on_world, damper=0.1)
    u = np.array([0.5, 0.3, -0.7])
    exact = end(mech, 8, 0.01, 0.4, u)
    errors = [apart(mech, end(mech, 4, h, 0.4, u), exact) for h in (0.04, 0.02)]
    assert errors[1] > 1e-9
    assert abs(np.log2(errors[0] / errors[1]) - 4.0) < 0.5, errors


@pytest.mark.parametrize(("order", "h"), [(6, 0.1), (8, 0.2)])
def test_higher_orders(order: int, h: float) -> None:
    mech = branch("spherical", False)
    exact = end(mech, 8, 0.02, 0.8)
    errors = [apart(mech, end(mech, order, step, 0.8), exact) for step in (h, h / 2)]
    assert errors[1] > 1e-11
    assert np.log2(errors[0] / errors[1]) > order - 1.0, errors


def test_it_is_the_same_motion_as_that_of_second_order() -> None:
    mech = branch("spherical", True, damper=0.1)
    exact = end(mech, 8, 0.01, 0.2)
    sim = dojo.Simulator(mech, time_step=1e-3)
    q, v = random_state(np.random.default_rng(3), mech)
    coarse, fine = (
        dojo.Simulator(mech, time_step=h).rollout(
            dojo.Simulator(mech, time_step=h).start(q, v), np.zeros((round(0.2 / h), sim.nu))
        ).x[-1][: sim.nq]
        for h in (1e-3, 5e-4)
    )  # fmt: skip
    np.testing.assert_allclose(2.0 * fine - coarse, exact[: sim.nq], atol=1e-6)  # dampers are of first order there


@pytest.mark.parametrize("kind", ["spherical", "revolute", "prismatic"])
def test_momentum_stays_to_rounding(kind: str) -> None:
    mech = replace(branch(kind, False, spring=2.0), gravity=(0.0, 0.0, 0.0))
    sim = dojo.Simulator(mech, time_step=0.02, order=6)
    q, v = random_state(np.random.default_rng(1), mech, speed=2.0)
    x = sim.rollout(sim.start(q, v), np.zeros((500, sim.nu)), throw=True).x
    for part in sim.momentum(x):
        assert np.abs(part - part[0]).max() < 1e-12 * max(1.0, np.abs(part[0]).max())


def test_energy_stays_near_over_a_long_time() -> None:
    sim = dojo.Simulator(dojo.models.npendulum(2), time_step=0.02, order=4)
    x = sim.rollout(sim.start([0.4, 0.3], [0.0, 0.0]), np.zeros((5000, sim.nu)), throw=True).x
    e = sim.energy(x) - sim.energy(x[0])
    assert np.abs(e[-1000:]).max() < 2.0 * np.abs(e[:1000]).max() < 1e-5


@pytest.mark.parametrize("order", ORDERS)
def test_motion_runs_backwards_to_where_it_came_from(order: int) -> None:
    """The step is symmetric: with the velocity turned round, it leads back."""
    mech = branch("spherical", False)
    sim = dojo.Simulator(mech, time_step=0.05, order=order, tolerance=1e-13)
    q, v = random_state(np.random.default_rng(2), mech)
    x = sim.rollout(sim.start(q, v), np.zeros((10, sim.nu)), throw=True).x[-1].copy()
    x[sim.nq :] *= -1.0
    back = sim.rollout(x, np.zeros((10, sim.nu)), throw=True).x[-1].copy()
    back[sim.nq :] *= -1.0
    assert np.abs(sim.difference(back, np.r_[q, v])).max() < 1e-10


def test_states_have_the_velocity_of_the_node() -> None:
    mech = branch("cylindrical_free", False)
    sim, second = dojo.Simulator(mech, time_step=0.02, order=4), dojo.Simulator(mech, time_step=0.02)
    q, v = random_state(np.random.default_rng(5), mech)
    x, y = sim.start(q, v), second.start(q, v)
    np.testing.assert_array_equal(x, np.r_[q, v])
    np.testing.assert_array_equal(sim.velocity(x), v)
    assert abs(sim.energy(x) - second.energy(y)) < 1e-9
    np.testing.assert_allclose(np.hstack(sim.momentum(x)), np.hstack(second.momentum(y)), atol=1e-10)
    z = sim.maximal(x)
    np.testing.assert_allclose(z, second.bodies(q, v), atol=1e-12)
    assert np.abs(sim.difference(sim.minimal(z), x)).max() < 1e-10
    assert np.abs(second.maximal(y) - z).max() > 1e-4
    slow = sim.minimal(z + np.r_[0, 0, 0, 1e-3, np.zeros(9)], joint_tolerance=np.inf)
    assert 1e-5 < np.abs(sim.difference(slow, x)).max() < 1e-1


def test_batches_steps_and_copies_agree_with_rollouts() -> None:
    mech = branch("revolute", False)
    sim = dojo.Simulator(mech, time_step=0.01, order=4)
    q, v = random_state(np.random.default_rng(6), mech)
    us = np.random.default_rng(7).normal(size=(2, 5, sim.nu))
    x = sim.start(q, v)
    batch = sim.rollout_batch(np.tile(x, (2, 1)), us)
    copies = [pickle.loads(pickle.dumps(sim)), sim.replace(order=6).replace(order=4)]
    for run in (sim, *copies):
        np.testing.assert_array_equal(run.rollout(x, us[1]).x, batch.x[1])
    one = sim.step(x, us[0, 0])
    assert one.success and one.iterations >= 5
    np.testing.assert_allclose(one.x, batch.x[0, 1], atol=1e-12)
    assert "order 4" in sim.describe()


def test_a_body_that_turns_too_far_is_reported() -> None:
    sim = dojo.Simulator(dojo.models.npendulum(1), time_step=0.1, order=4)
    result = sim.step(sim.start([0.0], [300.0]))
    assert not result.success
    assert result.status in (dojo.Status.ANGULAR_STEP, dojo.Status.NO_PROGRESS)


@pytest.mark.parametrize(
    ("mechanism", "what"),
    [
        (dojo.models.block(), r"'block' has the contact '.*' and 7 more"),
        (replace(dojo.models.quadruped(), contacts=()), "limits of joint '.*' and 11 more"),
        (
            dojo.models.npendulum(2, damper=50.0),
            "joint 'joint_1': its damper slows motion down at .* use a time step below",
        ),
    ],
)
def test_what_cannot_run_backwards_is_refused(mechanism: Mechanism, what: str) -> None:
    with pytest.raises(ValueError, match=what):
        dojo.Simulator(mechanism, time_step=0.01, order=4)


def test_derivatives_and_unknown_orders_are_refused() -> None:
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01, order=4)
    x = sim.neutral()
    for call in (
        lambda: sim.linearize(x),
        lambda: sim.linearize_trajectory(x[None], np.zeros((1, 1))),
        lambda: sim.closed_loop(x, np.zeros((1, 1))),
        lambda: sim.maximal_jacobian(x),
        lambda: sim.minimal_jacobian(sim.maximal(x)),
    ):
        with pytest.raises(ValueError, match=r"order 4: .* those of order 2; use replace\(order=2\)"):
            call()
    with pytest.raises(ValueError, match=r"expected one of \(2, 4, 6, 8\), got 3"):
        dojo.Simulator(dojo.models.pendulum(), order=3)


def test_second_order_does_not_know_of_compositions() -> None:
    program = (
        "import sys, numpy as np, dojo_opt as dojo; sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01); "
        "sim.rollout(sim.neutral(), np.zeros((2, 1))); print([m for m in sys.modules if m in ('sim.composed', 'sim.composition')])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
