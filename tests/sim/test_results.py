"""One convention: every call that steps returns how it ended, and raises only when it is asked to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt import Status
from sim.simulator.engines.engine import Engine

HOPPER = dojo.Simulator(dojo.models.hopper(), 0.01, max_iterations=1)
X = HOPPER.neutral() + 0.3 * np.eye(HOPPER.nx)[HOPPER.nq]  # no step from here is solved in one iteration
US = np.zeros((3, HOPPER.nu))
LOSS = np.ones((4, HOPPER.ndx))
CALLS: dict[str, Callable[..., Any]] = {
    "step": lambda **k: HOPPER.step(X, **k),
    "rollout": lambda **k: HOPPER.rollout(X, US, **k),
    "rollout of a policy": lambda **k: HOPPER.rollout(X, lambda t, x: US[0], steps=3, **k),
    "rollout_batch": lambda **k: HOPPER.rollout_batch(X[None], US[None], **k),
    "rollout_feedback": lambda **k: HOPPER.rollout_feedback(X, US, **k),
    "linearize": lambda **k: HOPPER.linearize(X, **k),
    "linearize by name": lambda **k: HOPPER.linearize(X, wrt=("state", "friction"), **k),
    "linearize_rollout": lambda **k: HOPPER.linearize_rollout(X, US, **k)[1],
    "linearize_trajectory": lambda **k: HOPPER.linearize_trajectory(np.tile(X, (3, 1)), US, **k),
    "linearize_maximal": lambda **k: HOPPER.linearize_maximal(HOPPER.maximal(X), **k),
    "vjp": lambda **k: HOPPER.vjp((np.tile(X, (4, 1)), US), LOSS, **k),
    "reactions": lambda **k: HOPPER.reactions(X, **k),
}


@pytest.mark.parametrize("name", CALLS)
def test_an_unsolved_step_is_told_and_raised_only_when_asked_for(name: str) -> None:
    found = CALLS[name]()
    assert not found.success
    assert np.any(np.asarray(found.status) == Status.MAX_ITERATIONS)
    assert len(found.message) > 20
    with pytest.raises(dojo.SimulationError) as error:
        CALLS[name](throw=True)
    assert error.value.status == Status.MAX_ITERATIONS


def test_an_unsolved_step_is_solved_for_once_and_told_alike_however_it_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sim = HOPPER.replace(divide=False)
    slow = sim.step(X.tolist())
    calls: list[int] = []
    take = Engine.take_steps
    monkeypatch.setattr(Engine, "take_steps", lambda self, *given: calls.append(1) or take(self, *given))
    fast = sim.step(X)
    assert len(calls) == 1
    assert (fast.status, fast.iterations, fast.residual, fast.violation, fast.message) == (
        slow.status,
        slow.iterations,
        slow.residual,
        slow.violation,
        slow.message,
    )
    np.testing.assert_array_equal(fast.x, X)
    with pytest.raises(ValueError, match="finite"):
        sim.step(np.full(sim.nx, np.nan))


def test_derivatives_of_an_unsolved_step_cannot_be_taken_by_accident() -> None:
    found = HOPPER.linearize(X)
    for take in (lambda: tuple(found), lambda: found["state"], lambda: found.A, lambda: dict(found)):
        with pytest.raises(dojo.SimulationError):
            take()
    gradient = HOPPER.vjp((np.tile(X, (4, 1)), US), LOSS)
    with pytest.raises(dojo.SimulationError):
        _ = gradient["input"]
    assert np.isnan(HOPPER.reactions(X).force).all()


def test_a_solved_call_unpacks_and_is_a_table() -> None:
    sim = HOPPER.replace(max_iterations=100)
    found = sim.linearize(X, wrt=("friction", "state"))
    A, B = sim.linearize(X)
    friction, state = found
    assert found.success and list(dict(found)) == ["friction", "state"]
    assert friction is found["friction"] and state is found["state"] is found.A
    np.testing.assert_array_equal(found["state"], A)
    assert B.shape == (sim.ndx, sim.nu)


def test_a_rollout_without_inputs_needs_their_number_only() -> None:
    sim = HOPPER.replace(max_iterations=100)
    found = sim.rollout(X, steps=3)
    np.testing.assert_array_equal(found.x, sim.rollout(X, US).x)
    assert found.success and found.u.shape == (3, sim.nu)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused_by_name(bad: float) -> None:
    x, u = X.copy(), np.zeros(HOPPER.nu)
    x[1] = bad
    with pytest.raises(ValueError, match=r"Simulator\.step\(x\): expected finite numbers"):
        HOPPER.step(x)
    u[0] = bad
    with pytest.raises(ValueError, match=r"Simulator\.step\(u\): expected finite numbers"):
        HOPPER.step(X, u)
    x = X.copy()
    x[3:7] *= 1.1
    if HOPPER.mechanism.joints[0].nrot == 3:
        with pytest.raises(ValueError, match="unit quaternion"):
            HOPPER.step(x)
