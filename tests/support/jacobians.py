"""Jacobians on manifolds, and those of a step, against central differences whose own error is known.

Each column is differenced by the five-point formula (fourth order) at a ladder of steps; the estimate that agrees best
with its neighbour is taken, and the disagreement is its uncertainty (Ridders). Half of the ladder is enough where that
is a hundredth of what is asked. Nothing looks at the Jacobian meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim.simulator.results import StepResult
from sim.simulator.simulator import Simulator

Vector = NDArray[np.float64]
STEPS = 10.0 ** np.arange(-1.5, -7.1, -0.5)
STENCIL = np.array([-2.0, -1.0, 1.0, 2.0])  # [f(-2e) - 8 f(-e) + 8 f(e) - f(2e)] / 12e
WEIGHTS = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0


def five_point(f: Callable[[Vector], Vector], direction: Vector, step: float) -> Vector:
    """The derivative along a direction."""
    return sum(w * f(k * step * direction) for w, k in zip(WEIGHTS, STENCIL, strict=True)) / step


def differences(
    f: Callable[[Vector], Vector], n: int, *, rows: bool = False, enough: float = 0.0
) -> tuple[Vector, Vector]:
    """Jacobian of f at 0 and the uncertainty of every column; values of f that are NaN are not used.

    rows: f takes all points at once, as rows.
    enough: uncertainty, relative to the largest derivative, up to which half of the steps are tried alone.
    """
    found, doubt = _best_steps(f, n, STEPS[1::2], rows)
    if doubt.max(initial=0.0) > enough * np.abs(found).max(initial=0.0, where=np.isfinite(found)):
        found, doubt = _best_steps(f, n, STEPS, rows)
    assert np.isfinite(doubt).all(), "the function could not be evaluated around the point"
    return found, doubt


def _best_steps(f: Callable[[Vector], Vector], n: int, steps: Vector, rows: bool) -> tuple[Vector, Vector]:
    """Derivatives by the step that agrees best with its neighbour, column by column, and how they differ."""
    points = (steps[:, None] * STENCIL)[..., None, None] * np.eye(n)  # step, place in the stencil, column
    flat = points.reshape(-1, n)
    values = np.asarray(f(flat) if rows else [f(point) for point in flat]).reshape(*points.shape[:-1], -1)
    found = np.einsum("k,skcr->scr", WEIGHTS, values) / steps[:, None, None]
    changes = np.abs(np.diff(found, axis=0)).max(axis=2)
    doubts = np.where(np.isfinite(changes), changes, np.inf)
    best = doubts.argmin(axis=0)
    columns = np.arange(n)
    return found[best + 1, columns].T, doubts[best, columns]


def check_jacobian(
    f: Callable[[Vector], Vector],
    J: Vector,
    x: Vector,
    retract: Callable[[Vector, Vector], Vector],
    tolerance: float = 1e-6,
    *,
    rows: bool = False,
) -> None:
    """Largest |J - J_differences| over largest |J_differences| <= tolerance; f(x) in tangent coordinates at f(x)."""
    expected, doubt = differences(lambda dx: f(retract(x, dx)), J.shape[1], rows=rows, enough=0.01 * tolerance)
    scale = max(np.abs(expected).max(), 1e-12)
    error = np.abs(J - expected) / scale
    assert np.isfinite(error).all(), f"not finite: {np.argwhere(~np.isfinite(error)).tolist()}"
    row, column = np.unravel_index(np.argmax(error), error.shape)
    assert error[row, column] <= tolerance, (
        f"relative error {error[row, column]:.1e} > {tolerance:.0e} in row {row}, column {column}: "
        f"{J[row, column]:.9g}, differences {expected[row, column]:.9g} +- {doubt[column]:.1e}, scale {scale:.3g}"
    )


def check_step(
    sim: Simulator, x: Vector, u: Vector | None = None, tolerance: float = 1e-6, by_input: float = 1e-6
) -> StepResult:
    """A and B of the step from x under u, which is returned; refused steps around it are not used."""
    control = np.zeros(sim.nu) if u is None else u
    result = sim.step(x, control, throw=True)
    A, B = sim.linearize(x, control)

    def moved(states: Vector, controls: Vector) -> Vector:
        count = max(len(states), len(controls))
        us = np.broadcast_to(controls, (count, sim.nu))[:, None]
        ends = sim.rollout_batch(np.broadcast_to(states, (count, sim.nx)), us)
        changes = np.array(sim.difference(ends.x[:, 1], result.x))
        changes[ends.status != 0] = np.nan
        return changes

    check_jacobian(lambda states: moved(states, control[None]), A, x, sim.integrate, tolerance, rows=True)
    if sim.nu:
        check_jacobian(lambda controls: moved(x[None], controls), B, control, np.add, by_input, rows=True)
    return result
