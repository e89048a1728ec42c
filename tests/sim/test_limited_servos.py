"""Servos whose force has limits: they are servos within them, constant forces beyond, and stable for every gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from support.jacobians import check_jacobian
from support.parameter_case import Case
from support.parameter_errors import error
from support.scenes import pendulum, slider

SERVOS = (
    dojo.Input("rod0", servo="position", stiffness=40.0, damping=1.5),
    dojo.Input("rod1", servo="velocity", damping=5.0),
)
X, U = np.array([0.4, -0.7, 1.0, -2.0]), np.array([0.6, -0.3])


def arm(limit: float | None) -> dojo.Mechanism:
    """A double pendulum on both kinds of servo, one with unequal limits."""
    ends = None if limit is None else [(-limit, 2.0 * limit), (-limit, limit)]
    given = SERVOS if ends is None else [replace(s, force_limits=e) for s, e in zip(SERVOS, ends, strict=True)]
    return replace(pendulum(2), inputs=given)


def test_within_its_limits_it_is_the_servo_without() -> None:
    """A spring; its damper is another one, of first order."""
    springs = [replace(part, servo="position", stiffness=30.0, damping=0.0) for part in SERVOS]
    limited = [replace(part, force_limits=(-1e3, 2e3)) for part in springs]
    free, held = (
        dojo.Simulator(replace(pendulum(2, damper=0.3), inputs=inputs), time_step=0.01, kappa=1e-12)
        for inputs in (springs, limited)
    )
    us = np.tile(U, (50, 1))
    motion = held.rollout(X, us)
    assert motion.success, motion.message
    np.testing.assert_allclose(motion.x, free.rollout(X, us).x, atol=1e-6)


def test_beyond_its_limits_it_is_a_constant_force() -> None:
    """Towards a far target at 3 N/2 kg, and back at 1 N/2 kg; the gain is as stiff as can be."""
    servo = dojo.Input("mass", servo="position", stiffness=1e9, damping=1e4, force_limits=(-1.0, 3.0))
    sim = dojo.Simulator(replace(slider(mass=2.0), gravity=(0.0, 0.0, 0.0), inputs=[servo]), time_step=0.01)
    forth = sim.rollout(sim.neutral(), np.full((20, 1), 100.0)).x
    np.testing.assert_allclose(np.diff(forth[:, 1]), 0.01 * 1.5, atol=1e-7)
    back = sim.rollout(forth[-1], np.full((20, 1), -100.0)).x
    np.testing.assert_allclose(np.diff(back[:, 1]), -0.01 * 0.5, atol=1e-7)


@pytest.mark.parametrize("time_step", [0.002, 0.1])
def test_a_stiff_servo_reaches_its_target_without_more_energy_than_its_force_gives(time_step: float) -> None:
    servo = dojo.Input("mass", servo="position", stiffness=1e6, damping=1e6, force_limits=(-2.0, 2.0))
    sim = dojo.Simulator(replace(slider(mass=2.0), gravity=(0.0, 0.0, 0.0), inputs=[servo]), time_step=time_step)
    motion = sim.rollout(np.array([-0.5, 0.0]), np.zeros((round(12.0 / time_step), 1)))
    assert motion.success, motion.message
    q, v = motion.x.T
    assert np.all(v**2 <= 2.0 * 2.0 * (0.5 + np.abs(q)) / 2.0 + 1e-6)
    assert abs(q[-1]) < 1e-3 and abs(v[-1]) < 1e-3


@pytest.mark.parametrize("limit", [100.0, 14.0, 1.0])
def test_derivatives_within_at_and_beyond_the_limits(limit: float) -> None:
    sim = dojo.Simulator(arm(limit), time_step=0.02, kappa=1e-3, tolerance=1e-12)
    d = sim.linearize(X, U)
    here = sim.step(X, U, throw=True).x
    check_jacobian(lambda x: sim.difference(sim.step(x, U, throw=True).x, here), d.A, X, sim.integrate)
    check_jacobian(lambda u: sim.difference(sim.step(X, u, throw=True).x, here), d.B, U, np.add)
    case = Case(sim, X, U)
    assert {kind: e for kind in case.kinds() if (e := error(case, kind)) > 1e-6} == {}


def test_limits_of_a_force_that_is_no_servos_are_refused() -> None:
    with pytest.raises(ValueError, match="limits"):
        dojo.Input("joint", force_limits=(-1.0, 1.0))
    with pytest.raises(ValueError, match="two finite"):
        dojo.Input("joint", servo="velocity", damping=1.0, force_limits=(None, 1.0))
    with pytest.raises(ValueError, match="limited servo"):
        dojo.Simulator(arm(1.0), time_step=0.01, order=4)
