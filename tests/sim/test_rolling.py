"""A ball that rolls on a body that may move."""

from __future__ import annotations

import numpy as np

import dojo_opt as dojo


def test_a_ball_rolls_on_a_heavy_plate_as_on_the_ground() -> None:
    """Its contact point moves with the ball: carried by both bodies alike, it would lose a third of its speed."""
    bodies = [dojo.Body("ball", 1.0, shape=dojo.Sphere(0.1)), dojo.Body("plate", 1e6, shape=dojo.Box(50, 50, 0.2))]
    corners = [(x, y, -0.1) for x in (-25, 25) for y in (-25, 25)]
    mech = dojo.Mechanism(
        bodies,
        [dojo.Joint("floating", None, body.name) for body in bodies],
        contacts=[dojo.Contact("plate", corner, friction=1.0) for corner in corners],
        collisions=[dojo.Collision("ball", "plate")],
        neutral={"ball": (0, 0, 0.3, 1, 0, 0, 0), "plate": (0, 0, 0.1, 1, 0, 0, 0)},
    )
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-8)
    x = sim.neutral()
    x[sim.nq], x[sim.nq + 4] = 1.0, 10.0  # 1 m/s along x, rolling about y
    t = sim.rollout(x, np.zeros((100, sim.nu)), throw=True)
    np.testing.assert_allclose(t.x[-1, sim.nq], 1.0, atol=2e-3)
