"""Rollouts under a function of time and state."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from solvers.status import Status

SIM = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.02)
PUSH = {"body": (3.0, 0.0, 0.0, 0.0, 0.1, 0.0)}


def gains(time: float, x: np.ndarray) -> np.ndarray:
    return np.array([-20.0 * x[4], -20.0 * x[5], 46.0 + 100.0 * (0.5 - x[7]) + time])


@pytest.mark.parametrize("wrenches", [None, PUSH])
def test_it_is_the_rollout_of_the_inputs_that_the_function_gave(wrenches: dict | None) -> None:
    x0 = SIM.neutral()
    closed = SIM.rollout(x0, gains, steps=30, wrenches=wrenches)
    again = SIM.rollout(x0, closed.u, wrenches=wrenches, throw=True)
    assert closed.success and closed.x.shape == (31, SIM.nx) and closed.u.shape == (30, 3)
    np.testing.assert_allclose(closed.x, again.x, atol=1e-6)  # each step is solved afresh, to the same tolerance
    np.testing.assert_allclose(closed.contacts.impulse, again.contacts.impulse, atol=1e-6)
    for k in (0, 7, 29):
        np.testing.assert_allclose(closed.u[k], gains(k * 0.02, closed.x[k]), atol=1e-12)


def test_the_function_may_keep_the_state_it_was_given() -> None:
    seen: list[np.ndarray] = []

    def policy(time: float, x: np.ndarray) -> np.ndarray:
        seen.append(x)
        x[:] = 0.0  # its own copy
        return np.zeros(3)

    found = SIM.rollout(SIM.neutral(), policy, steps=3)
    np.testing.assert_allclose(found.x, SIM.rollout(SIM.neutral(), np.zeros((3, 3))).x, atol=1e-6)
    assert len(seen) == 3


def test_it_stops_at_the_step_that_cannot_be_solved() -> None:
    x = SIM.neutral()
    x[2] = 3.0

    def spun(time: float, state: np.ndarray) -> list[float]:
        return [0.0, 0.0, np.inf] if time > 0.05 else [0.0, 0.0, 1e200 if time > 0.03 else 0.0]

    found = SIM.rollout(x, spun, steps=10)
    assert (found.solved_steps, found.x.shape, found.u.shape) == (2, (3, SIM.nx), (2, 3))
    assert found.status != Status.SOLVED
    assert "step 2" in found.message


@pytest.mark.parametrize(
    ("us", "steps", "message"),
    [
        (gains, None, r"rollout\(steps=\.\.\.\): expected a whole number >= 1, got None"),
        (lambda t, x: np.zeros(2), 3, r"u of the policy at step 0: expected shape \(3,\), got \(2,\)"),
        (lambda t, x: [np.nan, 0, 0], 3, r"u of the policy at step 0: expected finite numbers, got nan at index 0"),
        (np.zeros((4, 3)), 5, r"rollout\(us\): expected shape \(5, 3\), got \(4, 3\)"),
    ],
)
def test_errors(us: object, steps: int | None, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SIM.rollout(SIM.neutral(), us, steps=steps)
