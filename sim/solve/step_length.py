"""Step length along the Newton direction."""

from __future__ import annotations

from sim.dynamics.displacements import turn_bodies
from sim.dynamics.momentum_balance import momentum_balance
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import StepOptions
from sim.solve.inequalities import inequality_kinematics, keep_inequalities, move_inequalities, return_inequalities
from sim.solve.merit import Merit, judge, residuals
from solvers.compiler import inlined, kernel
from solvers.types import Vector

_WHOLE = 0.9  # a step to the boundary below this share of the Newton step is taken whole
_TURN = 0.7  # [rad] a body may turn per iteration: gaps are linear in less
_HALVINGS = 12


@kernel
def largest_turn(data: Data) -> float:
    """Largest component of the rotation of any body by the Newton step [rad]."""
    turn = 1e-300
    for i in range(data.twist.shape[0]):
        turn = max(turn, abs(data.twist[i, 3]), abs(data.twist[i, 4]), abs(data.twist[i, 5]))
    return turn


@inlined
def search(
    model: Model,
    data: Data,
    options: StepOptions,
    inputs: tuple[Vector, Vector, Vector],
    sizes: tuple[float, float],
    boundary: float,
    last: Merit,
    worse: float,
) -> tuple[Merit, int]:
    """Merit after a step along the Newton direction, halved until it is better than `last`; and the halvings.

    A step that the boundary of the cones would cut short is not: its pairs that leave their cones return to the
    central path of the present mean. Better is a smaller residual, or one within the noise of the products that it
    belongs to; or smaller violations at a residual that grew less than `worse` times.   sizes: scale, smoothing.
    """
    q, v, u = inputs
    scale, smoothing = sizes
    h = options.h
    whole = boundary < _WHOLE
    nearly = 0.99 if max(last.residual, last.violation) > 0.1 else 0.9999
    alpha = min(nearly if whole else min(1.0, nearly * boundary), _TURN / largest_turn(data))
    for d in range(v.shape[0]):
        data.nu_trial[d] = data.nu[d]
    keep_inequalities(model, data)
    now = last
    for halvings in range(_HALVINGS + 1):
        for d in range(v.shape[0]):
            data.nu[d] = data.nu_trial[d] + alpha * data.dnu[d]
        inside = momentum_balance(model, data, h, q)
        turn_bodies(data, data.rot3)
        inequality_kinematics(model, data, h)
        move_inequalities(model, data, alpha)
        if whole:
            return_inequalities(model, data, h, max(options.kappa, last.mean))
        now = judge(model, data, options.kappa, scale, smoothing, residuals(model, data, h, q, v, u))
        if inside and now.residual <= max(last.residual, options.tolerance, 0.1 * now.mean**0.5):
            return now, halvings
        fits = now.violation <= last.violation and last.violation > options.kappa
        if inside and fits and now.residual < worse * last.residual:
            return now, halvings
        alpha *= 0.5
    return now, _HALVINGS + 1
