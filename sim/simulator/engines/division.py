"""Division of steps: which ones shorter steps may solve."""

from __future__ import annotations

from solvers.status import Status

# reasons that shorter steps may remove; they remove neither NaN nor contacts below the ground
DIVISIBLE = frozenset(
    int(status)
    for status in (
        Status.MAX_ITERATIONS,
        Status.NO_PROGRESS,
        Status.SINGULAR,
        Status.TURN_TOO_LARGE,
        Status.LOOP_SINGULAR,
        Status.SHAPES_CROSSED,
        Status.ENERGY_GAIN,
    )
)
