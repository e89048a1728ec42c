"""Rollouts of a given duration, whose time step is the duration of an input."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.mechanism import checks
from sim.mechanism.checks import whole_number


def simulator_for_duration(
    sim: Any, kappa: float | None, us: Any, steps: int | None, duration: float
) -> tuple[Any, int]:
    """(simulator, number of its steps) of a rollout of a given duration: of one step for each input, or of `steps`.

    sim: a Simulator; kappa: the one it was given, None for that of its time step.
    Contacts press with the same force kappa/(h gap), whatever the step h.
    """
    call = "Simulator.rollout(duration=...)"
    if sim.accuracy is None:
        raise ValueError(f"{call}: expected a simulator with an accuracy; others take a number of time steps")
    seconds = checks.number(call, duration, above=0.0)
    count = len(np.asarray(us)) if steps is None and us is not None and not callable(us) else steps
    h = seconds / whole_number("Simulator.rollout(steps=...)", 1 if count is None else count)
    return sim.replace(time_step=h, kappa=None if kappa is None else kappa * h / sim.time_step), round(seconds / h)
