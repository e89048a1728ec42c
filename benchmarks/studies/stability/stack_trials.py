"""Bodies on top of one another: stacks, and heavy bodies on light ones."""

from __future__ import annotations

import numpy as np

from benchmarks.engines import Run
from dojo_opt.report.stability.trial import StabilityTrial
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Sphere
from support.towers import EDGE, tower


def out_of_place(mechanism: Mechanism, run: Run) -> float:
    """Largest error of a body's height at the end [m]."""
    heights = EDGE * (0.5 + np.arange(mechanism.nbody))
    return float(np.abs(run.position[-1, :, 2] - heights).max())


def stack(count: int, time_step: float) -> StabilityTrial:
    """Boxes of 1 kg, set down from 0.1 mm above one another."""
    mechanism = tower(Box(EDGE, EDGE, EDGE), [1.0] * count)
    return StabilityTrial(
        "stacks",
        f"{count} boxes, 2 s at {1e3 * time_step:g} ms",
        "every box at its place after 2 s (0.1 mm)",
        mechanism,
        np.asarray(mechanism.neutral),
        np.zeros(6 * count),
        time_step,
        2.0,
        out_of_place,
        1e-4,
        samples=100,
        slow=True,
    )


def heavy_on_light(ratio: float, time_step: float) -> StabilityTrial:
    """A heavy ball on one of 1 kg, both on a rail."""
    mechanism = tower(Sphere(0.5 * EDGE), [1.0, ratio], "prismatic")
    return StabilityTrial(
        "stacks",
        f"ball of {ratio:g} kg on one of 1 kg, 2 s at {1e3 * time_step:g} ms",
        "both at their places after 2 s (0.1 mm)",
        mechanism,
        np.asarray(mechanism.neutral),
        np.zeros(2),
        time_step,
        2.0,
        out_of_place,
        1e-4,
        samples=100,
        kappa=1e-12 * ratio,
        why="the gap is kappa over the load, and has to stay above the rounding of positions",
        slow=True,
    )


def trials() -> list[StabilityTrial]:
    """All trials of stacks."""
    return [stack(5, 1e-2), stack(10, 1e-2), *(heavy_on_light(ratio, h) for ratio in (1e4, 1e6) for h in (1e-3, 1e-2))]
