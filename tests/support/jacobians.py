"""check_jacobian: a Jacobian on a manifold against central differences whose own error is known.

Each column is differenced by the five-point formula (fourth order) at a ladder of steps; the estimate that agrees best
with its neighbour is taken, and the disagreement is its uncertainty (Ridders). Nothing looks at the Jacobian meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
STEPS = 10.0 ** np.arange(-1.5, -7.1, -0.5)


def five_point(f: Callable[[Vector], Vector], direction: Vector, step: float) -> Vector:
    """[f(-2e) - 8 f(-e) + 8 f(e) - f(2e)] / 12e."""
    a, b, c, d = (f(k * step * direction) for k in (-2.0, -1.0, 1.0, 2.0))
    return (a - 8.0 * b + 8.0 * c - d) / (12.0 * step)


def differences(f: Callable[[Vector], Vector], n: int) -> tuple[Vector, Vector]:
    """Jacobian of f at 0 and the uncertainty of every column; columns of f that fail give NaN and are not used."""
    columns, doubts = zip(*(_column(f, direction) for direction in np.eye(n)), strict=True)
    return np.array(columns).T, np.array(doubts)


def _column(f: Callable[[Vector], Vector], direction: Vector) -> tuple[Vector, float]:
    """The derivative along a direction, and its uncertainty."""
    coarse, best, doubt = five_point(f, direction, STEPS[0]), None, np.inf
    for step in STEPS[1:]:
        fine = five_point(f, direction, step)
        change = np.abs(fine - coarse).max()
        if change < doubt:
            best, doubt = fine, change
        coarse = fine
    assert best is not None, "the function could not be evaluated around the point"
    return best, float(doubt)


def check_jacobian(
    f: Callable[[Vector], Vector],
    J: Vector,
    x: Vector,
    retract: Callable[[Vector, Vector], Vector],
    tolerance: float = 1e-6,
) -> None:
    """Largest |J - J_differences| over largest |J_differences| <= tolerance; f(x) in tangent coordinates at f(x)."""
    expected, doubt = differences(lambda dx: f(retract(x, dx)), J.shape[1])
    scale = max(np.abs(expected).max(), 1e-12)
    error = np.abs(J - expected) / scale
    assert np.isfinite(error).all(), f"not finite: {np.argwhere(~np.isfinite(error)).tolist()}"
    row, column = np.unravel_index(np.argmax(error), error.shape)
    assert error[row, column] <= tolerance, (
        f"relative error {error[row, column]:.1e} > {tolerance:.0e} in row {row}, column {column}: "
        f"{J[row, column]:.9g}, differences {expected[row, column]:.9g} +- {doubt[column]:.1e}, scale {scale:.3g}"
    )
