"""External wrenches: their effect on momentum, derivatives that hold them constant, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import ball, chain, random_state


def floating(rng):
    """Three free bodies in a chain, and wrenches on all of them at all times."""
    sim = dojo.Simulator(chain("spherical", 2), time_step=0.01)
    return sim, random_state(sim, rng), rng.normal(size=(20, 3, 6))


def test_momentum_is_their_integral(rng):
    """Forces add to the linear momentum, moments about the origin to the angular one, exactly."""
    sim, x, W = floating(rng)
    t = sim.rollout(x, np.zeros((20, sim.nu)), wrenches=W, throw=True)
    assert t.simulator is sim and t.u.shape == (20, sim.nu)
    linear, angular = sim.momentum(t.x)
    force, arms = W[:, :, :3], sim.maximal(t.x)[:-1, :, :3]
    moment = np.cross(arms, force) + W[:, :, 3:]
    expected = 0.01 * np.concatenate([force, moment], axis=2).sum(axis=1)
    np.testing.assert_allclose(np.diff(np.concatenate([linear, angular], axis=1), axis=0), expected, atol=1e-9)


def test_one_body_by_name_and_as_a_table_are_the_same(rng):
    sim, x, _ = floating(rng)
    wrench = rng.normal(size=6)
    table = np.zeros((20, 3, 6))
    table[:, 1] = wrench
    us = np.zeros((20, sim.nu))
    expected = sim.rollout(x, us, wrenches=table).x
    np.testing.assert_array_equal(sim.rollout(x, us, wrenches={"body1": wrench}).x, expected)
    np.testing.assert_array_equal(sim.rollout(x, us, wrenches={"body1": np.tile(wrench, (20, 1))}).x, expected)
    np.testing.assert_array_equal(sim.rollout(x, us, wrenches=table[0]).x, expected)
    np.testing.assert_array_equal(sim.step(x, wrenches={"body1": wrench}).x, expected[1])
    shot = sim.rollout_feedback(x, us, wrenches=table)
    np.testing.assert_allclose(shot.x, expected, atol=1e-7)
    assert shot.u.shape == (20, sim.nu)


def test_none_and_zero_are_the_same_simulator(rng):
    sim, x, W = floating(rng)
    us = np.zeros((20, sim.nu))
    np.testing.assert_array_equal(sim.rollout(x, us, wrenches=0.0 * W).x, sim.rollout(x, us).x)
    assert not sim.__dict__.get("_pushed")


def test_derivatives_agree_with_the_pushed_step(rng):
    """A and B of a ball that is pressed onto the ground, and gains of a policy."""
    sim = dojo.Simulator(ball(), time_step=0.01, kappa=1e-4, tolerance=1e-13)
    x = sim.neutral()
    x[2] = 0.1
    push = {"ball": np.array([0.5, 0.2, -20.0, 0.1, 0.0, 0.3])}
    A, B = sim.linearize(x, wrenches=push)
    after = sim.step(x, wrenches=push).x
    for J, change, n in ((A, lambda d: (sim.integrate(x, d), None), sim.ndx), (B, lambda d: (x, d), sim.nu)):
        for column, d in zip(J.T, 1e-5 * np.eye(n), strict=True):
            ends = [sim.step(*change(s * d), wrenches=push).x for s in (1.0, -1.0)]
            slope = (sim.difference(x1=ends[0], x0=after) - sim.difference(x1=ends[1], x0=after)) / 2e-5
            np.testing.assert_allclose(column, slope, atol=1e-5 * np.abs(J).max())
    lines = sim.linearize_trajectory(x[None], np.zeros((1, sim.nu)), wrenches=push)
    np.testing.assert_allclose(lines.B[0], B, atol=1e-9)
    K = np.zeros((3, sim.nu, sim.ndx))
    K[:, 2, 2] = -50.0
    shot = sim.rollout_feedback(
        x, np.zeros((3, sim.nu)), xs=np.tile(x, (4, 1)), Ks=K, limits=(-1.0, 1.0), wrenches={"ball": (1, 0, 0, 0, 0, 0)}
    )
    assert shot.solved_knots == 3 and shot.x[-1, sim.nq] > 0.02 and np.abs(shot.u).max() <= 1.0


@pytest.mark.parametrize(
    ("wrenches", "message"),
    [
        ({"leg": np.zeros(6)}, r"Simulator.rollout\(wrenches=...\): body: 'leg' is not one of: ball"),
        ({"ball": np.zeros(5)}, r"body 'ball': expected shape \(6,\), got \(5,\)"),
        (np.zeros((4, 1, 6)), r"expected shape \(3, 1, 6\), got \(4, 1, 6\)"),
        ({"ball": np.full(6, np.nan)}, "expected finite numbers"),
    ],
)
def test_bad_wrenches_are_refused(wrenches, message):
    sim = dojo.Simulator(ball(), time_step=0.01)
    with pytest.raises(ValueError, match=message):
        sim.rollout(sim.neutral(), np.zeros((3, sim.nu)), wrenches=wrenches)


def test_gradients_of_a_pushed_rollout(rng):
    """By state, input and parameters: forward at every knot, backward along the whole, against differences."""
    sim = dojo.Simulator(ball(), time_step=0.01, kappa=1e-4, tolerance=1e-13)
    x, T = sim.neutral(), 15
    x[2] = 0.12
    push = {"ball": np.r_[0.5, 0.2, -3.0, 0.1, 0.0, 0.3] * np.ones((T, 1))}
    us = 0.1 * rng.normal(size=(T, sim.nu))
    t = sim.rollout(x, us, wrenches=push, throw=True)
    assert t.wrenches is not None and t.wrenches.shape == (T, 1, 6) and sim.rollout(x, us).wrenches is None
    wrt = ("state", "input", "mass", "friction", "gravity", "time_step")
    loss = rng.normal(size=(T + 1, sim.ndx))
    g = sim.vjp(t, loss, wrt=wrt)
    assert g["input"].shape == (T, sim.nu)
    xs, lines = sim.linearize_rollout(x, us, wrt=("mass", "friction"), wrenches=push)
    np.testing.assert_allclose(xs, t.x, atol=1e-9)
    one = sim.linearize(xs[4], us[4], wrenches={"ball": push["ball"][4]}, wrt=wrt)
    np.testing.assert_allclose(lines.parameters["mass"][4], one["mass"], atol=1e-8)
    np.testing.assert_allclose(lines.B[4], one["input"], atol=1e-8)

    def value(other, start, inputs):
        return np.sum(loss * sim.difference(other.rollout(start, inputs, wrenches=push, throw=True).x, t.x))

    e = 1e-6
    for name in ("mass:ball", "friction:*", "gravity[2]", "time_step"):
        p = float(sim.parameters((name,)).values[0])
        ends = [value(sim.with_parameters({name: p + s * e}), x, us) for s in (1.0, -1.0)]
        got = g["gravity"][2] if name == "gravity[2]" else g[name.split(":")[0]].sum()
        np.testing.assert_allclose(got, (ends[0] - ends[1]) / (2 * e), rtol=1e-5)
    dx, du = rng.normal(size=sim.ndx), rng.normal(size=us.shape)
    ends = [value(sim, sim.integrate(x, s * e * dx), us + s * e * du) for s in (1.0, -1.0)]
    np.testing.assert_allclose(g["state"] @ dx + np.sum(g["input"] * du), (ends[0] - ends[1]) / (2 * e), rtol=1e-5)


def test_reactions_of_a_pushed_pendulum():
    """The joint carries weight and push of a body that hangs at rest."""
    body = dojo.Body("bob", 2.0, shape=dojo.Sphere(0.1))
    joint = dojo.Joint("fixed", None, "bob", child_point=(0, 0, 1))
    hinge = dojo.Joint("revolute", "bob", "tail", axis=(0, 1, 0), parent_point=(0, 0, -1), child_point=(0, 0, 1))
    tail = dojo.Body("tail", 1.0, shape=dojo.Sphere(0.1))
    sim = dojo.Simulator(dojo.Mechanism([body, tail], [joint, hinge]), time_step=0.01)
    r = sim.reactions(sim.neutral(), wrenches={"bob": (3.0, 0, 0, 0, 0, 0)})
    np.testing.assert_allclose(r["bob"].force, [-3.0, 0, 3 * 9.81], atol=1e-8)
    np.testing.assert_allclose(r["bob"].torque, [0, 3.0, 0], atol=1e-8)
    many = sim.reactions(np.tile(sim.neutral(), (2, 1)), wrenches={"bob": (3.0, 0, 0, 0, 0, 0)})
    np.testing.assert_allclose(many.force[1], r.force)
