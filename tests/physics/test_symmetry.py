"""Physics does not depend on where the mechanism stands on the plane or where it looks."""

import numpy as np
from naive import rotation as rot

import dojo_opt as dojo
from support.scenes import block, chain, random_state


def moved(x, nq, shift, yaw):
    """A state of a floating base, turned about the vertical and shifted."""
    turn, out = rot.exp(np.array([0.0, 0.0, yaw])), np.array(x)
    out[:3] = rot.rotate(turn, x[:3]) + shift
    out[3:7] = rot.mul(turn, x[3:7])
    out[nq : nq + 3] = rot.rotate(turn, x[nq : nq + 3])
    return out


def test_step_commutes_with_yaw_and_shift(rng):
    shift = np.array([3.0, -2.0, 0.0])
    for mech in (block(), chain("spherical", 2, gravity=(0.0, 0.0, -9.81))):
        sim = dojo.Simulator(mech, time_step=0.02, kappa=1e-4, tolerance=1e-12)
        for _ in range(5):
            x = random_state(sim, rng, spread=0.3)
            x[2] = 0.5
            u = rng.normal(size=sim.nu)
            a = moved(sim.step(x, u).x, sim.nq, shift, 0.7)
            b = sim.step(moved(x, sim.nq, shift, 0.7), u).x
            np.testing.assert_allclose(sim.difference(x1=a, x0=b), 0.0, atol=1e-8)


def test_sign_of_a_quaternion_does_not_matter(rng):
    sim = dojo.Simulator(chain("spherical", 2, spring=5.0, damper=0.1), time_step=0.02, tolerance=1e-12)
    x, flipped = random_state(sim, rng), None
    flipped = x.copy()
    flipped[3:7] *= -1.0
    flipped[7:11] *= -1.0
    u = rng.normal(size=sim.nu)
    np.testing.assert_allclose(sim.difference(x1=sim.step(x, u).x, x0=sim.step(flipped, u).x), 0.0, atol=1e-10)
