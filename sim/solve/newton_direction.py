"""The Newton direction of the interior point."""

from __future__ import annotations

from sim.dynamics.elimination import factor, solve
from sim.dynamics.loops.coupling_system import factor_coupling, solve_coupling
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import LawForm, NewtonTarget
from sim.solve.complementarity import boundary_step, products_ahead
from sim.solve.inequalities import condense_inequalities, inequality_rhs, recover_inequalities
from sim.solve.newton_matrix import free_matrix
from solvers.compiler import inlined
from solvers.types import Vector

_SHORT = 0.1  # a step below this share of the Newton step is short
_SHARES = 4  # 1, 1/2, 1/4, 1/8 of the terms that can make the matrix indefinite


@inlined
def linearize_step(
    model: Model, data: Data, h: float, q: Vector, v: Vector, smoothing: float, near: bool, undamped: bool
) -> bool:
    """Newton matrix at the present iterate, contacts and limits condensed, eliminated; False if it is singular.

    Beyond a fold of the path, where the determinant is negative, Newton's direction leads back into the fold. There the
    growth of the friction with the normal impulse, and the turning of the arms of impulses, count by a half, then less:
    without them the matrix is that of a step whose friction bounds and arms are given, which has no folds of theirs.
    The direction is Newton's own if no share of them makes the determinant positive, if the strategy asks for it
    (`undamped`), and near a solution. The determinant of a solution may be negative: four corners on curved ground
    hold a box in more directions than a plane does, one of them weakly, and friction that grows with the impulses
    outweighs that hold. Every other direction leads away from such a solution.
    """
    sign = 0
    shares = 0 if near or undamped else _SHARES
    for halvings in range(shares + 1):
        indefinite = 0.5**halvings if halvings < shares else 1.0
        free_matrix(model, data, h, q, v)
        condense_inequalities(model, data, h, smoothing, indefinite, LawForm.STICKING if near else LawForm.PLAIN)
        sign = factor(model, data)
        if sign >= 0:
            break
    return sign != 0 and factor_coupling(model, data)


@inlined
def direction(model: Model, data: Data, h: float, kappa: float, mean: float) -> float:
    """Newton step dnu and the steps of all cones; returns the step to their boundary.

    predictor     full residual, products to kappa                      -> sigma = (mean ahead / mean)^3
    corrector     full residual, products to max(kappa, sigma mean), second-order term        (Mehrotra 1992);
                  omitted where the predictor already lands on kappa. The term is that of the part of the predictor
                  that stays in the cones: the whole term can cancel its own correction and stall
    if short      half the residual, products to half the mean; then a tenth, to nine tenths
    """
    sigma = 0.0
    gap_fraction = 1.0
    alpha = 0.0
    reach = 0.0
    for phase in range(4):
        if phase >= 2:
            if alpha > _SHORT:
                break
            gap_fraction = 0.5 if phase == 2 else 0.1
            sigma = 1.0 - gap_fraction
        target = NewtonTarget(max(kappa, sigma * mean), gap_fraction, reach * reach if phase == 1 else 0.0)
        for d in range(data.dnu.shape[0]):
            data.dnu[d] = -gap_fraction * data.residual[d]
        inequality_rhs(model, data, target)
        solve(model, data, data.dnu, data.dnu)
        solve_coupling(model, data, gap_fraction, data.dnu)
        recover_inequalities(model, data, h, gap_fraction)
        alpha = boundary_step(model, data)
        if phase == 0:
            reach = min(1.0, 0.95 * alpha)
            ahead = products_ahead(model, data, reach)
            if alpha > 1.06 and abs(ahead - kappa) < 0.1 * kappa:
                break
            sigma = min(max(ahead / mean, 0.0), 1.0) ** 3
    return alpha
