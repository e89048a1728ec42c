"""Static friction: a block on a slope holds below arctan(mu) without creeping, and slides above."""

import numpy as np
import pytest

import dojo_opt as dojo
from support.scenes import ball, block, run, tilted

REST = np.r_[0.0, 0.0, 0.25 + 1e-7, 1.0, 0.0, 0.0, 0.0, np.zeros(6)]


@pytest.mark.parametrize("law", ["linear", "nonlinear"])
def test_no_creep_in_ten_seconds(law):
    """20 degrees, friction 0.5 (26.6 degrees): the block moves less than a micrometre in 10 s."""
    mech = block(friction=0.5, gravity=tilted(np.deg2rad(20.0)), law=law)
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-11, tolerance=1e-10)
    xs = run(sim, REST, 1000)
    assert np.linalg.norm(xs[-1, :2] - xs[0, :2]) < 1e-6


@pytest.mark.parametrize("time_step", [1e-3, 0.01, 0.05])
@pytest.mark.parametrize("mass", [0.1, 100.0])
def test_no_creep_in_ten_seconds_by_default(time_step, mass):
    """The same at the default kappa and tolerance, at every time step and weight."""
    mech = block(mass=mass, friction=0.5, gravity=tilted(np.deg2rad(20.0)))
    sim = dojo.Simulator(mech, time_step=time_step)
    xs = run(sim, REST, round(10.0 / time_step))
    assert np.linalg.norm(xs[-1, :2] - xs[0, :2]) < 1e-6


@pytest.mark.parametrize("shape", [dojo.Box(0.5, 0.5, 0.5), dojo.Cylinder(0.25, 0.5)], ids=["box", "cylinder"])
def test_no_creep_on_another_body_by_default(shape):
    """On an obstacle, by collisions."""
    on = dojo.Collision("a", shape_b=dojo.Box(4.0, 4.0, 0.5, center=(0.0, 0.0, -0.25)), friction=0.5)
    gravity = tilted(np.deg2rad(20.0))
    mech = dojo.Mechanism(
        [dojo.Body("a", 1.0, shape=shape)], [dojo.Joint("floating", None, "a")], collisions=[on], gravity=gravity
    )
    xs = run(dojo.Simulator(mech, time_step=0.01), REST, 1000)
    assert np.linalg.norm(xs[-1, :2] - xs[0, :2]) < 1e-6


def test_creep_agrees_with_the_central_path():
    """mu gamma v / (a + sqrt(a^2 + v^2)) = tangential load: v = 2 a r / (1 - r^2), a = gap/(2 mu), r = tan/mu."""
    angle, kappa, h = np.deg2rad(15.0), 1e-6, 0.01
    sim = dojo.Simulator(ball(friction=0.8, gravity=tilted(angle)), time_step=h, kappa=kappa, tolerance=1e-12)
    hold = -0.1 * 9.81 * np.sin(angle)  # a torque that stops the ball from rolling
    x = run(sim, np.r_[0.0, 0.0, 0.1 + 1e-6, 1.0, np.zeros(9)], 300, np.r_[np.zeros(4), hold, 0.0])[-1]
    gap, ratio = kappa / (9.81 * np.cos(angle) * h), np.tan(angle) / 0.8
    a = gap / (2.0 * 0.8)
    slip = x[7] - 0.1 * x[11]
    np.testing.assert_allclose(slip, 2.0 * a * ratio / (1.0 - ratio**2), rtol=1e-3)


@pytest.mark.parametrize("friction", [0.2, 0.5, 0.8])
def test_angle_of_repose(friction):
    """Half a degree below arctan(mu) it holds, half a degree above it accelerates by g (sin - mu cos)."""
    for sign in (-1.0, 1.0):
        angle = np.arctan(friction) + sign * np.deg2rad(0.5)
        mech = block(friction=friction, gravity=tilted(angle))
        sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-9, tolerance=1e-9)
        speed = run(sim, REST, 100)[-1, 7]
        expected = 9.81 * (np.sin(angle) - friction * np.cos(angle)) if sign > 0 else 0.0
        assert abs(speed - expected) < 1e-3, (np.rad2deg(angle), speed, expected)
