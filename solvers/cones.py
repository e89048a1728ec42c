"""The positive orthant: step to the boundary, and the way back onto the central path."""

from __future__ import annotations

from solvers.compiler import kernel
from solvers.types import Vector

_FAR = 1e30
_LEAST = 1e-3  # a variable that fell below this share of its former value has left its cone


@kernel
def orthant_step(x: float, d: float) -> float:
    """Largest a with x + a d >= 0, or 1e30."""
    return -x / d if d < 0.0 else _FAR


@kernel
def onto_path(x: float, y: float, weight: float, kappa: float) -> tuple[float, float]:
    """The positive pair with product kappa and the same difference x - weight y.

    x' = (d + sqrt(d^2 + 4 weight kappa))/2, d = x - weight y: as kappa -> 0 the projection onto the two half-axes,
    smoothed as by Chen and Harker (SIAM J. Matrix Anal. Appl. 14, 1993) and Kanzow (the same, 17, 1996).
    """
    d = x - weight * y
    root = (d * d + 4.0 * weight * kappa) ** 0.5
    if d > 0.0:
        x = 0.5 * (d + root)
        return x, kappa / x
    y = 0.5 * (root - d) / weight
    return kappa / y, y


@kernel
def return_pair(now: Vector, before: Vector, i: int, j: int, weight: float, kappa: float) -> None:
    """now[i], now[j] put onto the central path of kappa where one of the two left its cone."""
    if now[i] <= _LEAST * before[i] or now[j] <= _LEAST * before[j]:
        now[i], now[j] = onto_path(now[i], now[j], weight, kappa)
