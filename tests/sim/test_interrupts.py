"""Ctrl-C during every call that loops over steps or rows: heard soon, and the finished part is at hand."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from sim.model import interruptible_loops
from sim.simulator.engines.python_loop_engine import PythonLoopEngine
from support.interrupts import heard_in, unfinished

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), 0.02)
QUADRUPED = dojo.Simulator(dojo.models.quadruped(), 0.02)
CHAIN = dojo.Simulator(dojo.models.npendulum(5), 0.001, order=6)
FALLING = dojo.Simulator(dojo.models.block(), 0.001, order=4)
RESTING = FALLING.neutral()
PUSH = np.full(6, 1e-3)
FLYING = FALLING.integrate(RESTING, np.eye(FALLING.ndx)[2] * 1e6)


def inputs(sim: Any, steps: int) -> Any:
    return np.zeros((steps, sim.nu))


def standing(sim: Any, steps: int) -> Any:
    return np.tile(sim.neutral(), (steps + 1, 1)), inputs(sim, steps)


def gradient(sim: Any, steps: int, wrt: tuple[str, ...]) -> Any:
    elsewhere = 2.0 * sim.kappa  # where steps need not end in the states of the path
    return sim.vjp(standing(sim, steps), np.zeros((steps + 1, sim.ndx)), wrt=wrt, kappa=elsewhere)


def rows(sim: Any, count: int) -> Any:
    return np.tile(sim.neutral(), (count, 1))


@cache
def standing_bodies(count: int) -> Any:
    """Made before the signal comes: a third of a gigabyte."""
    return np.tile(HOPPER.maximal(HOPPER.neutral()), (count, 1, 1))


ROLLOUTS = {  # calls of so many steps; enough of them take a second
    "rollout": (lambda n: HOPPER.rollout(HOPPER.neutral(), inputs(HOPPER, n)), 1_000_000),
    "under a policy": (lambda n: HOPPER.rollout(HOPPER.neutral(), lambda t, x: np.zeros(3), steps=n), 100_000),
    "under wrenches": (
        lambda n: QUADRUPED.rollout(QUADRUPED.neutral(), inputs(QUADRUPED, n), wrenches={"trunk": PUSH}),
        60_000,
    ),
    "closed loop": (
        lambda n: QUADRUPED.rollout_feedback(QUADRUPED.neutral(), inputs(QUADRUPED, n // 10), substeps=10),
        150_000,
    ),
    "closed loop under wrenches": (
        lambda n: QUADRUPED.rollout_feedback(
            QUADRUPED.neutral(), inputs(QUADRUPED, n // 20), substeps=20, wrenches={"trunk": PUSH}
        ),
        150_000,
    ),
    "closed loop with many substeps": (
        lambda n: QUADRUPED.rollout_feedback(QUADRUPED.neutral(), inputs(QUADRUPED, 200), substeps=n // 200),
        200_000,
    ),
    "higher order": (lambda n: CHAIN.rollout(CHAIN.neutral() + 0.1, inputs(CHAIN, n)), 400_000),
    "higher order, closed loop": (
        lambda n: CHAIN.rollout_feedback(CHAIN.neutral() + 0.1, inputs(CHAIN, n // 20), substeps=20),
        400_000,
    ),
    "higher order, far": (lambda n: FALLING.rollout(FLYING, inputs(FALLING, n)), 600_000),
    "higher order, near": (lambda n: FALLING.rollout(RESTING, inputs(FALLING, n)), 300_000),
    "higher order, near, closed loop": (
        lambda n: FALLING.rollout_feedback(RESTING, inputs(FALLING, n // 20), substeps=20),
        300_000,
    ),
}
BATCHES = {
    "many short ones": (
        lambda n: QUADRUPED.rollout_batch(rows(QUADRUPED, n), np.zeros((n, 25, 12))),
        8_000,
    ),
    "few long ones": (lambda n: HOPPER.rollout_batch(rows(HOPPER, 3), np.zeros((3, n, 3))), 150_000),
    "higher order": (lambda n: CHAIN.rollout_batch(rows(CHAIN, 4) + 0.1, np.zeros((4, n, CHAIN.nu))), 100_000),
}
DERIVATIVES = {
    "trajectory": (lambda n: QUADRUPED.linearize_trajectory(*standing(QUADRUPED, n)), 60_000),
    "with substeps": (lambda n: QUADRUPED.linearize_trajectory(*standing(QUADRUPED, n), substeps=20), 3_000),
    "few knots with many substeps": (
        lambda n: HOPPER.linearize_trajectory(*standing(HOPPER, 1), substeps=n),
        400_000,
    ),
    "rollout": (lambda n: QUADRUPED.linearize_rollout(QUADRUPED.neutral(), inputs(QUADRUPED, n)), 50_000),
    "rollout by parameters": (
        lambda n: HOPPER.linearize_rollout(HOPPER.neutral(), inputs(HOPPER, n), wrt=("mass:foot",)),
        40_000,
    ),
    "gradient": (lambda n: gradient(QUADRUPED, n, ("state", "input")), 60_000),
    "gradient by parameters": (lambda n: gradient(QUADRUPED, n, ("mass", "friction")), 40_000),
    "higher order": (lambda n: CHAIN.linearize_trajectory(*standing(CHAIN, n)), 60_000),
    "higher order, many substeps": (lambda n: CHAIN.linearize_trajectory(*standing(CHAIN, 1), substeps=n), 60_000),
    "higher order, rollout": (lambda n: CHAIN.linearize_rollout(CHAIN.neutral() + 0.1, inputs(CHAIN, n)), 60_000),
    "higher order, gradient": (lambda n: gradient(CHAIN, n, ("state", "input")), 100_000),
    "higher order, near": (lambda n: FALLING.linearize_trajectory(*standing(FALLING, n)), 20_000),
}
STATES = {
    "velocity": (lambda n: HOPPER.velocity(rows(HOPPER, n)), 1_500_000),
    "body_states": (lambda n: HOPPER.body_states(*np.split(rows(HOPPER, n), [HOPPER.nq], axis=1)), 2_000_000),
    "integrate": (lambda n: QUADRUPED.integrate(rows(QUADRUPED, n), np.zeros((n, QUADRUPED.ndx))), 1_000_000),
    "difference": (lambda n: QUADRUPED.difference(rows(QUADRUPED, n), rows(QUADRUPED, n)), 1_000_000),
    "maximal": (lambda n: HOPPER.maximal(rows(HOPPER, n)), 1_500_000),
    "minimal": (lambda n: HOPPER.minimal(standing_bodies(max(n, 500_000))[:n]), 1_000_000),
    "energy": (lambda n: HOPPER.energy(rows(HOPPER, n)), 1_500_000),
    "momentum": (lambda n: HOPPER.momentum(rows(HOPPER, n)), 1_500_000),
    "reactions": (lambda n: HOPPER.reactions(*(part[:n] for part in standing(HOPPER, n))), 50_000),
}


def stopped(call: Callable[[int], Any], enough: int, after: float = 0.15, *, in_loop: bool = False) -> Any:
    """The exception of a call that Ctrl-C ends; its kernels are compiled before."""
    call(600)
    return heard_in(call, enough, after, in_loop=in_loop)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROLLOUTS)
def test_rollouts_hear_ctrl_c_and_keep_what_they_have(name: str) -> None:
    found = stopped(*ROLLOUTS[name], in_loop=name != "under a policy")
    assert found.status == dojo.Status.INTERRUPTED
    solved = found.solved_knots if isinstance(found, dojo.FeedbackRollout) else found.solved_steps
    assert solved > 0
    assert found.x.shape[0] == solved + 1 == len(found.u) + 1
    assert np.isfinite(found.x).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", BATCHES)
def test_batches_hear_ctrl_c_and_keep_what_they_have(name: str) -> None:
    found = stopped(*BATCHES[name], in_loop=True)
    steps = found.x.shape[1] - 1
    done = found.solved_steps == steps
    assert 0 < found.solved_steps.sum() < done.size * steps
    np.testing.assert_array_equal(found.status, np.where(done, dojo.Status.SOLVED, dojo.Status.INTERRUPTED))
    for x, knot in zip(found.x[::97], found.solved_steps[::97], strict=True):
        np.testing.assert_array_equal(x[knot:], np.tile(x[knot], (steps + 1 - knot, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("name", DERIVATIVES)
def test_derivatives_hear_ctrl_c(name: str) -> None:
    stopped(*DERIVATIVES[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", STATES)
def test_calls_about_many_states_hear_ctrl_c(name: str) -> None:
    call, enough = STATES[name]
    stopped(call, enough // 2, 0.12)  # of more memory, a single copy takes long on a machine that is slow to give it


PYTHON_LOOPS = {  # calls of a few knots or rows
    "closed loop": (
        lambda: FALLING.rollout_feedback(RESTING, inputs(FALLING, 4), substeps=2),
        PythonLoopEngine.roll_feedback,
    ),
    "damped closed loop": (
        lambda: FALLING.rollout_feedback(RESTING, inputs(FALLING, 4), alpha=0.5),
        PythonLoopEngine.roll_feedback,
    ),
    "batch": (
        lambda: FALLING.rollout_batch(np.tile(RESTING, (4, 1)), np.zeros((4, 2, FALLING.nu))),
        PythonLoopEngine.roll_batch,
    ),
}


@pytest.mark.parametrize("name", PYTHON_LOOPS)
def test_loops_in_python_keep_what_they_have_wherever_ctrl_c_comes(name: str) -> None:
    call, loop = PYTHON_LOOPS[name]
    results = unfinished(call, [loop])
    begun = next(k for k, found in enumerate(results) if found is not None)
    assert None not in results[begun:-2]  # the last lines come after the loop
    done = [np.sum(found.solved_steps if name == "batch" else found.solved_knots) for found in results[begun:-2]]
    assert begun < 9 and done == sorted(done) and done[-1] > done[0] == 0


def rocking(sim: Any, steps: int) -> Any:
    return np.random.default_rng(0).normal(size=(steps, sim.nu))


@pytest.mark.parametrize("sim", [HOPPER, QUADRUPED, CHAIN, FALLING], ids=["hopper", "quadruped", "chain", "falling"])
def test_pieces_change_no_bit(sim: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    us = rocking(sim, 60)
    x = sim.integrate(sim.neutral(), 0.01 * np.ones(sim.ndx))
    batch = np.tile(us, (5, 1, 1)) * np.arange(5.0)[:, None, None]

    def results() -> list[Any]:
        t, b, c = (
            sim.rollout(x, us),
            sim.rollout_batch(np.tile(x, (5, 1)), batch),
            sim.rollout_feedback(x, us, substeps=2),
        )
        lines = sim.linearize_trajectory(t.x, us), sim.linearize_rollout(x, us)[1]
        blocks = sim.vjp(t, np.ones((61, sim.ndx)), wrt=("state", "input"))
        rest = [sim.velocity(t.x), sim.maximal(t.x), sim.energy(t.x), *blocks.values()]
        return [
            t.x,
            t.contacts.impulse,
            t.iterations,
            b.x,
            b.solved_steps,
            c.x,
            *(a for k in lines for a in (k.A, k.B)),
            *rest,
        ]

    whole = results()
    monkeypatch.setattr(interruptible_loops, "PAUSE", 3e-5)  # a few steps
    monkeypatch.setattr(interruptible_loops, "_ROWS", 1)
    for found, expected in zip(results(), whole, strict=True):
        np.testing.assert_array_equal(found, expected)


LATE = {  # calls of a few pieces, each of which begins after its deadline
    "rows": lambda: HOPPER.step_batch(rows(HOPPER, 3), inputs(HOPPER, 3), 200),
    "rows with derivatives": lambda: HOPPER.step_batch(rows(HOPPER, 3), inputs(HOPPER, 3), 200, derivatives=True),
    "trajectory": lambda: QUADRUPED.linearize_trajectory(*standing(QUADRUPED, 60)),
    "batch": lambda: HOPPER.rollout_batch(rows(HOPPER, 3), np.zeros((3, 200, 3))),
    "gradient": lambda: gradient(HOPPER, 20, ("state", "input")),
}


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The pieces that were begun, at most a thousand."""
    found, real = [], interruptible_loops._pieces

    def counted(settings: Any) -> Any:
        for piece in real(settings):
            found.append(1)
            assert len(found) < 1000, "no progress"
            yield piece

    monkeypatch.setattr(interruptible_loops, "_pieces", counted)
    return found


@pytest.mark.parametrize("name", LATE)
def test_a_piece_that_begins_after_its_deadline_makes_progress(
    name: str, begun: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interruptible_loops, "PAUSE", -1.0)
    LATE[name]()
    assert len(begun) > 1


@pytest.mark.parametrize("steps", [50, 400], ids=["one thread", "threads"])
def test_knots_that_cannot_be_solved_go_back_to_python(
    steps: int, begun: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    sim = HOPPER.replace(max_iterations=1, divide=False)
    monkeypatch.setattr(interruptible_loops, "PAUSE", 0.0)
    knots = sim.linearize_trajectory(*standing(sim, steps))
    assert (knots.status == dojo.Status.MAX_ITERATIONS).all()
    assert len(begun) > 1


RESTS = {
    "rollout": lambda sim: sim.rollout(sim.neutral(), steps=1000),
    "closed loop with many substeps": lambda sim: sim.rollout_feedback(sim.neutral(), inputs(sim, 1), substeps=1000),
    "batch": lambda sim: sim.rollout_batch(rows(sim, 1), np.zeros((1, 1000, sim.nu))),
}


@pytest.mark.parametrize("name", RESTS)
def test_a_robot_at_rest_whose_steps_take_no_iterations_goes_back_to_python(
    name: str, begun: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    sim = dojo.Simulator(dojo.models.pendulum(), 0.01)
    assert sim.step(sim.neutral()).iterations == 0
    monkeypatch.setattr(interruptible_loops, "PAUSE", 0.0)
    assert RESTS[name](sim).success
    assert len(begun) > 10
