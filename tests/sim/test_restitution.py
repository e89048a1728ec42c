"""Restitution: heights of bounces, rest in the end, no gain of energy, and derivatives through an impact."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import dojo_opt as dojo
from support.hills import WAVES, derivatives_of
from support.scenes import ball, block, chain, random_state, run

LEVEL = dojo.Terrain.slope(0.0)


def bouncing(mech, e):
    """The mechanism with contacts that give back e; it stands on the ground."""
    mech = dataclasses.replace(mech, contacts=[dataclasses.replace(c, restitution=e) for c in mech.contacts])
    return mech if mech.contacts[0].terrain else mech.with_terrain(LEVEL)


def apex(mech, h, height=0.5):
    """Height of the first bounce of a fall from `height` [m]."""
    sim = dojo.Simulator(mech, time_step=h, kappa=1e-10, tolerance=1e-10)
    x = sim.neutral()
    x[2] += height
    z = run(sim, x, round(1.2 / h))[:, 2] - sim.neutral()[2]
    return z[np.argmin(z[: round(0.4 / h)]) :].max()


@pytest.mark.parametrize("e", [0.3, 0.8, 1.0])
def test_a_bounce_goes_to_e_squared_of_the_height(e):
    """To first order in the time step; without loss at e = 1 to the rounding of an impact between two nodes."""
    errors = [abs(apex(bouncing(ball(), e), h) - e**2 * 0.5) for h in (0.01, 0.005, 0.0025, 0.00125)]
    assert errors[-1] < 0.004
    assert errors[-1] < 0.4 * errors[0] or errors[0] < 1e-6


def test_a_box_that_falls_flat_bounces_as_the_ball():
    assert apex(bouncing(block(0.3), 0.7), 0.002) == pytest.approx(0.49 * 0.5, abs=0.01)


@pytest.mark.parametrize("e", [0.5, 0.9])
def test_it_rests_in_the_end(e):
    """Bounces die out: no chatter, no penetration on the way, and the height of rest of an inelastic contact."""
    sims = [dojo.Simulator(bouncing(ball(), r), time_step=0.01, kappa=1e-8, tolerance=1e-10) for r in (e, 0.0)]
    x = sims[0].neutral()
    x[2] += 0.2
    seconds = 3.0 if e < 0.8 else 12.0
    rows = run(sims[0], x, round(seconds / 0.01))
    assert rows[:, 2].min() > 0.1
    assert np.abs(rows[-50:, sims[0].nq :]).max() < 1e-6
    inelastic = run(sims[1], x, 100)
    assert rows[-1, 2] == pytest.approx(inelastic[-1, 2], abs=1e-9)


@pytest.mark.parametrize("e", [0.5, 1.0])
@pytest.mark.parametrize("friction", [0.0, 0.8])
def test_impacts_give_no_energy(e, friction, rng):
    """Tumbling blocks and chains: no impact adds energy, whatever turns on the way."""
    chains = chain("revolute", 2, gravity=(0.0, 0.0, -9.81))
    tips = [dojo.Contact(f"body{k}", (0.2, 0.1, -0.2), 0.05, friction=friction) for k in range(3)]
    for mech in (block(0.4, friction=friction), dataclasses.replace(chains, contacts=tips)):
        sim = dojo.Simulator(bouncing(mech, e), time_step=5e-4, kappa=1e-10, tolerance=1e-10)
        for _ in range(4):
            x = random_state(sim, rng, 2.0, 0.7)
            x[2] = 1.0
            energy = sim.energy(run(sim, x, 1500))
            assert (energy - energy[0]).max() < 0.002 * energy[0]


def test_kane_s_double_pendulum_does_not_gain():
    """Two rods swing with a tip onto rough ground: Newton's law alone would give energy in some of these states."""
    length, mass, e = 1.0, 1.0, 1.0
    inertia = mass * length**2 / 12.0 * np.array([1.0, 1.0, 0.01])
    up = np.array([0.0, 0.0, 0.5 * length])
    bodies = [dojo.Body("upper", mass, inertia), dojo.Body("lower", mass, inertia)]
    joints = [
        dojo.Joint("revolute", None, "upper", axis=(0, 1, 0), parent_point=(0, 0, 1.5), child_point=up),
        dojo.Joint("revolute", "upper", "lower", axis=(0, 1, 0), parent_point=-up, child_point=up),
    ]
    tip = dojo.Contact("lower", -up, friction=0.5, restitution=e)
    mech = dojo.Mechanism(bodies, joints, [tip], gravity=(0.0, 0.0, 0.0))
    sim = dojo.Simulator(mech, time_step=1e-4, kappa=1e-12, tolerance=1e-12)

    def gap(q):
        return 1.5 - np.cos(q[0]) - np.cos(q.sum())

    gains, rebounds = [], []
    for first in np.linspace(-1.0, 1.0, 11):
        bend = np.arccos(1.5 - np.cos(first))
        for q in (np.array([first, bend - first]), np.array([first, -bend - first])):
            for v in ((1.0, 0.0), (0.0, 1.0), (1.0, -2.0), (-1.0, 3.0)):
                v = np.array(v) * (1.0 if gap(q + 1e-4 * np.array(v)) < 0.0 else -1.0)  # towards the ground
                x = np.r_[q - 0.5e-4 * v, v]
                t = sim.rollout(x, np.zeros((3, 2)), throw=True)
                gains.append(sim.kinetic_energy(t.x[-1]) / sim.kinetic_energy(x) - 1.0)
                rebounds.append((gap(t.x[-1, :2]) - gap(t.x[-2, :2])) / (gap(x[:2]) - gap(x[:2] + 1e-4 * v)))
    assert max(gains) < 1e-3
    assert max(rebounds) == pytest.approx(e, abs=0.01)
    assert min(rebounds) < 0.6  # some states had to give back less


@pytest.mark.sweep(2)
@pytest.mark.parametrize("kappa", [1e-2, 1e-4])
@pytest.mark.parametrize("law", ["impact", "linear", "nonlinear"])
def test_derivatives_through_an_impact(law, kappa):
    """Of the branch that is taken, on level ground and on waves, of a ball and of several contacts at once."""
    for mech in (ball(radius=0.1, law=law), block(0.3, law=law), ball(radius=0.2, law=law).with_terrain(WAVES)):
        sim = dojo.Simulator(bouncing(mech, 0.7), time_step=0.01)
        x = sim.neutral()
        x[2] += 0.005
        x[sim.nq :] = 0.4, 0.3, -2.0, 0.3, -0.2, 0.5
        result = derivatives_of(sim.mechanism, x, kappa)
        assert result.x[sim.nq + 2] > 0.5


def test_impacts_converge_with_the_time_step():
    """The time of the third impact, which sums the errors of two bounces."""
    e, height = 0.6, 0.3
    fall = np.sqrt(2.0 * height / 9.81)
    expected = fall * (1.0 + 2.0 * e + 2.0 * e**2)
    errors = []
    for h in (0.004, 0.002, 0.001):
        sim = dojo.Simulator(bouncing(ball(), e), time_step=h, kappa=1e-10, tolerance=1e-10)
        x = sim.neutral()
        x[2] += height
        t = sim.rollout(x, np.zeros((round(1.1 / h), sim.nu)), throw=True)
        hits = np.flatnonzero(t.contacts.normal_force[:, 0] > 5.0 * 9.81)
        errors.append(abs(h * hits[2] - expected))
    assert errors[-1] < 2e-3 and errors[0] < 8e-3, errors


@pytest.mark.parametrize("e", [0.2, 0.5, 0.9, 1.0])
def test_heights_of_bounces_at_many_heights_and_time_steps(e):
    """e^2 of the height, off by first order in the time step: an impact is at a node, and the apex between two."""
    for height in (0.05, 0.5, 2.0):
        fall = np.sqrt(2.0 * height / 9.81)
        for h in (0.01, 0.004, 0.001):
            sim = dojo.Simulator(bouncing(ball(), e), time_step=h, kappa=1e-10, tolerance=1e-10)
            x = sim.neutral()
            x[2] += height
            z = run(sim, x, round((1.0 + e) * fall / h) + 2)[:, 2] - sim.neutral()[2]
            top = z[np.argmin(z[: round(1.5 * fall / h)]) :].max()
            assert abs(top - e**2 * height) < 2.0 * h / fall * height, (height, h)
            assert top < (1.0 + 1e-3) * height


def cradle(count, gap):
    """Velocities of equal balls, e = 1, `gap` [m] apart, after the first one hit them at 1 m/s; their energies."""
    names = [f"b{k}" for k in range(count)]
    bodies = [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in names]
    joints = [dojo.Joint("prismatic", None, name, axis=(1, 0, 0)) for name in names]
    touch = [dojo.Collision(a, b, friction=0.0, restitution=1.0) for a, b in zip(names, names[1:], strict=False)]
    sim = dojo.Simulator(
        dojo.Mechanism(bodies, joints, collisions=touch, gravity=(0, 0, 0)),
        time_step=1e-3,
        kappa=1e-12,
        tolerance=1e-10,
    )
    at = np.r_[0.0, 0.25 + (0.2 + gap) * np.arange(count - 1)]
    t = sim.rollout(np.r_[at, 1.0, np.zeros(count - 1)], np.zeros((200, sim.nu)), throw=True)
    return t.x[-1, count:], sim.energy(t.x)


@pytest.mark.parametrize("count", [3, 5])
def test_newton_s_cradle(count):
    """Balls apart by more than the way of a step pass the impact on, one by one; the last one leaves with all of it. Balls
    that touch are hit at once, which Newton's law leaves open: they leave together, and the first one comes back, with
    the same momentum and energy.
    """
    apart, energy = cradle(count, 0.005)
    np.testing.assert_allclose(apart, [*np.zeros(count - 1), 1.0], atol=2e-3)
    assert (energy - energy[0]).max() < 1e-6
    touching, energy = cradle(count, 1e-6)
    assert touching.sum() == pytest.approx(1.0, abs=1e-8)
    np.testing.assert_allclose(touching, [2.0 / count - 1.0, *np.full(count - 1, 2.0 / count)], atol=5e-3)
    assert (energy - energy[0]).max() < 1e-6


def test_balls_exchange_their_momentum():
    """Newton's law between two bodies in space: relative speeds before and after, and momentum."""
    e = 0.8
    two = ball(gravity=(0.0, 0.0, 0.0)).add(ball(mass=3.0, gravity=(0.0, 0.0, 0.0)), (1.0, 0.0, 0.0), "other ")
    mech = dataclasses.replace(two, contacts=())
    touch = dojo.Collision("ball", "other ball", dojo.Sphere(0.1), dojo.Sphere(0.1), restitution=e)
    sim = dojo.Simulator(mech.with_collisions(touch), time_step=0.01, kappa=1e-10, tolerance=1e-11)
    x = sim.neutral()
    x[sim.nq] = 2.0
    last = run(sim, x, 60)[-1, sim.nq :]
    assert last[0] + 3.0 * last[6] == pytest.approx(2.0, abs=1e-9)
    assert last[6] - last[0] == pytest.approx(2.0 * e, rel=1e-3)


@pytest.mark.parametrize("kappa", [1e-2, 1e-4])
def test_derivatives_of_an_impact_between_bodies(kappa):
    """A ball hits the end of a chain; both move, turn, and rub."""
    links = chain("revolute", 1)
    mech = dataclasses.replace(ball(gravity=(0.0, 0.0, 0.0)), contacts=()).add(links, (1.0, 0.0, 0.0))
    touch = dojo.Collision("ball", "body0", dojo.Sphere(0.1), dojo.Box(0.3, 0.3, 0.3), restitution=0.6)
    sim = dojo.Simulator(mech.with_collisions(touch), time_step=0.01)
    x = sim.neutral()
    x[:3] = 1.0 - 0.15 - 0.1 - 0.01, 0.03, 0.02
    x[sim.nq :] = 2.0, 0.3, -0.2, 0.5, -0.4, 1.0, -0.3, 0.1, 0.2, 0.3, 0.2, -0.1, 0.5
    result = derivatives_of(sim.mechanism, x, kappa)
    assert result.x[sim.nq] < 1.0
