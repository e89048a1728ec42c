"""The Simulator's interface: arguments, results, and error messages."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt import models
from sim.simulator.simulator import Simulator

SIM = Simulator(models.raiberthopper(), time_step=0.01)
PENDULUM = Simulator(models.double_pendulum(), time_step=0.01)
X = SIM.neutral()


def state(**changes: float) -> np.ndarray:
    """The standing hopper with some entries replaced."""
    x = X.copy()
    for key, value in changes.items():
        x[int(key[1:])] = value
    return x


def maximal(**changes: float) -> np.ndarray:
    """Its maximal state with some entries replaced, by flat index."""
    z = SIM.maximal(X)
    for key, value in changes.items():
        z.reshape(-1)[int(key[1:])] = value
    return z


def test_sizes() -> None:
    assert (SIM.nbody, SIM.nq, SIM.nv, SIM.nx, SIM.ndx, SIM.nu, SIM.ncontact) == (2, 8, 7, 15, 14, 3, 2)
    weight = 9.81 * sum(body.mass for body in SIM.mechanism.bodies)
    assert (SIM.time_step, SIM.kappa, SIM.tolerance) == (0.01, pytest.approx(1e-11 * weight), 1e-8)


def test_settings_are_fixed() -> None:
    with pytest.raises(AttributeError, match=r"Simulator.time_step: .*use replace\(time_step="):
        SIM.time_step = 0.1


def test_replace() -> None:
    other = SIM.replace(time_step=0.05, friction=0.9, gravity=(0, 0, -1.62), kappa=1e-4)
    assert (other.time_step, other.kappa, other.tolerance) == (0.05, 1e-4, SIM.tolerance)
    assert [c.friction for c in other.mechanism.contacts] == [0.9, 0.9]
    assert other.mechanism.gravity == (0.0, 0.0, -1.62)
    assert [c.friction for c in SIM.mechanism.contacts] == [0.5, 0.5]
    only = SIM.replace(friction={"foot": 1.2}, law="linear").mechanism.contacts
    assert [(c.name, c.friction, c.law) for c in only] == [("foot", 1.2, "linear"), ("body", 0.5, "linear")]


def test_replace_reaches_collisions() -> None:
    mech = dojo.Mechanism(
        bodies=[dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in "ab"],
        joints=[dojo.Joint("floating", None, name) for name in "ab"],
        contacts=[dojo.Contact("a", radius=0.1, name="floor")],
        collisions=[dojo.Collision("a", "b", name="pair")],
    )
    sim = dojo.Simulator(mech)
    every, one = sim.replace(friction=0.9, law="linear").mechanism, sim.replace(friction={"pair": 0.2}).mechanism
    assert [(c.friction, c.law) for c in (*every.contacts, *every.collisions)] == [(0.9, "linear")] * 2
    assert [c.friction for c in (*one.contacts, *one.collisions)] == [mech.contacts[0].friction, 0.2]


def test_pickle() -> None:
    other = pickle.loads(pickle.dumps(SIM))
    assert other.mechanism == SIM.mechanism and repr(other) == repr(SIM)
    for mine, theirs in zip(SIM.model, other.model, strict=True):
        np.testing.assert_array_equal(mine, theirs)


def test_describe_lists_present_and_missing_features() -> None:
    text = SIM.describe()
    for word in (
        "raiberthopper: 2 bodies, 7 degrees",
        "leg",
        "q[7], v[6]",
        "u[0]  torque_x",
        "2 cones",
        "interior point",
    ):
        assert word in text
    assert "joint limits      omitted" in text
    text = PENDULUM.describe()
    for word in (
        "contacts          omitted",
        "Newton's method; interior point omitted",
        "springs           omitted",
    ):
        assert word in text


def test_leading_axes() -> None:
    xs = np.tile(X, (4, 3, 1))
    assert SIM.maximal(xs).shape == (4, 3, 2, 13)
    assert SIM.minimal(SIM.maximal(xs)).shape == xs.shape
    assert SIM.energy(xs).shape == (4, 3) and isinstance(SIM.energy(X), float)
    linear, angular = SIM.momentum(xs[0])
    assert linear.shape == angular.shape == (3, 3)


def test_inputs_are_not_written_to() -> None:
    x = state(_3=1.0 + 1e-8)
    before = x.copy()
    SIM.energy(x), SIM.maximal(x), SIM.step(x)
    np.testing.assert_array_equal(x, before)


def test_lists_and_other_types_are_welcome() -> None:
    assert SIM.energy(X.tolist()) == SIM.energy(X)
    assert PENDULUM.energy(np.zeros(4, dtype=np.float32)) == PENDULUM.energy(np.zeros(4, dtype=int))
    wide = np.zeros((4, 8))
    wide[:, 0] = 0.3
    assert PENDULUM.energy(wide[:, ::8].ravel()) == PENDULUM.energy([0.3] * 4)


def test_jacobians_of_maximal_and_minimal() -> None:
    x = SIM.integrate(X, 0.3 * np.random.default_rng(0).normal(size=14))
    back, forward = SIM.minimal_jacobian(SIM.maximal(x)), SIM.maximal_jacobian(x)
    assert forward.shape == (24, 14)
    np.testing.assert_allclose(back @ forward, np.eye(14), atol=1e-10)


def test_minimal_of_violated_joints() -> None:
    z = maximal(_13=0.01)  # the foot 1 cm to the side
    with pytest.raises(ValueError, match=r"Simulator.minimal\(z\): joint 'leg' is violated by 1.0e-02"):
        SIM.minimal(z)
    assert SIM.minimal(z, joint_tolerance=np.inf)[7] == pytest.approx(0.5)


ERRORS: list[tuple[Callable[[], object], str]] = [
    (lambda: Simulator("hopper"), r"Simulator\(mechanism\): expected a Mechanism, got 'hopper'"),
    (lambda: Simulator(SIM.mechanism, time_step=0), r"Simulator\(time_step=\.\.\.\): expected a number > 0, got 0"),
    (lambda: Simulator(SIM.mechanism, kappa=-1), r"Simulator\(kappa=\.\.\.\): expected a number > 0"),
    (lambda: Simulator(SIM.mechanism, tolerance=np.nan), r"Simulator\(tolerance=\.\.\.\): .* got nan"),
    (
        lambda: Simulator(SIM.mechanism, max_iterations=0),
        r"Simulator\(max_iterations=\.\.\.\): expected a whole number",
    ),
    (lambda: SIM.replace(timestep=0.1), r"Simulator.replace\(\.\.\.\): 'timestep' is not one of: mechanism, time_step"),
    (
        lambda: SIM.replace(friction={"toe": 1}),
        r"Simulator.replace\(friction=\.\.\.\): 'toe' is not one of: foot, body",
    ),
    (lambda: SIM.step(X[:5]), r"Simulator.step\(x\): expected shape \(15,\), got \(5,\)"),
    (lambda: SIM.step("zero"), r"Simulator.step\(x\): expected real numbers, got 'zero'"),
    (lambda: SIM.step(X + 1j), r"Simulator.step\(x\): expected real numbers"),
    (lambda: SIM.step(state(_9=np.nan)), r"Simulator.step\(x\): expected finite numbers, got nan at index 9"),
    (lambda: SIM.step(state(_3=0.5)), r"Simulator.step\(x\): joint 'body': expected a unit quaternion, got length 0.5"),
    (lambda: SIM.step(X, np.zeros(2)), r"Simulator.step\(u\): expected shape \(3,\), got \(2,\)"),
    (lambda: SIM.step(X, [0, np.inf, 0]), r"Simulator.step\(u\): expected finite numbers, got inf at index 1"),
    (lambda: SIM.rollout(X, np.zeros((4, 2))), r"Simulator.rollout\(us\): expected shape \(T, 3\), got \(4, 2\)"),
    (lambda: SIM.rollout(X, np.full((4, 3), np.nan)), r"Simulator.rollout\(us\): .* got nan at index \(0, 0\)"),
    (lambda: SIM.rollout_batch(X, np.zeros((2, 4, 3))), r"rollout_batch\(x0s\): expected shape \(2, 15\), got \(15,\)"),
    (lambda: SIM.linearize(X, kappa=0), r"Simulator.linearize\(kappa=\.\.\.\): expected a number > 0"),
    (lambda: SIM.linearize_trajectory([X] * 3, np.zeros((5, 3))), r"\(xs\): expected 5 or 6 states, got 3"),
    (lambda: SIM.linearize_trajectory([X, state(_3=2)], np.zeros((2, 3))), r"joint 'body' in row 1: expected a unit"),
    (
        lambda: SIM.linearize_trajectory([X], np.zeros((1, 3)), substeps=0),
        r"\(substeps=\.\.\.\): expected a whole number",
    ),
    (
        lambda: SIM.rollout_feedback(X, np.zeros((4, 3)), Ks=np.zeros((4, 3, 14))),
        r"rollout_feedback\(Ks=.*gains need reference states",
    ),
    (
        lambda: SIM.rollout_feedback(X, np.zeros((4, 3)), ks=np.zeros(3)),
        r"rollout_feedback\(ks=.*expected shape \(4, 3\)",
    ),
    (lambda: SIM.rollout_feedback(X, np.zeros((4, 3)), limits=(1, -1)), r"rollout_feedback\(limits=.*lower <= upper"),
    (
        lambda: SIM.rollout_feedback(X, np.zeros((4, 3)), limits=(1, [1, 2])),
        r"rollout_feedback\(limits=.*as wide as u \(3\)",
    ),
    (lambda: SIM.rollout_feedback(X, np.zeros((4, 3)), alpha=np.nan), r"rollout_feedback\(alpha=.* got nan"),
    (
        lambda: SIM.state_from_velocity(np.zeros(8), np.zeros(7)),
        r"Simulator.state_from_velocity\(q\): joint 'body': expected a unit quaternion",
    ),
    (
        lambda: SIM.state_from_velocity(X[:8], np.zeros(6)),
        r"Simulator.state_from_velocity\(v\): expected shape \(7,\), got \(6,\)",
    ),
    (lambda: SIM.energy(np.zeros((2, 3))), r"Simulator.energy\(x\): expected shape \(\.\.\., 15\), got \(2, 3\)"),
    (lambda: SIM.integrate(X, X), r"Simulator.integrate\(dx\): expected shape \(14,\), got \(15,\)"),
    (lambda: SIM.maximal(np.zeros(3)), r"Simulator.maximal\(x\): expected shape \(15,\), got \(3,\)"),
    (lambda: SIM.minimal(np.zeros((3, 13))), r"Simulator.minimal\(z\): expected shape \(2, 13\), got \(3, 13\)"),
    (lambda: SIM.minimal(maximal(_6=0.1)), r"Simulator.minimal\(z\): body 'body': expected a unit quaternion"),
    (lambda: SIM.minimal(maximal(_23=400.0)), r"Simulator.minimal\(z\): body 'foot': A body turns by half a turn"),
]


@pytest.mark.parametrize(("call", "message"), ERRORS, ids=[m[:60] for _, m in ERRORS])
def test_errors_name_the_call_and_the_culprit(call: Callable[[], object], message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        call()
