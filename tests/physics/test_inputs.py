"""When an input acts: at the beginning of its step."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo

MASS = 2.0


def end(h: float, force: np.ndarray) -> tuple[float, float]:
    """Position and velocity at the end of a motion from rest under a force per step."""
    slider = dojo.Joint("prismatic", None, "mass", axis=(1, 0, 0))
    mech = dojo.Mechanism([dojo.Body("mass", MASS, (1, 1, 1))], [slider], inputs=[dojo.Input("mass")])
    sim = dojo.Simulator(mech, time_step=h)
    x = sim.rollout(sim.state_from_velocity([0.0], [0.0]), force[:, None], throw=True).x[-1]
    return float(x[0]), float(sim.velocity(x)[0])


@pytest.mark.parametrize("h", [0.02, 0.01])
def test_a_constant_force_runs_ahead_by_half_a_step(h: float) -> None:
    force = np.full(round(1.0 / h), 4.0)
    position, velocity = end(h, force)
    assert position == pytest.approx(0.5 * 4.0 / MASS + 0.5 * h * 4.0 / MASS, abs=1e-12)
    assert velocity == pytest.approx(4.0 / MASS, abs=1e-12)
    force[0] *= 0.5
    assert end(h, force)[0] == pytest.approx(0.5 * 4.0 / MASS, abs=1e-12)


def test_with_half_of_the_first_input_motions_are_of_second_order() -> None:
    errors: dict[float, list[float]] = {0.5: [], 1.0: []}
    for share, found in errors.items():
        for h in (0.02, 0.01):
            force = np.cos(3.0 * h * np.arange(round(1.0 / h)))
            force[0] *= share
            found.append(abs(end(h, force)[0] - (1.0 - np.cos(3.0)) / 9.0 / MASS))
    assert errors[0.5][0] < 1e-4 and errors[0.5][1] == pytest.approx(errors[0.5][0] / 4.0, rel=0.02)
    assert errors[1.0][1] == pytest.approx(errors[1.0][0] / 2.0, rel=0.02)
