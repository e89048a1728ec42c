"""The positive orthant: step to the boundary."""

from __future__ import annotations

from solvers.jit import kernel

_FAR = 1e30


@kernel
def orthant_step(x: float, d: float) -> float:
    """Largest a with x + a d >= 0, or 1e30."""
    return -x / d if d < 0.0 else _FAR
