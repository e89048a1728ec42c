"""Old names work for one version, and say the new ones."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo

SIM = dojo.Simulator(dojo.models.npendulum(2), time_step=0.02)
X, US = SIM.neutral(), np.zeros((3, SIM.nu))
Q, V = X[: SIM.nq], X[SIM.nq :]


@cache
def motion() -> dojo.Trajectory:
    """Two links that fall."""
    return SIM.rollout(X + 0.1, US)


def swingup() -> dojo.Problem:
    return dojo.Problem(SIM, X, 3, cost=dojo.cost.Effort(1.0))


def fitted(**fits: int) -> dojo.Identified:
    """A fit of dampers to a motion of two links."""
    return dojo.identify(SIM, [motion()], ["damper:*"], noise=1e-3, seed=2, max_iterations=3, **fits)


OLD: dict[str, tuple[Callable[[], Any], Callable[[], Any], str]] = {
    "closed_loop": (lambda: SIM.closed_loop(X, US).x, lambda: SIM.rollout_feedback(X, US).x, "rollout_feedback"),
    "start": (lambda: SIM.start(Q, V), lambda: SIM.state_from_velocity(Q, V), "state_from_velocity"),
    "bodies": (lambda: SIM.bodies(Q, V), lambda: SIM.body_states(Q, V), "body_states"),
    "trajectory.knot": (lambda: SIM.rollout(X, US).knot, lambda: 3, "Trajectory.solved_steps"),
    "trajectory.substeps": (lambda: SIM.rollout(X, US).substeps, lambda: np.ones(3), "Trajectory.parts"),
    "trajectory.shares": (lambda: SIM.rollout(X, US).shares, lambda: np.ones(3), "Trajectory.momentum_fractions"),
    "step.substeps": (lambda: SIM.step(X).substeps, lambda: 1, "StepResult.parts"),
    "step.share": (lambda: SIM.step(X).share, lambda: 1.0, "StepResult.momentum_fraction"),
    "feedback.knot": (lambda: SIM.rollout_feedback(X, US).knot, lambda: 3, "FeedbackRollout.solved_knots"),
    "single_row": (
        lambda: SIM.single_row().step(X[None], US[:1]).x,
        lambda: SIM.stepper().step(X[None], US[:1]).x,
        "Simulator.stepper",
    ),
    "second_order": (lambda: SIM.second_order, lambda: SIM.second_order_reason, "Simulator.second_order_reason"),
    "has_single_rows": (lambda: SIM.has_single_rows, lambda: SIM.has_stepper, "Simulator.has_stepper"),
    "batch.knot": (lambda: SIM.rollout_batch([X], [US]).knot, lambda: [3], "RolloutBatch.solved_steps"),
    "terrain": (
        lambda: dojo.models.sphere().on(dojo.Terrain.slope(0.2)).contacts[0].normal,
        lambda: dojo.models.sphere().with_terrain(dojo.Terrain.slope(0.2)).contacts[0].normal,
        "Mechanism.with_terrain",
    ),
    "keyword of identify": (lambda: fitted(starts=2).values, lambda: fitted(fits=2).values, "fits="),
    "identified.starts": (lambda: fitted().starts, lambda: fitted().window_starts, "Identified.window_starts"),
    "identified.seconds": (
        lambda: fitted().seconds > 0.0,
        lambda: fitted().cpu_seconds > 0.0,
        "Identified.cpu_seconds",
    ),
    "keyword of ilqr": (
        lambda: dojo.ilqr(swingup(), violation=1e-4, shooting=0.0).x,
        lambda: dojo.ilqr(swingup(), violation_tolerance=1e-4, multiple_shooting_below=0.0).x,
        "violation_tolerance=",
    ),
}


@pytest.mark.parametrize("name", OLD)
def test_old_names_of_simulators_and_results(name: str) -> None:
    old, new, word = OLD[name]
    with pytest.warns(DeprecationWarning) as told:
        found = old()
    assert any(word in str(warning.message) and warning.filename == __file__ for warning in told)
    np.testing.assert_array_equal(found, new())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("ANGULAR_STEP", "TURN_TOO_LARGE"),
        ("LOOP_STEP", "LOOP_SINGULAR"),
        ("COLLISION_STEP", "SHAPES_CROSSED"),
        ("ENERGY_STEP", "ENERGY_GAIN"),
        ("TOLERANCE_STEP", "ACCURACY_NOT_REACHED"),
    ],
)
def test_old_names_of_statuses(old: str, new: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"Status.{old} is now Status.{new}") as told:
        found = getattr(dojo.Status, old)
    assert told[0].filename == __file__
    assert found is dojo.Status[new] and old not in dojo.Status.__members__


def test_old_names_of_modules() -> None:
    for place, old, new in (
        (dojo, "Sampled", dojo.SampledReference),
        (dojo, "kernel", dojo.jit),
        (dojo.models, "catalogue", dojo.models.catalog),
        (dojo.learn, "Randomisation", dojo.learn.Randomization),
    ):
        with pytest.warns(DeprecationWarning, match=f"{old} is now .*{new.__name__}"):
            assert getattr(place, old) is new
    wrong, keywords = "Randomisations", {"randomisation": 3}
    with pytest.raises(AttributeError, match=wrong):
        getattr(dojo.learn, wrong)
    with pytest.warns(DeprecationWarning, match="randomization="), pytest.raises(TypeError, match="randomization="):
        dojo.learn.ars(dojo.learn.pendulum(), **keywords)  # type: ignore[arg-type]


def test_files_of_trajectories_with_old_names(tmp_path: Any) -> None:
    """A file from before the names changed has the same content under old keys."""
    import json

    motion = SIM.rollout(X, US)
    motion.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as file:
        entries = dict(file)
    old = {"parts": "substeps", "momentum_fractions": "shares"}
    entries = {old.get(name, name): value for name, value in entries.items()}
    (head,) = (name for name, value in entries.items() if value.dtype.kind in "US" and "solved_steps" in str(value))
    content = json.loads(str(entries[head]))
    content["knot"] = content.pop("solved_steps")
    entries[head] = np.array(json.dumps(content))
    np.savez(tmp_path / "old.npz", **entries)
    again = dojo.Trajectory.load(tmp_path / "old.npz")
    assert again.solved_steps == 3 and np.array_equal(again.parts, motion.parts)
