"""Reference gaits: feet stay where they stand, velocities belong to positions, periods repeat."""

from dataclasses import replace

import numpy as np
import pytest

from dojo_opt import gaits, models
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.gaits.feet import Feet
from sim.simulator.simulator import Simulator

PERIODIC = {
    "trot": {"period": 0.4},
    "pace": {},
    "bound": {},
    "walk": {"period": 0.8},
    "hop": {},
    "turn": {"period": 0.4},
}


@pytest.fixture(scope="module")
def sim():
    return Simulator(models.quadruped(damper=0.5), time_step=0.02)


@pytest.fixture(scope="module", params=PERIODIC)
def gait(request, sim):
    made = getattr(gaits, request.param)(sim, **PERIODIC[request.param])
    assert made.name == {"turn": "trot"}.get(request.param, request.param)
    return made


def test_every_row_is_a_state_reached_with_its_velocity(sim, gait):
    h, nq = sim.time_step, sim.nq
    following = gait.x[1:].copy()
    back = sim.integrate(
        following, np.concatenate([-h * following[:, nq:], np.zeros((len(following), sim.nv))], axis=1)
    )
    np.testing.assert_allclose(sim.difference(back, gait.x[:-1])[:, : sim.nv], 0.0, atol=1e-9)
    np.testing.assert_allclose(gait.time, h * np.arange(len(gait.x)), atol=1e-12)


def test_velocities_are_at_the_rows_where_those_of_the_states_are(sim):
    """Where the mean velocities of states of order 2 are half a step late."""
    settings = {"speed": 0.3, "heading_rate": 1.0, "period": 0.4, "cycles": 1}
    fine = gaits.trot(sim.replace(time_step=1e-3), **settings).x[::20, sim.nq :]
    means, nodes = (gaits.trot(sim.replace(order=order), **settings).x[:, sim.nq :] for order in (2, 4))
    late, off = (np.sqrt(np.mean((v - fine)[1:-1] ** 2)) for v in (means, nodes))
    assert off < 0.4 * late, (off, late)  # feet that lift off have kinks


def test_motions_follow_only_where_the_first_ends(sim):
    stand = gaits.stand(sim, duration=0.1)
    both = stand.then(gaits.jump(sim))
    np.testing.assert_allclose(np.diff(both.time), sim.time_step, atol=1e-12)
    biped = Simulator(models.atlas(), time_step=sim.time_step)
    refused = {
        "time steps of 0.02 s, got 0.01 s": gaits.stand(sim.replace(time_step=0.01), duration=0.1),
        "of 'quadruped', got 'atlas'": gaits.stand(biped, duration=0.1),
        r"stand -> trot\): it begins 0\..* from where this motion ends, in": gaits.trot(sim, speed=0.5, period=0.4),
    }
    for message, other in refused.items():
        with pytest.raises(ValueError, match=message):
            stand.then(other)
    with pytest.raises(TypeError, match=r"Gait\.then: expected a Gait, got 3"):
        stand.then(3)


def test_feet_are_where_the_states_put_them(sim, gait):
    np.testing.assert_allclose(Feet(sim).positions(gait.x), gait.feet, atol=1e-8)


def test_feet_on_the_ground_stand_still_and_others_are_above(gait):
    standing = gait.contact[1:] & gait.contact[:-1]
    moved = np.linalg.norm(np.diff(gait.feet, axis=0), axis=2)
    assert moved[standing].max() < 1e-9
    lowest = gait.feet[..., 2].min()
    assert gait.feet[gait.contact][:, 2].max() < lowest + 1e-9
    swinging = ~gait.contact
    assert gait.feet[swinging][:, 2].max() > lowest + 0.03
    # each foot carries for its share of the period, and at its lift-off
    assert 0.0 < gait.contact.mean() < 1.0


def test_a_period_repeats_itself(sim, gait):
    half = (len(gait.x) - 1) // 2  # two cycles
    first, second = sim.difference(gait.x[half], gait.x[0]), sim.difference(gait.x[-1], gait.x[half])
    if gait.name == "trot" and abs(first[5]) > 1e-9:  # the turn: the place turns with it
        np.testing.assert_allclose(first[6:], second[6:], atol=1e-9)
        assert first[5] == pytest.approx(0.5 * 0.4)
    else:
        np.testing.assert_allclose(first, second, atol=1e-9)
    np.testing.assert_allclose(gait.x[half, sim.nq + 6 :], gait.x[0, sim.nq + 6 :], atol=1e-9)
    assert np.array_equal(gait.contact[0], gait.contact[half])


@pytest.mark.parametrize(
    "name, together",
    [("trot", [(0, 3), (1, 2)]), ("pace", [(0, 2), (1, 3)]), ("bound", [(2, 3), (0, 1)]), ("hop", [(0, 1), (2, 3)])],
)
def test_which_feet_move_together(sim, name, together):
    g = getattr(gaits, name)(sim, **PERIODIC[name])
    for a, b in together:
        assert np.array_equal(g.contact[:, a], g.contact[:, b])
    if name != "hop":
        assert not np.array_equal(g.contact[:, together[0][0]], g.contact[:, together[1][0]])


def test_walk_lifts_one_foot_at_a_time(sim):
    g = gaits.walk(sim, **PERIODIC["walk"])
    assert g.contact.sum(axis=1).min() >= 3


def test_bound_and_hop_fly(sim):
    for g in (gaits.bound(sim), gaits.hop(sim)):
        assert not g.contact.any(axis=1).all()


def test_speed_height_and_heading(sim):
    g = gaits.trot(sim, speed=0.3, lateral=-0.1, period=0.4, cycles=3, height=0.28, step_height=0.07)
    np.testing.assert_allclose(g.x[-1, :2] - g.x[0, :2], [0.36, -0.12], atol=1e-9)
    np.testing.assert_allclose(g.x[:, 2].mean(), 0.28, atol=1e-3)
    assert g.feet[..., 2].max() - g.feet[..., 2].min() == pytest.approx(0.07, rel=2e-2)
    g = gaits.trot(sim, speed=0.3, heading_rate=1.0, period=0.4)
    yaw = sim.difference(g.x[-1], g.x[0])[5]
    assert yaw == pytest.approx(0.8, abs=1e-3)
    velocity = np.linalg.norm(g.x[1:, sim.nq : sim.nq + 2], axis=1)
    np.testing.assert_allclose(velocity, 0.3, rtol=1e-4)


def test_jump_lands_where_it_should(sim):
    g = gaits.jump(sim, distance=0.3, height=0.2)
    np.testing.assert_allclose(g.x[-1, :2] - g.x[0, :2], [0.3, 0.0], atol=1e-9)
    np.testing.assert_allclose(g.feet[-1] - g.feet[0], np.tile([0.3, 0.0, 0.0], (4, 1)), atol=1e-9)
    assert g.x[:, 2].max() - g.x[0, 2] == pytest.approx(0.2, abs=5e-3)
    air = ~g.contact.any(axis=1)
    height = g.x[air, 2]
    fall = np.diff(height, n=2) / sim.time_step**2
    np.testing.assert_allclose(fall, -9.81, rtol=0.1)  # the flight is rounded to whole steps
    np.testing.assert_array_equal(g.x[0, sim.nq :], 0.0)
    # its end is at rest, too: the mean velocity of the last step is of first order, and half with half the step
    finer = gaits.jump(sim.replace(time_step=sim.time_step / 2), distance=0.3, height=0.2)
    np.testing.assert_allclose(g.x[-1, sim.nq :], 2.0 * finer.x[-1, sim.nq :], atol=2e-3)


def test_jump_and_trot_know_the_gravity_of_the_scene(sim):
    """On the Moon a flight takes 2.5 times as long, and feet carry a sixth of the weight."""
    moon = Simulator(replace(sim.mechanism, gravity=(0.0, 0.0, -1.62)), sim.time_step)
    g = gaits.jump(moon, distance=0.3, height=0.2)
    fall = np.diff(g.x[~g.contact.any(axis=1), 2], n=2) / moon.time_step**2
    np.testing.assert_allclose(fall, -1.62, rtol=0.1)
    here, there = (np.ptp(gaits.trot(s, speed=0.2, period=0.5).x[:, 2]) for s in (sim, moon))
    assert there == pytest.approx(1.62 / 9.81 * here, rel=1e-6)
    with pytest.raises(ValueError, match=r"gaits\.jump\(sim\): 'quadruped' has no gravity"):
        gaits.jump(Simulator(replace(sim.mechanism, gravity=(0.0, 0.0, 0.0)), sim.time_step))


def test_standing_takes_the_torques_of_equilibrium(sim):
    g = gaits.stand(sim, duration=0.1)
    us = g.torques()
    assert us.shape == (5, 12)
    np.testing.assert_allclose(us, np.tile(equilibrium(sim)[1], (5, 1)), atol=2e-2)


@pytest.mark.parametrize("order", [4, 8])
@pytest.mark.parametrize("damper", [0.0, 0.5])
def test_standing_stands_with_steps_of_higher_order(order, damper):
    """With a damper that is too stiff for order 4, and with springs."""
    plain = Simulator(models.quadruped(damper=damper, spring=damper), time_step=0.02)
    first, g = (gaits.stand(sim, duration=0.2) for sim in (plain, plain.replace(order=order)))
    us = g.torques()
    np.testing.assert_allclose(us, first.torques(), atol=1e-6)
    ends = g.simulator.rollout(g.x[0], us).x[-1], plain.rollout(first.x[0], us).x[-1]
    np.testing.assert_allclose(ends[0][: plain.nq], ends[1][: plain.nq], atol=1e-9)


def test_torques_move_the_reference_as_it_moves(sim):
    g = gaits.trot(sim, speed=0.2, period=0.4)
    us = g.torques()
    linear = sim.linearize_trajectory(g.x, us)
    gaps = sim.difference(linear.x_next, g.x[1:])[:, : sim.nv]
    idle = sim.linearize_trajectory(g.x, np.zeros_like(us))
    fallen = sim.difference(idle.x_next, g.x[1:])[:, : sim.nv]
    assert np.all(linear.status == 0) and np.sqrt((gaps**2).mean()) < 0.25 * np.sqrt((fallen**2).mean())


@pytest.mark.parametrize(
    "name, settings, message",
    [
        ("trot", {"duty": 1.0}, r"gaits.trot\(duty=...\): expected a share of the period between 0 and 1, got 1.0"),
        ("trot", {"period": 0.41}, r"gaits.trot\(period=...\): expected a whole number of time steps of 0.02 s"),
        ("walk", {"cycles": 0}, r"gaits.walk\(cycles=...\)"),
        ("trot", {"height": 0.6}, "comes no nearer than"),
        ("trot", {"footholds": [(0.0, 0.0)]}, r"gaits.trot\(footholds=...\)"),
        ("jump", {"height": -1.0}, r"gaits.jump\(height=...\)"),
        ("stand", {"duration": 0.0}, r"gaits.stand\(duration=...\)"),
    ],
)
def test_impossible_gaits_are_refused(sim, name, settings, message):
    with pytest.raises(ValueError, match=message):
        getattr(gaits, name)(sim, **settings)


def test_torques_hear_nothing_of_rounding(sim):
    """Two feet cannot turn the base about the line between them; noise of Jacobians is no such turn."""
    gait = gaits.trot(sim, speed=0.3)
    x = gait.x.copy()
    x[:, 7 : sim.nq] += 1e-13 * np.random.default_rng(0).standard_normal((len(x), 12))
    np.testing.assert_allclose(replace(gait, x=x).torques(), gait.torques(), rtol=0.0, atol=1e-6)
