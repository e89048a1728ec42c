"""Merit: the distance of an iterate of the interior point from the solution."""

from __future__ import annotations

from typing import NamedTuple

from sim.contact.active_contacts import slip_error
from sim.dynamics.loops.closure import apply_loops
from sim.model.data import Data
from sim.model.model import Model
from sim.solve.complementarity import products
from sim.solve.inequalities import apply_inequalities, apply_limits
from sim.solve.residual import balance_to_wrench, norm, project_wrench
from solvers.compiler import kernel
from solvers.types import Vector

_NEWTON_REACH = 100.0  # of kappa: violations that Newton's method takes away in a few steps


class Merit(NamedTuple):
    """Distance from the solution; everything infinite where a body turns by half a turn."""

    residual: float  # largest equality residual, momenta relative to their scale
    violation: float  # largest |product - kappa|, or violation of the friction law at the present smoothing
    slip: float  # the violation of the friction law alone
    mean: float  # of the complementarity products


@kernel
def is_near(merit: Merit, kappa: float) -> bool:
    """Whether Newton's method can be trusted to end here: products all but kappa, the residual within their noise."""
    return merit.violation < _NEWTON_REACH * kappa and merit.residual < 0.1 * kappa**0.5


@kernel
def residuals(model: Model, data: Data, h: float, q: Vector, v: Vector, u: Vector) -> tuple[float, float]:
    """Largest generalized residual, and largest |gap - slack|; fills residual, wrench, subtree."""
    balance_to_wrench(data)
    e = max(apply_inequalities(model, data), apply_loops(model, data))
    e = max(e, project_wrench(model, data, h, q, v, u))
    apply_limits(model, data)
    return norm(data.residual), e


@kernel
def judge(
    model: Model, data: Data, kappa: float, scale: float, smoothing: float, balance: tuple[float, float]
) -> Merit:
    """Merit of the present iterate, whose residuals are `balance`."""
    mean, violation = products(model, data, kappa)
    slip = slip_error(model, data, smoothing)
    violation = max(violation, slip)
    r = max(balance[0] / scale, balance[1])
    if r < 1e300 and violation < 1e300:
        return Merit(r, violation, slip, mean)
    return Merit(1e301, 1e301, 1e301, 1e301)


@kernel
def follow(
    model: Model, data: Data, least: float, smoothing: float, ratio: float, slip: float
) -> tuple[float, float, float]:
    """Lower the smoothing towards `least` while the friction law holds; returns it, the violation there, and the ratio.

    ratio: of one smoothing to the next; it shrinks where Newton's method lands well within the law.
    slip: the violation at the smoothing given.
    """
    if slip < 0.03 * smoothing:
        ratio = max(1e-4, ratio * ratio)
    elif slip > 0.3 * smoothing:
        ratio = min(1e-2, ratio**0.5)
    while smoothing > least and slip < 0.3 * smoothing:
        smoothing = max(least, ratio * smoothing)
        slip = slip_error(model, data, smoothing)
    return smoothing, slip, ratio
