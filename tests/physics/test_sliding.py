"""Coulomb friction: a sliding block stops after v^2 / (2 mu g), in every direction, and never lifts off."""

import numpy as np
import pytest
from naive import rotation as rot

import dojo_opt as dojo
from support.scenes import ball, block, gaps, run

SPEED, FRICTION, G, H, KAPPA = 3.0, 0.3, 9.81, 0.01, 1e-8
DIRECTIONS = np.deg2rad([0.0, 11.3, 30.0, 45.0, 90.0, 135.0, 200.0, 300.0])


def slide(angle, time_step=H):
    """States of a block that starts on the ground along a direction, until it has stopped."""
    sim = dojo.Simulator(block(friction=FRICTION), time_step=time_step, kappa=KAPPA, tolerance=1e-9)
    rest = KAPPA / (0.25 * G * time_step)  # gap of a corner that carries a quarter of the weight
    q = np.array([0.0, 0.0, 0.25 + rest, 1.0, 0.0, 0.0, 0.0])
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    return sim, run(sim, np.r_[q, SPEED * direction, np.zeros(3)], round(1.2 / time_step)), direction


@pytest.mark.parametrize("angle", DIRECTIONS)
def test_stopping_distance(angle):
    """The step decelerates by mu g h exactly, so v^2/(2 mu g) is met up to h v / 2, and the discrete sum to kappa."""
    _, xs, direction = slide(angle)
    traveled = xs[-1, :3] - xs[0, :3]
    speeds = SPEED - FRICTION * G * H * np.arange(1, 1000)
    assert abs(traveled @ direction - H * speeds[speeds > 0].sum()) < 1e-4
    assert abs(traveled @ direction - SPEED**2 / (2.0 * FRICTION * G)) < 0.51 * H * SPEED
    assert np.linalg.norm(traveled - (traveled @ direction) * direction) < 1e-5, "lateral drift"
    assert np.abs(xs[-1, 7:10]).max() < 1e-4, "still moving"


def test_distance_converges_to_the_formula():
    errors = [
        abs(np.linalg.norm(slide(0.3, h)[1][-1, :2]) - SPEED**2 / (2.0 * FRICTION * G)) for h in (0.02, 0.01, 0.005)
    ]
    assert errors[0] > 1.8 * errors[1] > 3.2 * errors[2], errors


def test_distance_does_not_depend_on_direction():
    distances = [np.linalg.norm(slide(angle)[1][-1, :2]) for angle in DIRECTIONS]
    assert np.ptp(distances) < 1e-5, distances


@pytest.mark.parametrize("angle", DIRECTIONS[[0, 1, 3]])
def test_no_lift_off(angle):
    """The four lower corners stay within kappa / impulse of the ground all the way."""
    sim, xs, _ = slide(angle)
    lower = np.sort(gaps(sim, xs), axis=1)[:, :4]
    assert lower.min() > 0.0 and lower.max() < 1e-5, (lower.min(), lower.max())


def test_pyramid_decelerates_more_along_its_axes():
    """The four-sided pyramid inside the cone: mu along its axes, mu / sqrt(2) at 45 degrees."""
    distance = {}
    for angle in (0.0, np.pi / 4.0):
        sim = dojo.Simulator(block(friction=FRICTION, law="linear"), time_step=H, kappa=KAPPA, tolerance=1e-9)
        velocity = SPEED * np.array([np.cos(angle), np.sin(angle), 0.0])
        xs = run(sim, np.r_[0.0, 0.0, 0.25 + 1e-6, 1.0, 0.0, 0.0, 0.0, velocity, np.zeros(3)], 160)
        distance[angle] = np.linalg.norm(xs[-1, :2])
    assert abs(distance[np.pi / 4.0] / distance[0.0] / np.sqrt(2.0) - 1.0) < 0.02, distance


def test_impact_law_has_no_friction():
    sim = dojo.Simulator(block(law="impact"), time_step=H, kappa=KAPPA)
    xs = run(sim, np.r_[0.0, 0.0, 0.25 + 1e-6, 1.0, 0.0, 0.0, 0.0, SPEED, 0.0, 0.0, np.zeros(3)], 50)
    np.testing.assert_allclose(xs[-1, 7], SPEED, rtol=1e-8)


def test_sliding_ball_ends_up_rolling():
    """A solid sphere set down without spin rolls at 5/7 of its speed, with no slip at the ground."""
    sim = dojo.Simulator(ball(radius=0.1), time_step=1e-3, kappa=1e-9, tolerance=1e-9)
    x = run(sim, np.r_[0.0, 0.0, 0.1 + 1e-6, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, np.zeros(3)], 500)[-1]
    np.testing.assert_allclose(x[7:9], np.array([5.0, 2.5]) / 7.0, rtol=5e-3)
    omega = rot.rotate(x[3:7], x[10:13])
    np.testing.assert_allclose(x[7:10] + np.cross(omega, [0.0, 0.0, -0.1]), 0.0, atol=1e-3)
