"""Servos: they reach their targets, and move as the springs, dampers and forces that they are."""

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.servos import passive
from support.scenes import pendulum, slider

ARM = replace(
    pendulum(2, spring=3.0, damper=0.1),
    inputs=[
        dojo.Input("rod0", servo="position", stiffness=40.0, damping=1.5, limits=(-1.0, 1.0)),
        dojo.Input("rod1", servo="velocity", damping=5.0),
    ],
)
X, U = np.array([0.4, -0.7, 1.0, -2.0]), np.array([0.6, -0.3])


@pytest.mark.parametrize("order", [2, 4])
def test_a_servo_is_a_spring_a_damper_and_a_force(order):
    """States, derivatives by states and inputs, and gradients by mass and damper, of both."""
    sim = dojo.Simulator(ARM, time_step=0.02, order=order)
    plain = sim.replace(mechanism=passive(ARM))
    gains = np.array([40.0, 5.0])
    ours, theirs = sim.linearize(X, U), plain.linearize(X, gains * U)
    np.testing.assert_allclose(sim.step(X, U).x, plain.step(X, gains * U).x, atol=1e-12)
    np.testing.assert_allclose(ours.A, theirs.A, atol=1e-9)
    np.testing.assert_allclose(ours.B, theirs.B * gains, atol=1e-9)
    step = 1e-5
    for k, e in enumerate(step * np.eye(2)):
        slope = sim.difference(sim.step(X, U + e).x, sim.step(X, U - e).x) / (2.0 * step)
        np.testing.assert_allclose(ours.B[:, k], slope, atol=1e-6)


def test_a_servo_reaches_its_target():
    """Against a weight: kp (u - q) = m g at rest; a stiff one at once; a rate is held exactly where nothing resists."""
    weight = replace(
        slider(mass=2.0, gravity=(-9.81, 0.0, 0.0)),
        inputs=[dojo.Input("mass", servo="position", stiffness=1e3, damping=60.0)],
    )
    sim = dojo.Simulator(weight, time_step=0.01)
    q = sim.rollout(sim.neutral(), np.full((300, 1), 0.5)).x[-1, 0]
    assert q == pytest.approx(0.5 - 2.0 * 9.81 / 1e3, abs=1e-6)
    free = replace(
        slider(mass=2.0), gravity=(0.0, 0.0, 0.0), inputs=[dojo.Input("mass", servo="velocity", damping=1e4)]
    )
    sim = dojo.Simulator(free, time_step=0.01)
    assert sim.rollout(sim.neutral(), np.full((5, 1), 0.7)).x[-1, 1] == pytest.approx(0.7, abs=1e-6)


def test_a_servo_that_is_none_is_refused():
    for given, match in (
        ({"servo": "position"}, "stiffness"),
        ({"servo": "velocity", "stiffness": 2.0}, "velocity servo has none"),
        ({"stiffness": 2.0}, "servo"),
        ({"servo": "torque", "damping": 1.0}, "torque"),
    ):
        with pytest.raises(ValueError, match=match):
            dojo.Input("joint", **given)
    with pytest.raises(ValueError, match="quaternion"):
        dojo.Mechanism(
            [dojo.Body("b", inertia=(1, 1, 1))],
            [dojo.Joint("spherical", None, "b")],
            inputs=[dojo.Input("b", dof=1, servo="velocity", damping=1.0)],
        )
